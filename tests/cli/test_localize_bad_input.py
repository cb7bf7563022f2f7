"""What `localize` answers to maps and logs that cannot be right: an error with a remedy, or a count."""

import dataclasses
import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import MATCH, POSE, SCENE_OBJECTS
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.maps.model import LandmarkMap, MapSource
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import Stamped

from tests.cli.calls import call, refused, topics
from tests.cli.logs import messages, write

SOURCE = MapSource("import", "test")
KINDS = ("hydrant", "person", "suitcase")


def changed(
    change: Callable[[int, SceneObjects], SceneObjects], renamed: dict[str, str] | None = None
) -> list[Stamped]:
    """The lap of `messages` with every scene changed."""
    content = messages(seed=2, renamed=renamed)
    return [
        Stamped(stamped.channel, stamped.log_time_ns, change(i, stamped.message))
        if stamped.channel == SCENE_OBJECTS
        else stamped
        for i, stamped in enumerate(content)
    ]


def surveyed(path: Path, *, repeated: bool = False, scale: float = 1.0) -> Path:
    """The map of the ring that `messages` drives through, its classes all different or three that repeat."""
    truth = messages()[0].message
    classes = tuple(KINDS[i % 3] for i in range(len(truth))) if repeated else truth.classes
    write_map(path, LandmarkMap.surveyed(truth.ids, classes, scale * truth.positions_xy, SOURCE))
    return path


def renamed() -> dict[str, str]:
    return {f"tag {i}": KINDS[i % 3] for i in range(15)}


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write(tmp_path / "log.mcap", messages(seed=2))


@pytest.mark.parametrize(
    ("count", "place", "said"),
    [(0, [], "no confirmed landmarks"), (1, [1.0, 2.0], "one confirmed landmark"), (5, [1.0, 2.0], "lie in one place")],
)
@pytest.mark.parametrize("method", ["default", "thesis"])
def test_maps_without_geometry(
    log: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    count: int,
    place: list[float],
    said: str,
    method: str,
) -> None:
    names = tuple(f"tag {i}" for i in range(count))
    write_map(tmp_path / "map.db", LandmarkMap.surveyed(names, names, [place] * count, SOURCE))
    out = tmp_path / "out.mcap"
    line = refused(capsys, 1, "localize", log, "--map", tmp_path / "map.db", "-o", out, "--method", method)
    assert "map.db: " in line
    assert said in line
    assert not out.exists()


@pytest.mark.slow
@pytest.mark.parametrize("repeated", [False, True])
@pytest.mark.parametrize(("map_scale", "log_scale"), [(1000.0, 1.0), (1.0, 1000.0)])
def test_units_off_by_a_thousand(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], repeated: bool, map_scale: float, log_scale: float
) -> None:
    def scaled(_: int, scene: SceneObjects) -> SceneObjects:
        spread = log_scale**2 * scene.covariances
        return dataclasses.replace(scene, positions_xy=log_scale * scene.positions_xy, covariances=spread)

    database = surveyed(tmp_path / "map.db", repeated=repeated, scale=map_scale)
    log = write(tmp_path / "log.mcap", changed(scaled, renamed() if repeated else None))
    line = refused(capsys, 1, "localize", log, "--map", database, "-o", tmp_path / "out.mcap")
    assert "not in metres, so convert it" in line


@pytest.mark.slow
@pytest.mark.parametrize("repeated", [False, True])
def test_duplicates_are_left_out_and_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], repeated: bool
) -> None:
    def doubled(_: int, scene: SceneObjects) -> SceneObjects:
        if not len(scene):
            return scene
        rows = [0, *range(len(scene))]
        return SceneObjects(
            scene.stamp_ns,
            scene.frame_id,
            tuple(str(i) for i in range(len(rows))),
            tuple(scene.hypotheses[i] for i in rows),
            scene.positions_xy[rows] + np.linspace(0, 0.01, len(rows))[:, None],
            scene.covariances[rows],
            scene.radii_m[rows],
        )

    database = surveyed(tmp_path / "map.db", repeated=repeated)
    names = renamed() if repeated else None
    outputs = []
    for name, content in (("plain", messages(seed=2, renamed=names)), ("doubled", changed(doubled, names))):
        log = write(tmp_path / f"{name}.mcap", content)
        outputs.append(tmp_path / f"{name}_out.mcap")
        capsys.readouterr()
        assert call("localize", log, "--map", database, "-o", outputs[-1]) == 0
    assert "120 objects that repeat another one of the same class and place" in capsys.readouterr().err
    plain, twice = (topics(path)[POSE.topic] for path in outputs)
    assert abs(plain - twice) <= 2


@pytest.mark.slow
@pytest.mark.parametrize("repeated", [False, True])
def test_covariances_zero_or_impossible(tmp_path: Path, capsys: pytest.CaptureFixture[str], repeated: bool) -> None:
    def spoilt(i: int, scene: SceneObjects) -> SceneObjects:
        spread = np.zeros_like(scene.covariances)
        if i % 2 and len(scene):
            spread[0] = [[1.0, 2.0], [2.0, 1.0]]
        return dataclasses.replace(scene, covariances=spread)

    database = surveyed(tmp_path / "map.db", repeated=repeated)
    log = write(tmp_path / "log.mcap", changed(spoilt, renamed() if repeated else None))
    assert call("localize", log, "--map", database, "-o", tmp_path / "out.mcap") == 0
    assert "objects whose covariance is not positive definite" in capsys.readouterr().err
    found = topics(tmp_path / "out.mcap")
    assert found[MATCH.topic] == 120
    assert found[POSE.topic] > 20


@pytest.mark.slow
@pytest.mark.parametrize("repeated", [False, True])
def test_covariances_of_next_to_nothing(tmp_path: Path, repeated: bool) -> None:
    def tiny(_: int, scene: SceneObjects) -> SceneObjects:
        return dataclasses.replace(scene, covariances=1e-30 * scene.covariances)

    database = surveyed(tmp_path / "map.db", repeated=repeated)
    log = write(tmp_path / "log.mcap", changed(tiny, renamed() if repeated else None))
    assert call("localize", log, "--map", database, "-o", tmp_path / "out.mcap") == 0
    assert topics(tmp_path / "out.mcap")[MATCH.topic] == 120


def test_a_map_with_an_impossible_covariance(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    database = surveyed(tmp_path / "map.db")
    with sqlite3.connect(database) as connection:
        connection.execute("UPDATE landmark SET var_x_m2 = 1, cov_xy_m2 = 2, var_y_m2 = 1 WHERE number = 3")
    connection.close()
    line = refused(capsys, 1, "localize", log, "--map", database, "-o", tmp_path / "out.mcap")
    assert "map.db: landmark tag 3: covariance is not symmetric and positive definite" in line
