"""Objects held against the map at a pose: what is matched, what is dropped, and what the match is worth."""

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import Array, between, inverse, transform_points
from mcap_landmarks.localization.matching import Matcher, block_diagonal
from mcap_landmarks.localization.verification import UNMATCHED, Candidates, Constellations, Prior
from mcap_landmarks.messages.scene import SceneObjects

from tests.localization.small_worlds import PLACE_XY, SIGMA_M, elsewhere, landmark_map, matcher, one_place, seen

WORLD = one_place()
MATCHER = matcher(WORLD)
POSE = np.array([-4.0, 1.0, 0.1])
MAP_SIGMA_M = MATCHER.config.map_sigma_m
N = UNMATCHED


def constellation(scene: SceneObjects, by: Matcher = MATCHER) -> Constellations:
    objects = by.objects(scene)
    joint = block_diagonal(objects.covariances[None])
    return by.sets(objects.points_xy[None], joint, objects.probabilities[None], objects.spurious[None])


def start(landmarks: list[int], pose: Array = POSE) -> Candidates:
    return Candidates(np.zeros(1, dtype=np.int64), pose[None], np.array([landmarks]))


def test_least_squares_finds_pose_and_covariance() -> None:
    """Started 0.3 m and 6 degrees off; the covariance is that of independent points."""
    sets = constellation(seen(WORLD, POSE, range(5)))
    off = start([0, 1, 2, 3, 4], POSE + np.array([0.2, -0.2, 0.1]))
    solved = MATCHER.verifier.solve(sets, off, Prior.none(off.pose))
    np.testing.assert_allclose(solved.candidates.pose[0], POSE, atol=1e-4)
    points = transform_points(inverse(POSE), PLACE_XY)
    jacobian = np.concatenate([[[1.0, 0.0, -y], [0.0, 1.0, x]] for x, y in points])
    information = jacobian.T @ jacobian / (SIGMA_M**2 + MAP_SIGMA_M**2)
    np.testing.assert_allclose(solved.covariance[0], np.linalg.inv(information), rtol=1e-3, atol=1e-9)


def test_what_was_known_before_counts_by_its_information() -> None:
    sets = constellation(seen(WORLD, POSE, range(1)))
    before = POSE + np.array([0.1, 0.0, 0.0])
    for sigma_m, share in ((1e-3, 0.0), (1e3, 1.0)):
        information = np.diag([sigma_m**-2, sigma_m**-2, 1e8])
        prior = Prior(before[None], information[None])
        pose = MATCHER.verifier.solve(sets, start([0], before), prior).candidates.pose[0]
        assert pose[0] == pytest.approx(before[0] - 0.1 * share, abs=2e-3)
        assert pose[2] == pytest.approx(POSE[2], abs=1e-4)


def test_all_that_fits_is_matched_from_a_pair() -> None:
    sets = constellation(seen(WORLD, POSE, range(5)))
    fits = MATCHER.verifier.fit(sets, start([0, 1, N, N, N]))
    np.testing.assert_array_equal(fits.candidates.landmarks, [[0, 1, 2, 3, 4]])
    assert (fits.dof[0], fits.chi2[0]) == (7, pytest.approx(0.0, abs=1e-9))


def test_what_lies_elsewhere_stays_unmatched_and_what_was_misread_does_not() -> None:
    """One object is off by more than the gate lets pass; one has another class, but lies exactly where it should."""
    off = np.zeros((5, 2))
    off[2] = [0.5, 0.0]
    other = ("bench", "person", "person", "bench", "bench")
    fits = MATCHER.verifier.fit(constellation(seen(WORLD, POSE, range(5), off, classes=other)), start([0, 1, N, N, N]))
    np.testing.assert_array_equal(fits.candidates.landmarks, [[0, 1, N, 3, 4]])


def test_the_gate_counts_the_errors_of_the_map_too() -> None:
    """Four sigmas of the object, and not three of object and landmark together."""
    off = np.zeros((5, 2))
    off[4] = [4 * SIGMA_M, 0.0]
    fits = MATCHER.verifier.fit(constellation(seen(WORLD, POSE, range(5), off)), start([0, 1, 2, 3, N]))
    np.testing.assert_array_equal(fits.candidates.landmarks, [[0, 1, 2, 3, 4]])


def test_the_nearer_of_two_objects_gets_the_landmark() -> None:
    scene = seen(WORLD, POSE, [0, 1, 2, 2], [[0, 0], [0, 0], [0.08, 0], [0.01, 0]])
    fits = MATCHER.verifier.fit(constellation(scene), start([0, 1, N, N]))
    np.testing.assert_array_equal(fits.candidates.landmarks, [[0, 1, N, 2]])


def test_the_worst_of_many_is_dropped() -> None:
    """Data snooping: the object that was taken for the wrong landmark goes, and gets the right one."""
    sets = constellation(seen(WORLD, POSE, range(5)))
    fits = MATCHER.verifier.fit(sets, start([0, 1, 2, 3, 8]))
    np.testing.assert_array_equal(fits.candidates.landmarks[0, :4], [0, 1, 2, 3])
    assert fits.candidates.landmarks[0, 4] != 8
    np.testing.assert_allclose(fits.candidates.pose[0], POSE, atol=1e-3)


def test_of_three_none_is_dropped() -> None:
    """Of three any two agree: chi-square says that they do not fit, not which of them is wrong."""
    off = np.zeros((3, 2))
    off[2] = [1.0, 1.0]
    sets = constellation(seen(WORLD, POSE, range(3), off))
    fits = MATCHER.verifier.fit(sets, start([0, 1, 2]))
    np.testing.assert_array_equal(fits.candidates.landmarks, [[0, 1, 2]])
    assert (fits.dof[0], fits.chi2[0] > 100) == (3, True)


def test_the_evidence_is_the_likelihood_integrated_over_the_pose() -> None:
    """Against a sum over a grid of poses: Laplace's method is off by what the model bends within a few sigmas."""
    off = SIGMA_M * np.random.default_rng(2).normal(size=(3, 2))
    sets = constellation(seen(WORLD, POSE, range(3), off))
    fits = MATCHER.verifier.fit(sets, start([0, 1, 2]))
    pose, covariance = fits.candidates.pose[0], fits.covariance[0]
    root = np.linalg.cholesky(covariance)
    axis = np.linspace(-5, 5, 41)
    steps = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3) @ root.T
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    around = np.column_stack(
        [
            pose[0] + cos * steps[:, 0] - sin * steps[:, 1],
            pose[1] + sin * steps[:, 0] + cos * steps[:, 1],
            pose[2] + steps[:, 2],
        ]
    )
    expected = transform_points(inverse(around)[:, None], PLACE_XY[None, :3])
    variance = SIGMA_M**2 + MAP_SIGMA_M**2
    square = ((expected - sets.points_xy[0]) ** 2).sum(axis=(1, 2)) / variance
    density = np.exp(-square / 2) / (2 * np.pi * variance) ** 3
    integral = np.log(density.sum() * np.prod(np.diag(root)) * (axis[1] - axis[0]) ** 3)
    log_density = sets.log_density[0]
    unknown = np.log(2 * np.pi * len(MATCHER.index)) + log_density.sum() - log_density.min()
    classes = sets.log_ratio[0, np.arange(3), MATCHER.index.class_of[:3]].sum() + 3 * np.log(0.9)
    assert fits.log_ratio[0] == pytest.approx(integral - unknown + classes, abs=0.01)


def test_each_unmatched_object_costs_what_a_spurious_one_does() -> None:
    verifier = MATCHER.verifier
    three = verifier.fit(constellation(seen(WORLD, POSE, range(3))), start([0, 1, 2]))
    far = seen(WORLD, POSE, [0, 1, 2, 3], [[0, 0], [0, 0], [0, 0], [3.0, 3.0]])
    with_stray = verifier.fit(constellation(far), start([0, 1, 2, N]))
    assert with_stray.candidates.landmarks[0, 3] == N
    # The density expected of the first object is the lowest of all, so a fourth one may lower it.
    density = constellation(far).log_density[0, :3], constellation(seen(WORLD, POSE, range(3))).log_density[0]
    changed = [part.sum() - part.min() for part in density]
    expected = three.log_ratio[0] + np.log(0.1) - changed[0] + changed[1]
    assert with_stray.log_ratio[0] == pytest.approx(expected, abs=1e-9)


def test_a_mirror_image_of_a_place_is_another_place() -> None:
    scene = seen(WORLD, POSE, range(5))
    mirrored = SceneObjects(
        0, "base", scene.ids, scene.hypotheses, scene.positions_xy * [1, -1], scene.covariances, scene.radii_m
    )
    found = MATCHER.match([scene, mirrored])
    assert found[0].pose is not None
    assert found[1].pose is None


@pytest.mark.parametrize("turn", [0.0, 1.5, 3.1])
def test_a_place_is_found_from_any_side(turn: float) -> None:
    pose = np.array([1.0, 1.0, turn])
    match = MATCHER.match([seen(WORLD, pose, [4, 2, 0, 1, 3])])[0]
    assert match.pose is not None
    np.testing.assert_allclose(between(match.pose, pose), np.zeros(3), atol=1e-6)
    assert match.message.landmark_ids == ("l4", "l2", "l0", "l1", "l3")


@pytest.mark.parametrize(("classes", "localized"), [(15, False), (30, True)])
def test_two_objects_do_where_their_classes_are_rare(classes: int, localized: bool) -> None:
    """Thirty landmarks of a class each: a pair is enough; of fifteen classes it is found, and not yet sure."""
    world = landmark_map(np.concatenate([PLACE_XY, elsewhere(25)[0]]), tuple(f"class {i % classes}" for i in range(30)))
    match = matcher(world).match([seen(world, POSE, [1, 3])])[0]
    assert match.message.candidate_ids == ("l1+l3",)
    assert (match.pose is not None) is localized
    assert not localized or match.pose == pytest.approx(POSE, abs=1e-6)
