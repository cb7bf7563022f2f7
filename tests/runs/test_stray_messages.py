"""Single messages of another frame, or a CameraInfo of zeros, cost themselves and no more, and are counted."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_INFO
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.runs.pipeline import LogRun, run_stages
from mcap_landmarks.runs.plan import Request
from mcap_landmarks.stage import Stamped

from tests.cli.logs import write
from tests.runs.chain import COUNT, STEP_NS, raw_messages, two_posts

BLIND = np.zeros((3, 3))


def run(folder: Path, messages: list[Stamped]) -> LogRun:
    log, model = write(folder / "log.mcap", messages), two_posts(folder / "model.onnx")
    return run_stages(Request(log, files={"model": model}), folder / "out.mcap", ["detect", "cluster", "fuse"], "run")


def dropped(found: LogRun, stage: str) -> Mapping[str, int]:
    return next(one for one in found.stages if one.stage == stage).outcome.dropped


@pytest.mark.parametrize("row", [0, 3])
@pytest.mark.parametrize("frame", ["", "other_link"])
def test_one_scan_of_a_frame_that_nothing_leads_to_is_left_out(tmp_path: Path, row: int, frame: str) -> None:
    def changed(one: Stamped) -> Stamped:
        if isinstance(one.message, LaserScan) and one.log_time_ns == (row + 1) * STEP_NS:
            return replace(one, message=replace(one.message, frame_id=frame))
        return one

    found = run(tmp_path, [changed(one) for one in raw_messages()])
    assert dropped(found, "cluster")["messages of /scan of another frame than the others"] == 1
    assert found.outcome.bundles == COUNT - 1


def infos(*intrinsics: np.ndarray) -> list[Stamped]:
    """The log with CameraInfos of several K, one at each step."""
    messages = raw_messages()
    given = next(one.message for one in messages if isinstance(one.message, CameraInfo))
    others = [one for one in messages if one.channel != CAMERA_INFO]
    none = np.zeros((3, 4))
    more = [
        Stamped(CAMERA_INFO, 1 + i * STEP_NS, replace(given, intrinsics=k, projection=none))
        for i, k in enumerate(intrinsics)
    ]
    return sorted([*others, *more], key=lambda one: one.log_time_ns)


GOOD = np.array([[60.0, 0, 32], [0, 60, 36], [0, 0, 1]])


@pytest.mark.parametrize("intrinsics", [(GOOD, BLIND, GOOD), (BLIND, GOOD, GOOD)])
def test_a_camera_info_of_zeros_is_left_out(tmp_path: Path, intrinsics: tuple[np.ndarray, ...]) -> None:
    found = run(tmp_path, infos(*intrinsics))
    assert dropped(found, "fuse")["messages of /camera/camera_info without a focal length, which others have"] == 1
    assert found.outcome.bundles == COUNT


def test_a_camera_that_is_never_calibrated_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no focal length"):
        run(tmp_path, infos(BLIND, BLIND))
