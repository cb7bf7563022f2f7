"""Which observations show the same landmark: the filter is honest, its gates hold, and a long loop closes."""

from dataclasses import dataclass

import numpy as np
import pytest
from mcap_landmarks.estimation.odometry import Motions, OdometryNoise, motion_covariance
from mcap_landmarks.geometry import se2
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.mapping.data_association import UNLABELLED, Gates, LandmarkFilter, label_observations
from scipy.stats import multivariate_normal

from tests.mapping.drives import Array

GATES = Gates(same=9.0, new=36.0)
ORIGIN = np.zeros(3)
SIGMA_M = 0.1
COVARIANCE = SIGMA_M**2 * np.eye(2)


def started(*points: tuple[float, float], class_ids: tuple[int, ...] | None = None) -> LandmarkFilter:
    """A filter at the origin that knows of landmarks as exactly as it saw them once."""
    state = LandmarkFilter(ORIGIN, GATES)
    see(state, *points, class_ids=class_ids)
    state.log_evidence = 0.0
    return state


def see(state: LandmarkFilter, *points: tuple[float, float], class_ids: tuple[int, ...] | None = None) -> list[int]:
    """Labels of one bundle of objects, all of class 0 unless told."""
    ids = np.array(class_ids or [0] * len(points))
    return state.observe(ids, np.array(points), np.tile(COVARIANCE, (len(points), 1, 1))).tolist()


def test_what_is_seen_again_has_the_same_label() -> None:
    state = started((5.0, 0.0), (3.0, 2.0))
    assert see(state, (3.05, 2.0), (5.0, 0.1), (0.0, 4.0)) == [1, 0, 2]
    np.testing.assert_allclose(state.mean[3:], [5, 0.05, 3.025, 2, 0, 4], atol=0.01)


def test_objects_of_another_class_are_other_landmarks() -> None:
    state = started((5.0, 0.0))
    assert see(state, (5.0, 0.0), class_ids=(1,)) == [1]
    assert see(state, (5.0, 0.0), class_ids=(1,)) == [1]
    assert see(state, (5.0, 0.0), class_ids=(0,)) == [0]


@pytest.mark.parametrize(("sigmas", "label"), [(2.9, 0), (3.1, UNLABELLED), (5.9, UNLABELLED), (6.1, 1)])
def test_between_the_gates_an_observation_is_evidence_for_neither(sigmas: float, label: int) -> None:
    """The landmark's place and the observation are each known to a decimetre."""
    state = started((5.0, 0.0))
    mean, evidence = state.mean.copy(), state.log_evidence
    assert see(state, (5.0, sigmas * SIGMA_M * 2**0.5)) == [label]
    if label == UNLABELLED:
        np.testing.assert_array_equal(state.mean, mean)
    assert (state.log_evidence < evidence) is True


def test_the_gates_are_those_of_rare_accidents() -> None:
    gates = Gates()
    assert gates.same == pytest.approx(-2 * np.log(0.001))
    assert gates.new == pytest.approx(-4 * np.log(0.0001))


def test_each_landmark_takes_one_object_and_most_objects_find_theirs() -> None:
    """The first object is nearer to the second landmark, but then the second object would have none."""
    state = started((5.0, 0.0), (5.0, 0.6))
    assert see(state, (5.0, 0.32), (5.0, 0.75)) == [0, 1]
    near = started((5.0, 0.0))
    assert see(near, (5.0, 0.15), (5.0, 0.05)) == [UNLABELLED, 0]


def test_pairs_must_fit_together_and_the_one_that_spoils_the_fit_leaves() -> None:
    """Each pair passes its gate since the heading is open, but three turn one way and one the other."""
    points = [(10.0, 0.0), (8.0, 3.0), (8.0, -3.0), (9.0, 6.0)]
    state = started(*points)
    state.move(np.array([0.0, 0.0, 0.0]), np.diag([1e-6, 1e-6, 0.1**2]))
    turned = [tuple(se2.transform_points(np.array([0.0, 0.0, 0.08]), np.array(point))) for point in points]
    other_way = tuple(se2.transform_points(np.array([0.0, 0.0, -0.12]), np.array(points[3])))
    assert see(state, *turned[:3], other_way) == [0, 1, 2, UNLABELLED]
    assert state.mean[2] == pytest.approx(-0.08, abs=0.02)


def test_the_evidence_is_the_density_of_what_was_foreseen_and_a_hundred_metres_square_for_the_rest() -> None:
    fresh = LandmarkFilter(ORIGIN, GATES)
    see(fresh, (5.0, 0.0))
    assert fresh.log_evidence == pytest.approx(-np.log(1e4))
    state = started((5.0, 0.0), (0.0, 5.0))
    see(state, (5.1, 0.2), (0.0, 4.9), (-20.0, 0.0))
    spread = 2 * SIGMA_M**2 * np.eye(4)
    foreseen = multivariate_normal.logpdf([0.1, 0.2, 0.0, -0.1], cov=spread)
    assert state.log_evidence == pytest.approx(foreseen - np.log(1e4), abs=1e-9)


def test_motion_moves_the_robot_alone() -> None:
    state = started((5.0, 0.0))
    state.move(np.array([1.0, 0.5, np.pi / 2]), 1e-4 * np.eye(3))
    state.move(np.array([1.0, 0.0, np.pi / 2]), 1e-4 * np.eye(3))
    np.testing.assert_allclose(state.mean, [1.0, 1.5, -np.pi, 5.0, 0.0], atol=1e-12)
    assert see(state, (-4.0, 1.5)) == [0]


@dataclass(frozen=True, slots=True)
class Walk:
    """Odometry and observations of a short walk, and the truth."""

    poses: Array
    odometry: Array
    covariances: Array
    landmarks_xy: Array
    seen: Array


def walk(seed: int, steps: int = 12) -> Walk:
    """Around a corner, with odometry that errs by a twentieth of a radian per step."""
    rng = np.random.default_rng(seed)
    landmarks = np.array([[4.0, 1.0], [6.0, -2.0], [3.0, 6.0], [-1.0, 5.0]])
    relative = np.tile([0.5, 0.02, 0.15], (steps, 1))
    covariances = np.tile(np.diag([0.05, 0.03, 0.05]) ** 2, (steps, 1, 1))
    slipped = relative + rng.normal(size=relative.shape) * [0.05, 0.03, 0.05]
    poses, odometry = [np.array([1.0, 1.0, -0.5])], [np.array([1.0, 1.0, -0.5])]
    for step, wrong in zip(relative, slipped, strict=True):
        poses.append(se2.compose(poses[-1], step))
        odometry.append(se2.compose(odometry[-1], wrong))
    local = se2.transform_points(se2.inverse(np.array(poses))[:, None], landmarks)
    seen = local + rng.normal(0, SIGMA_M, local.shape)
    return Walk(np.array(poses), np.array(odometry), covariances, landmarks, seen)


def errors_of(state: LandmarkFilter, truth: Array) -> Array:
    """Right-invariant errors (3 + 2 L,): what turns the estimate about the origin and shifts it to the truth."""
    turn = float(wrap(truth[2] - state.mean[2]))
    rotated = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    spread = np.array([[np.sin(turn), np.cos(turn) - 1], [1 - np.cos(turn), np.sin(turn)]]) / turn
    points, meant = np.delete(state.mean, 2).reshape(-1, 2), np.delete(truth, 2).reshape(-1, 2)
    shifts = np.linalg.solve(spread, (meant - points @ rotated.T).T).T
    return np.insert(shifts.ravel(), 2, turn)


def test_the_filter_is_honest() -> None:
    """Its errors after a walk have its covariance, whatever it saw on the way."""
    nees = []
    for seed in range(60):
        made = walk(seed)
        state = LandmarkFilter(made.odometry[0], Gates())
        steps = se2.between(made.odometry[:-1], made.odometry[1:])
        for t, points in enumerate(made.seen):
            if t:
                state.move(steps[t - 1], made.covariances[t - 1])
            visible = [0, 1] if t % 3 else [0, 1, 2, 3]
            ids = np.array(visible)
            labels = state.observe(ids, points[visible], np.tile(COVARIANCE, (len(visible), 1, 1)))
            np.testing.assert_array_equal(state.class_ids[labels[labels >= 0]], ids[labels >= 0])
        truth = np.concatenate([made.poses[-1], made.landmarks_xy[state.class_ids].ravel()])
        error = errors_of(state, truth)
        nees.append(error @ np.linalg.solve(state.covariance, error) / len(error))
    assert 0.8 < np.mean(nees) < 1.25


def test_the_filter_never_grows_sure_of_a_heading_that_it_cannot_know() -> None:
    """Without a landmark known beforehand nothing tells the heading of the first pose; what came after is relative."""
    made = walk(3)
    state = LandmarkFilter(made.odometry[0], Gates())
    state.covariance = np.diag([0.0, 0.0, 0.3**2])
    for points in (made.seen[0], made.seen[0], made.seen[0]):
        state.observe(np.arange(4), points, np.tile(COVARIANCE, (4, 1, 1)))
    assert state.covariance[2, 2] == pytest.approx(0.09)


def test_labels_are_given_bundle_by_bundle_with_the_filters_poses() -> None:
    made = walk(1)
    bundle = np.repeat([0, 1, 2, 5, 12], 4)
    points = made.seen[[0, 1, 2, 5, 12]].reshape(-1, 2)
    class_ids = np.tile([0, 0, 1, 1], 5)
    covariances = np.tile(COVARIANCE, (20, 1, 1))
    labels = label_observations(made.odometry, made.covariances, bundle, class_ids, points, covariances)
    assert labels.landmark.tolist() == [0, 1, 2, 3] * 5
    assert labels.poses.shape == made.odometry.shape
    np.testing.assert_array_equal(labels.poses[0], made.odometry[0])
    off = se2.between(made.poses, labels.poses)
    drift = se2.between(made.poses, made.odometry)
    assert np.abs(off[12]).max() < 0.15 < np.abs(drift[12]).max()
    assert -200 < labels.log_evidence < 0
    blind = label_observations(made.odometry, made.covariances / 100, bundle, class_ids, points, covariances)
    assert blind.log_evidence < labels.log_evidence


RADIUS_M, STEP_M, REACH_M = 40.0, 0.4, 12.0
NOISE = OdometryNoise(0.02, float(np.deg2rad(0.5)), float(np.deg2rad(0.5)))
GROUPS, CLASSES = 20, 3
BLIND = range(3, 6)
"""Groups left out: over 25 m nothing is seen, and the heading slips by several degrees."""


def world(rng: np.random.Generator) -> tuple[Array, np.ndarray]:
    """Groups of three objects along a ring, and their classes."""
    angle = np.repeat([2 * np.pi * i / GROUPS for i in range(GROUPS) if i not in BLIND], 3)
    angle = angle + np.tile([-0.06, 0.0, 0.06], len(angle) // 3)
    radius = RADIUS_M + rng.uniform(3, 8, len(angle))
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]), rng.integers(0, CLASSES, len(angle))


def once_around(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """True poses (T, 3), odometry (T, 3) from the first of them on, covariances (T - 1, 3, 3) of its steps."""
    angle = np.arange(0, 2.2 * np.pi, STEP_M / RADIUS_M)
    poses = np.column_stack([RADIUS_M * np.cos(angle), RADIUS_M * np.sin(angle), angle + np.pi / 2])
    steps = se2.between(poses[:-1], poses[1:])
    covariances = motion_covariance(Motions(steps, np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])), NOISE)
    slipped = steps + (np.linalg.cholesky(covariances) @ rng.normal(size=(*steps.shape, 1)))[..., 0]
    odometry = poses[:1]
    for step in slipped:
        odometry = np.concatenate([odometry, se2.compose(odometry[-1], step)[None]])
    return poses, odometry, covariances


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2])
def test_after_a_long_loop_what_was_seen_first_is_recognised(seed: int) -> None:
    rng = np.random.default_rng(seed)
    objects, class_ids = world(rng)
    poses, odometry, covariances = once_around(rng)
    local = se2.transform_points(se2.inverse(poses)[:, None], objects)
    bundle, which = np.nonzero(np.hypot(local[..., 0], local[..., 1]) < REACH_M)
    points = local[bundle, which] + rng.normal(0, 0.03, (len(bundle), 2))
    spread = np.broadcast_to(0.03**2 * np.eye(2), (len(bundle), 2, 2))
    labels = label_observations(odometry, covariances, bundle, class_ids[which], points, spread).landmark
    known = labels != UNLABELLED
    pairs = set(zip(labels[known].tolist(), which[known].tolist(), strict=True))
    assert len(pairs) == len(objects), "an object has two labels, or a label two objects"
    assert known.mean() > 0.99
