"""Labels of what a drifting robot saw: a place that it left long ago is recognised."""

import numpy as np
import pytest
from mcap_landmarks.estimation.odometry import Motions, OdometryNoise, motion_covariance
from mcap_landmarks.geometry.se2 import Array, between, compose, inverse, transform_points
from mcap_landmarks.mapping.data_association import UNLABELLED, label_observations

RADIUS_M, STEP_M, REACH_M, SIGMA_M = 40.0, 0.2, 12.0, 0.03
NOISE = OdometryNoise(0.02, float(np.deg2rad(0.5)), float(np.deg2rad(0.5)))
GROUPS, KINDS = 20, 3
BLIND = range(3, 6)
"""Groups left out: over 25 m nothing is seen, and the heading slips by several degrees."""


def world(rng: np.random.Generator) -> tuple[Array, np.ndarray]:
    """Groups of three objects along a ring, and their kinds."""
    angle = np.repeat([2 * np.pi * i / GROUPS for i in range(GROUPS) if i not in BLIND], 3)
    angle = angle + np.tile([-0.06, 0.0, 0.06], len(angle) // 3)
    radius = RADIUS_M + rng.uniform(3, 8, len(angle))
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]), rng.integers(0, KINDS, len(angle))


def once_around(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """True poses (T, 3), odometry (T, 3) from the first of them on, covariances (T - 1, 3, 3) of its steps."""
    angle = np.arange(0, 2.2 * np.pi, STEP_M / RADIUS_M)
    poses = np.column_stack([RADIUS_M * np.cos(angle), RADIUS_M * np.sin(angle), angle + np.pi / 2])
    steps = between(poses[:-1], poses[1:])
    covariances = motion_covariance(Motions(steps, np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])), NOISE)
    slipped = steps + (np.linalg.cholesky(covariances) @ rng.normal(size=(*steps.shape, 1)))[..., 0]
    odometry = poses[:1]
    for step in slipped:
        odometry = np.concatenate([odometry, compose(odometry[-1], step)[None]])
    return poses, odometry, covariances


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2])
def test_after_a_long_loop_what_was_seen_first_is_recognised(seed: int) -> None:
    rng = np.random.default_rng(seed)
    objects, kinds = world(rng)
    poses, odometry, covariances = once_around(rng)
    local = transform_points(inverse(poses)[:, None], objects)
    bundle, which = np.nonzero(np.hypot(local[..., 0], local[..., 1]) < REACH_M)
    points = local[bundle, which] + rng.normal(0, SIGMA_M, (len(bundle), 2))
    spread = np.broadcast_to(SIGMA_M**2 * np.eye(2), (len(bundle), 2, 2))
    labels = label_observations(odometry, covariances, bundle, kinds[which], points, spread).landmark
    known = labels != UNLABELLED
    pairs = set(zip(labels[known].tolist(), which[known].tolist(), strict=True))
    assert len(pairs) == len(objects), "an object has two labels, or a label two objects"
    assert known.mean() > 0.99
