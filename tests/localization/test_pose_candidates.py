"""Candidate poses from pairs and triangles: no place is missed that a group of objects tells."""

from itertools import combinations

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import Array, between
from mcap_landmarks.localization.matching import Matcher, block_diagonal
from mcap_landmarks.localization.pose_candidates import PoseCandidates
from mcap_landmarks.localization.verification import UNMATCHED, Constellations
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.messages.scene import SceneObjects

from tests.localization.small_worlds import PLACE_CLASSES, PLACE_XY, elsewhere, landmark_map, matcher, one_place, seen

WORLD = one_place()
POSE = np.array([-4.0, 1.0, 0.1])


def looked_up(by: Matcher, scene: SceneObjects) -> tuple[PoseCandidates, Constellations, np.ndarray]:
    objects = by.objects(scene)
    joint = block_diagonal(objects.covariances[None])
    sets = by.sets(objects.points_xy[None], joint, objects.probabilities[None], objects.spurious[None])
    return PoseCandidates(by.index, 0.03), sets, np.ones((1, len(objects.rows)), dtype=np.bool_)


def is_found(poses: Array, pose: Array = POSE) -> bool:
    apart = np.abs(between(pose, poses))
    return bool((apart < [0.05, 0.05, 0.02]).all(axis=1).any())


@pytest.mark.parametrize("rows", list(combinations(range(5), 3)), ids=str)
def test_each_triangle_of_a_place_tells_its_pose(rows: tuple[int, ...]) -> None:
    candidates, sets, fresh = looked_up(matcher(WORLD), seen(WORLD, POSE, rows))
    found = candidates.triangles(sets, fresh)
    assert is_found(found.pose)
    assert rows in [tuple(landmarks) for landmarks in found.landmarks.tolist()]


def test_each_pair_tells_its_pose_where_pairs_are_few() -> None:
    world = landmark_map(PLACE_XY, ("a", "b", "c", "d", "a"))
    candidates, sets, fresh = looked_up(matcher(world), seen(world, POSE, range(5)))
    assert candidates.pairs_are_few
    found = candidates.pairs(sets, fresh)
    for one, other in combinations(range(5), 2):
        matched = [UNMATCHED] * 5
        matched[one], matched[other] = one, other
        assert matched in found.landmarks.tolist() or is_found(found.pose)
    assert not PoseCandidates(matcher(one_place()).index, 0.03).pairs_are_few


def test_three_in_line_tell_it_too() -> None:
    """A flat triangle reads the same from both sides: both are tried."""
    line = np.array([[0.0, 0.0], [1.5, 0.0], [4.0, 0.0]])
    world = landmark_map(np.concatenate([line, elsewhere()[0]]), ("bench", "person", "bench", *elsewhere()[1]))
    candidates, sets, fresh = looked_up(matcher(world), seen(world, POSE, range(3)))
    assert is_found(candidates.triangles(sets, fresh).pose)


def test_only_groups_with_a_fresh_object_are_looked_up() -> None:
    candidates, sets, fresh = looked_up(matcher(WORLD), seen(WORLD, POSE, range(5)))
    fresh[:] = False
    assert len(candidates.triangles(sets, fresh).of) == 0
    fresh[0, 3] = True
    found = candidates.triangles(sets, fresh)
    assert is_found(found.pose)
    assert (found.landmarks[:, 3] != UNMATCHED).all()


def test_objects_too_close_to_tell_the_heading_are_no_start() -> None:
    world = landmark_map(
        np.concatenate([[[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]], elsewhere()[0]]),
        ("bench", "person", "hydrant", *elsewhere()[1]),
    )
    candidates, sets, fresh = looked_up(matcher(world), seen(world, POSE, range(3)))
    assert len(candidates.triangles(sets, fresh).of) == 0


def test_an_object_that_was_misread_is_looked_up_as_what_else_it_may_be() -> None:
    names = (PLACE_CLASSES[0], "hydrant", PLACE_CLASSES[2])
    scene = seen(WORLD, POSE, range(3), classes=names)
    options = (scene.hypotheses[0], (("hydrant", 0.8), ("person", 0.2)), scene.hypotheses[2])
    doubtful = SceneObjects(0, "base", scene.ids, options, scene.positions_xy, scene.covariances, scene.radii_m)
    candidates, sets, fresh = looked_up(matcher(WORLD), doubtful)
    assert is_found(candidates.triangles(sets, fresh).pose)


def test_several_bundles_at_once_are_kept_apart() -> None:
    by = matcher(WORLD)
    poses = [POSE, np.array([2.0, -5.0, 1.5]), np.array([5.0, 6.0, -2.5])]
    objects = [by.objects(seen(WORLD, pose, range(4))) for pose in poses]
    sets = by.sets(
        np.stack([one.points_xy for one in objects]),
        block_diagonal(np.stack([one.covariances for one in objects])),
        np.stack([one.probabilities for one in objects]),
        np.stack([one.spurious for one in objects]),
    )
    found = PoseCandidates(by.index, 0.03).triangles(sets, np.ones((3, 4), dtype=np.bool_))
    assert (np.diff(found.of) >= 0).all()
    for i, pose in enumerate(poses):
        assert is_found(found.pose[found.of == i], pose)
        assert not is_found(found.pose[found.of != i], pose)


def many(count: int, seed: int) -> tuple[LandmarkMap, SceneObjects]:
    """A map of one cluster of so many objects beside others, and all of the cluster seen from amid it."""
    rng = np.random.default_rng(seed)
    lattice = np.stack(np.meshgrid(np.arange(6), np.arange(6)), axis=-1).reshape(-1, 2)[:count] * 2.5
    points = lattice + rng.uniform(-0.7, 0.7, lattice.shape)
    names = tuple(("bench", "person", "hydrant")[i] for i in rng.integers(0, 3, count))
    world = landmark_map(np.concatenate([points, elsewhere()[0]]), names + elsewhere()[1])
    return world, seen(world, np.array([6.0, 6.0, 0.7]), range(count))


@pytest.mark.parametrize("count", [9, 16, 24])
def test_of_many_objects_those_of_a_sector_and_near_ones_tell_it(count: int) -> None:
    """Seven of them are right, the others moved: some triangle of right ones is still looked up."""
    world, scene = many(count, seed=count)
    rng = np.random.default_rng(count)
    wrong = rng.permutation(count)[7:]
    points = scene.positions_xy.copy()
    points[wrong] += rng.uniform(1.0, 3.0, (len(wrong), 2)) * rng.choice([-1, 1], (len(wrong), 2))
    moved = SceneObjects(0, "base", scene.ids, scene.hypotheses, points, scene.covariances, scene.radii_m)
    candidates, sets, fresh = looked_up(matcher(world), moved)
    assert is_found(candidates.triangles(sets, fresh).pose, np.array([6.0, 6.0, 0.7]))


def test_how_well_a_group_tells_the_heading() -> None:
    """The spread of its objects against their errors and the map's."""
    candidates, sets, _ = looked_up(matcher(WORLD), seen(WORLD, POSE, range(3)))
    points = PLACE_XY[:3] - PLACE_XY[:3].mean(axis=0)
    sigma = candidates._heading_sigma(sets, np.zeros(1, dtype=np.int64), np.array([[0, 1, 2]]))
    assert sigma[0] == pytest.approx(np.sqrt((0.03**2 + 0.03**2) / (points**2).sum()), rel=1e-9)


def test_sides_and_how_well_they_are_known() -> None:
    """Against drawn errors of objects and landmarks, which two sides share where they meet."""
    candidates, sets, _ = looked_up(matcher(WORLD), seen(WORLD, POSE, range(3)))
    of = np.zeros(1, dtype=np.int64)
    queries = candidates._classes(sets, of, np.array([[0, 1, 2]]))
    sides, spread = candidates._sides(sets, queries)
    rng = np.random.default_rng(0)
    drawn = PLACE_XY[:3] + np.hypot(0.03, 0.03) * rng.normal(size=(20_000, 3, 2))
    lengths = np.linalg.norm(np.roll(drawn, -1, axis=1) - drawn, axis=-1)
    np.testing.assert_allclose(sides[0], np.linalg.norm(np.roll(PLACE_XY[:3], -1, axis=0) - PLACE_XY[:3], axis=-1))
    np.testing.assert_allclose(spread[0], np.cov(lengths.T), atol=0.04 * spread[0].max())


def test_a_pair_that_fits_nearly_everywhere_is_not_looked_up() -> None:
    """A row of the same at every metre: a metre apart are 600 pairs, in both orders."""
    row = landmark_map(np.column_stack([np.arange(601.0), np.zeros(601)]), ("bench",) * 601)
    candidates, sets, fresh = looked_up(matcher(row), seen(row, np.array([3.0, -3.0, 1.0]), [5, 6]))
    assert len(candidates.pairs(sets, fresh).of) == 0


def test_poses_alike_are_tried_once() -> None:
    candidates, sets, fresh = looked_up(matcher(WORLD), seen(WORLD, POSE, range(5)))
    found = candidates.triangles(sets, fresh)
    near = np.abs(between(POSE, found.pose)) < [0.05, 0.05, 0.02]
    assert 1 <= near.all(axis=1).sum() <= 3  # ten triangles tell it; rounding may part them
