"""What is written reads back, by us and by evo."""

import csv
import io
import json
import warnings
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.evaluation.export import TrajectoryFormat, render
from mcap_landmarks.evaluation.pose_topics import PoseTrack
from mcap_landmarks.evaluation.trajectory import Trajectory
from mcap_landmarks.resources import resource

EPOCH_NS = 1_767_225_600_000_000_001
POSES = np.array([[1.0, 2.0, 0.5], [1.5, -2.0, -3.0], [2.0, 0.0, np.nan]])
SPREADS = np.stack([np.diag([0.01, 0.04, 0.0025]), np.full((3, 3), np.nan), np.full((3, 3), np.nan)])


def track(count: int = 3) -> PoseTrack:
    """Poses of which the third has no heading and the first alone a covariance."""
    times = EPOCH_NS + np.arange(count) * 10**8
    return PoseTrack("/p", "map", Trajectory.of(times, POSES[:count], SPREADS[:count]), (), (), ())


@pytest.mark.parametrize("form", [TrajectoryFormat.TUM, TrajectoryFormat.KITTI])
def test_evo_reads_what_is_written(form: TrajectoryFormat, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from evo.tools import file_interface  # noqa: PLC0415 - evo warns when it is imported

    text, notes = render(track(), form)
    (tmp_path / "t.txt").write_text(text)
    read = {"tum": file_interface.read_tum_trajectory_file, "kitti": file_interface.read_kitti_poses_file}[form]
    found = read(tmp_path / "t.txt")
    assert found.check()[0]
    np.testing.assert_allclose(found.positions_xyz, [[1, 2, 0], [1.5, -2, 0]])
    headings = [np.arctan2(pose[1, 0], pose[0, 0]) for pose in found.poses_se3]
    np.testing.assert_allclose(headings, [0.5, -3.0], atol=1e-12)
    assert notes[0] == "1 poses without heading are left out; csv and json have them"
    if form is TrajectoryFormat.TUM:
        assert text.split()[0] == "1767225600.000000001"


def test_tables_have_every_pose_and_its_covariance() -> None:
    first, second, third = csv.DictReader(io.StringIO(render(track(), TrajectoryFormat.CSV)[0]))
    assert (first["time_ns"], first["time"]) == (str(EPOCH_NS), "2026-01-01T00:00:00.000000001Z")
    assert (float(first["var_y_m2"]), float(first["cov_xy_m2"]), float(first["var_heading_rad2"])) == (0.04, 0, 0.0025)
    assert (second["heading_rad"], second["var_x_m2"]) == ("-3.0", "")
    assert (third["x_m"], third["heading_rad"]) == ("2.0", "")


def test_the_document_fits_its_schema() -> None:
    document = json.loads(render(track(), TrajectoryFormat.JSON)[0])
    jsonschema.validate(document, json.loads(resource("schemas", "json/trajectory.schema.json").read_text()))
    assert [pose["heading_rad"] for pose in document["poses"]] == [0.5, -3.0, None]
    assert document["poses"][0]["covariance"][1] == [0, 0.04, 0]
    assert document["poses"][1]["covariance"] is None


def test_no_heading_at_all() -> None:
    bare = PoseTrack("/p", "map", Trajectory.of(np.array([1]), POSES[2:]), (), (), ())
    with pytest.raises(RecordingError, match="/p: no pose has a heading, which tum needs; use --format csv or json"):
        render(bare, TrajectoryFormat.TUM)
    assert len(render(bare, TrajectoryFormat.CSV)[0].splitlines()) == 2
