"""What moves is no landmark: a street of parked cars, on which others drive and somebody walks, by the command line."""

import json
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import POSE
from mcap_landmarks.maps.database import read_map
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.recording.reader import open_recording

from tests.cli.calls import call, refused
from tests.fusion.street import CLOUD, DRIVING, PARKED, base_at, write_street

SCAN = ("--scan-from", CLOUD.topic)


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("street") / "street.mcap"
    write_street(path, PARKED + DRIVING, 5.0)
    return path


@pytest.fixture(scope="module")
def fused(street: Path) -> Path:
    """The street with its scene objects, so that each verb need not make them anew."""
    out = street.with_name("fused.mcap")
    assert call("run", street, "-o", out, *SCAN, "--stages", "cluster,fuse") == 0
    return out


def off_m(landmark_map: LandmarkMap) -> np.ndarray:
    """How far each confirmed landmark is from the nearest parked car, in m; the map begins where the drive does."""
    truth = np.array([[car.solid.x, car.solid.y] for car in PARKED])
    places = landmark_map.positions_xy[~landmark_map.tentative]
    return np.hypot(*(places[:, None] - truth).transpose(2, 0, 1)).min(axis=1)


def test_parked_cars_become_the_map_and_nothing_that_moves(
    fused: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("map", fused, "--map", tmp_path / "map.db", "--json") == 0
    (log,) = json.loads(capsys.readouterr().out)["logs"]
    moved = "objects that seem to move: "
    counted = {reason: count for reason, count in log["dropped"].items() if reason.startswith(moved)}
    assert set(counted) == {moved + name for name in ("car", "truck", "person")}
    assert counted[moved + "car"] > 35
    found = read_map(tmp_path / "map.db")
    assert np.count_nonzero(~found.tentative) >= 5
    assert off_m(found).max() < 0.3
    assert found.movable.all()


def test_a_map_of_what_is_fixed_has_no_cars(fused: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    message = refused(capsys, 1, "map", fused, "--map", tmp_path / "map.db", "--fixed")
    assert "holds no object in any bundle with odometry that could be a landmark" in message
    assert "objects that may stand elsewhere another day: car" in message


def test_localizing_counts_what_moves(fused: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("map", fused, "--map", tmp_path / "map.db") == 0
    capsys.readouterr()
    assert call("localize", fused, "--map", tmp_path / "map.db", "-o", tmp_path / "out.mcap", "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert document["dropped"]["objects that seem to move: car"] > 30
    assert document["statuses"]["localized"] >= 0.7 * document["bundles"]
    errors = []
    with open_recording(tmp_path / "out.mcap") as recording:
        for raw in recording.messages(recording.connections(POSE.topic)):
            pose = decode(POSE.message, raw.data)
            errors.append(pose.position_m[0] - base_at((pose.stamp_ns - 10**9) / 1e9)[0])
    assert np.median(np.abs(errors)) < 0.1


def test_fixed_maps_are_refused_where_nothing_is(
    fused: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("map", fused, "--map", tmp_path / "map.db") == 0
    command = "localize", fused, "--map", tmp_path / "map.db", "-o", tmp_path / "out.mcap", "--fixed"
    assert "landmark" in refused(capsys, 1, *command)


def test_a_street_where_nothing_stands_still_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A map of what moves would be sure and wrong."""
    log = tmp_path / "traffic.mcap"
    write_street(log, DRIVING[:2], 3.0)
    assert call("run", log, "-o", tmp_path / "fused.mcap", *SCAN, "--stages", "cluster,fuse") == 0
    message = refused(capsys, 1, "map", tmp_path / "fused.mcap", "--map", tmp_path / "map.db")
    assert "objects that seem to move: car" in message
    assert not (tmp_path / "map.db").exists()
