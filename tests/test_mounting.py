"""Where sensors sit: the base frame as found, and a file of extrinsics over what the log says."""

from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import TF_STATIC
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.mounting import Mounting
from mcap_landmarks.stage import Bundle

LEVEL = np.array([0.0, 0.0, 0.0, 1.0])


def bundle(*edges: tuple[str, str, float]) -> Bundle:
    steps = tuple(Transform(0, parent, child, np.array([x, 0.0, 0.0]), LEVEL) for parent, child, x in edges)
    return Bundle(1, 1, {TF_STATIC: TFMessage(steps)} if steps else {})


@pytest.mark.parametrize(
    ("edges", "base"),
    [
        ([("base_footprint", "base_link", 0), ("base_link", "laser", 1)], "base_footprint"),
        ([("/base_link", "/laser", 1), ("odom", "/base_link", 5)], "base_link"),
        ([("odom", "chassis", 5), ("chassis", "mast", 1), ("mast", "laser", 1)], "chassis"),
        ([("mast", "camera", 1)], "laser"),
        ([], "laser"),
    ],
)
def test_the_base_is_what_carries_the_sensor(edges: list[tuple[str, str, float]], base: str) -> None:
    assert Mounting().base(bundle(*edges), "/laser") == base


def test_the_file_wins_over_the_log_and_fills_its_gaps(tmp_path: Path) -> None:
    path = tmp_path / "mount.json"
    path.write_text(
        '{"transforms": [{"parent": "base_link", "child": "laser", "xyz": [3, 0, 0]},'
        ' {"parent": "laser", "child": "camera", "xyz": [0, 0, 1], "rpy": [0, 0, 1.5707963267948966]}]}'
    )
    mounting = Mounting(path)
    now = bundle(("base_footprint", "base_link", 0.5), ("base_link", "laser", 1.0))
    np.testing.assert_allclose(mounting.lookup(now, "base_footprint", "laser")[:3, 3], [3.5, 0, 0])
    np.testing.assert_allclose(
        mounting.lookup(now, "base_footprint", "camera")[:3, :2], [[0, -1], [1, 0], [0, 0]], atol=1e-12
    )


def test_later_transforms_count() -> None:
    mounting = Mounting()
    for x in (1.0, 2.0):
        assert mounting.lookup(bundle(("base_link", "laser", x)), "base_link", "laser")[0, 3] == x
