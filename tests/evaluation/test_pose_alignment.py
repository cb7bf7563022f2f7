"""Poses that hardly move tell the rotation of an alignment by their headings, or not at all."""

import numpy as np
import pytest
from mcap_landmarks.errors import UsageError
from mcap_landmarks.evaluation.pose_alignment import RotationFrom, align_poses
from mcap_landmarks.geometry.se2 import compose

MOTION = np.array([3.0, 4.0, 2.0])
BACK = np.array([-2.3888, 4.3925, -2.0])
"""The inverse of the motion: its rotation is -114.6 degrees."""


def poses(
    moved_m: float, count: int, sigma_m: float = 0.005, sigma_rad: float = 0.002
) -> tuple[np.ndarray, np.ndarray]:
    """The estimate, in a frame of its own, and the truth of a robot that moves so far in all, straight ahead."""
    truth = np.column_stack([np.linspace(0, moved_m, count), np.zeros((count, 2))])
    errors = np.random.default_rng(1).normal(0, [sigma_m, sigma_m, sigma_rad], (count, 3))
    return compose(MOTION, truth + errors), truth


@pytest.mark.parametrize("count", [2, 5, 30, 300])
@pytest.mark.parametrize("moved_m", [0.0, 0.003])
def test_a_robot_that_stands_is_aligned_by_headings(moved_m: float, count: int) -> None:
    found = align_poses(*poses(moved_m, count))
    assert found.rotation_from is RotationFrom.HEADINGS
    np.testing.assert_allclose(found.reference_from_estimate, BACK, atol=0.03)
    assert found.rotation_sigma_rad < 0.005


@pytest.mark.parametrize("count", [5, 30, 300])
def test_a_robot_that_drives_is_aligned_by_positions(count: int) -> None:
    found = align_poses(*poses(5.0, count))
    assert found.rotation_from is RotationFrom.POSITIONS
    assert abs(found.reference_from_estimate[2] + 2.0) < 4 * found.rotation_sigma_rad < np.radians(1)


def test_the_sigma_of_the_rotation_is_that_of_many_draws() -> None:
    """Rotations of 400 draws scatter as much as each says of itself."""
    rng = np.random.default_rng(3)
    truth = np.column_stack([rng.normal(0, 0.5, (20, 2)), np.zeros(20)])
    draws = [align_poses(truth + rng.normal(0, 0.02, (20, 3)), truth) for _ in range(400)]
    scatter = np.std([draw.reference_from_estimate[2] for draw in draws])
    assert np.mean([draw.rotation_sigma_rad for draw in draws]) == pytest.approx(scatter, rel=0.1)


def test_one_pose_is_aligned_by_its_heading() -> None:
    found = align_poses(MOTION[None], np.zeros((1, 3)))
    assert found.document()["rotation_sigma_deg"] is None
    np.testing.assert_allclose(compose(found.reference_from_estimate, MOTION), np.zeros(3), atol=1e-12)


def test_headings_that_are_worse_do_not_count() -> None:
    """A turn of three degrees is more than positions leave open, but these headings tell less."""
    found = align_poses(*poses(0.09, 30, sigma_rad=1.0))
    assert found.rotation_from is RotationFrom.POSITIONS
    assert 1 < np.degrees(found.rotation_sigma_rad) < 20 / 3


@pytest.mark.parametrize(
    ("heading_rad", "reason"), [(np.nan, "no headings are known"), (2.0, "headings tell too many")]
)
def test_what_nothing_tells_is_refused(heading_rad: float, reason: str) -> None:
    estimate, truth = poses(0.0, 30)
    estimate[:, 2] = heading_rad * np.random.default_rng(5).normal(0, 1, 30)
    with pytest.raises(UsageError, match=f"30 poses hardly move .* {reason}; go without --align"):
        align_poses(estimate, truth)
