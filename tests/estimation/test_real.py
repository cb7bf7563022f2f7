"""Real snapshots, where the data is there."""

from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.estimation.calibration import calibrate
from mcap_landmarks.estimation.pose import solve_poses

from tests.benchmark.snapshots import COVARIANCE, read_snapshots


@pytest.mark.slow
def test_a_real_cameras_ranges_are_depths_and_positions_good(shared_data: Path) -> None:
    given = read_snapshots(shared_data / "mrclam" / "mrclam1.mat")
    model = calibrate(given.landmarks_xy, given.range_m, given.bearing_rad, COVARIANCE, mask=given.mask).model
    assert 0.85 < model.depth < 1.05
    assert (model.scale < 0.6).all()
    solved = solve_poses(
        given.landmarks_xy,
        model.distance_m(given.range_m, given.bearing_rad),
        given.bearing_rad,
        COVARIANCE * np.outer(model.scale, model.scale),
        mask=given.mask,
        robust_dof=3.0,
    )
    off = np.linalg.norm(solved.map_from_base[:, :2] - given.poses[:, :2], axis=1)
    assert np.median(off) < 0.04
    assert (off < 0.2).mean() > 0.98
    assert (off < 1).all()
