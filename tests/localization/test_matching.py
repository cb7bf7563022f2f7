"""Matching without a pose: right places found, unknown ones refused, bad maps and bundles told."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.errors import MapError
from mcap_landmarks.estimation.odometry import OdometryNoise
from mcap_landmarks.geometry.se2 import between
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.match import Match
from mcap_landmarks.localization.matching import Matcher, block_diagonal, is_same_place
from mcap_landmarks.localization.sequence import SequenceLocalizer
from mcap_landmarks.maps.model import LandmarkMap, MapSource
from mcap_landmarks.messages.match import Status
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import OdometryAt

from tests.benchmark.worlds import Sensor, World, appendix_c, drive, error, pose_looking_at, random_world, scene
from tests.localization.small_worlds import SIGMA_M, matcher, one_place, seen, two_places
from tests.maps.examples import small_map

WORLD = one_place()
POSE = np.array([-4.0, 1.0, 0.1])


def matcher_of(world: World) -> Matcher:
    return Matcher(MapIndex.build(world.landmark_map), LocalizeConfig())


def views(world: World, count: int, seed: int) -> list[tuple[SceneObjects, np.ndarray]]:
    """Scenes of one group each, from any side."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        members = np.flatnonzero(world.group_of == rng.integers(0, world.group_of.max() + 1))
        pose = pose_looking_at(rng, world.positions_xy[members].mean(axis=0), 5.7, 14.8)
        found.append((scene(rng, world, pose, Sensor(), members)[0], pose))
    return found


def test_appendix_c_from_any_side() -> None:
    world = appendix_c(np.random.default_rng(0))
    seen = views(world, 200, seed=1)
    found = matcher_of(world).match([observed for observed, _ in seen])
    right = wrong = 0
    for match, (_, pose) in zip(found, seen, strict=True):
        if match.pose is not None:
            far, turned = error(match.pose, pose)
            right += far < 0.5 and turned < 5
            wrong += far > 1 or turned > 20
    assert wrong == 0
    assert right > 0.99 * len(seen)


def test_unknown_places_are_refused() -> None:
    here = random_world(np.random.default_rng(2), 50)
    elsewhere = random_world(np.random.default_rng(3), 50)
    found = matcher_of(here).match([observed for observed, _ in views(elsewhere, 200, seed=4)])
    assert {match.message.status for match in found} == {Status.NO_MATCH}
    assert all(match.message.expected_accidental > LocalizeConfig().accidental for match in found)


def stretch(world: World, seed: int, scale: float = 1.0) -> tuple[list[Match], list[np.ndarray]]:
    """A drive of 20 m past groups that many others look like, as one sequence."""
    rng = np.random.default_rng(seed)
    start = pose_looking_at(rng, world.positions_xy[len(world.positions_xy) // 2], 6, 10)
    truth, odometry = drive(rng, start, 20.0, 1.0)
    sequence = SequenceLocalizer(matcher_of(world), OdometryNoise(), 30.0)
    found, way, turned = [], 0.0, 0.0
    for i, (pose, at) in enumerate(zip(truth, odometry, strict=True)):
        if i:
            step = between(odometry[i - 1], at)
            way, turned = way + float(np.hypot(step[0], step[1])), turned + abs(float(step[2]))
        observed = scene(rng, world, pose, Sensor())[0]
        observed = replace(observed, positions_xy=observed.positions_xy * scale)
        found.append(sequence.localize(observed, OdometryAt("odom", at, np.zeros((3, 3)), way, turned)))
    return found, truth


@pytest.mark.slow
def test_a_sequence_finds_the_place_among_many() -> None:
    world = random_world(np.random.default_rng(5), 400)
    found_at_the_end = 0
    for seed in range(6):
        found, truth = stretch(world, seed)
        for match, pose in zip(found, truth, strict=True):
            if match.pose is not None:
                far, turned = error(match.pose, pose)
                assert far < 1
                assert turned < 20
        found_at_the_end += found[-1].message.status == Status.LOCALIZED
        assert found[-1].message.bundles_joined > 1
    assert found_at_the_end >= 4


def test_without_odometry_each_bundle_stands_alone() -> None:
    world = appendix_c(np.random.default_rng(6))
    matcher = matcher_of(world)
    sequence = SequenceLocalizer(matcher, OdometryNoise(), 30.0)
    for observed, _ in views(world, 20, seed=7):
        alone, in_sequence = matcher.match([observed])[0], sequence.localize(observed, None)
        assert in_sequence.message.status == alone.message.status
        assert in_sequence.message.landmark_ids == alone.message.landmark_ids


def test_a_bundle_of_one_object_or_none() -> None:
    world = appendix_c(np.random.default_rng(8))
    observed, _ = views(world, 1, seed=9)[0]
    for keep in (0, 1):
        cut = SceneObjects(
            1,
            "base",
            observed.ids[:keep],
            observed.hypotheses[:keep],
            observed.positions_xy[:keep],
            observed.covariances[:keep],
            observed.radii_m[:keep],
        )
        assert matcher_of(world).match([cut])[0].message.status == Status.TOO_FEW_OBJECTS


def test_wrong_units_get_a_hint() -> None:
    world = appendix_c(np.random.default_rng(10))
    with pytest.raises(MapError, match="not in metres"):
        stretch(world, seed=11, scale=1000.0)
    thousandfold = replace(world.landmark_map, positions_xy=1000 * world.positions_xy)
    with pytest.raises(MapError, match="not in metres"):
        stretch(replace(world, landmark_map=thousandfold), seed=12)


def test_maps_that_cannot_localize() -> None:
    nothing = replace(small_map(), tentative=np.ones(len(small_map()), dtype=bool), groups=())
    with pytest.raises(MapError, match="no confirmed landmarks"):
        MapIndex.build(nothing)
    point = LandmarkMap.surveyed(("a", "b"), ("x", "x"), [[1.0, 2.0], [1.0, 2.0]], MapSource("import", "test"))
    with pytest.raises(MapError, match="lie in one place"):
        MapIndex.build(point)


@pytest.mark.parametrize("third", [(5.0, 0.0), (5.0, 4.0)], ids=["seen twice", "in line"])
def test_objects_in_one_place_or_exactly_in_line(third: tuple[float, float]) -> None:
    points = np.array([[5.0, 0.0], [5.0, 1.0], third])
    options = ((("class 0", 1.0),),) * 3
    spread = np.tile(0.02**2 * np.eye(2), (3, 1, 1))
    seen = SceneObjects(0, "base", ("a", "b", "c"), options, points, spread, np.zeros(3))
    found = matcher_of(appendix_c(np.random.default_rng(13))).match([seen])[0]
    assert found.message.status is Status.NO_MATCH


def test_a_single_bundle_of_one_of_two_identical_places_is_ambiguous() -> None:
    """However many objects agree with one place: they agree with the other one as well."""
    world = two_places()
    for count in (3, 4, 5):
        match = matcher(world).match([seen(world, POSE, range(count))])[0]
        assert match.message.status is Status.AMBIGUOUS
        assert match.pose is None
        assert match.message.expected_accidental == pytest.approx(1.0, abs=1e-3)
        assert match.message.candidate_scores == pytest.approx([0.5, 0.5], abs=1e-3)
        first, second = ("+".join(f"l{i + start}" for i in range(count)) for start in (0, 5))
        assert set(match.message.candidate_ids) == {first, second}


def test_a_single_bundle_of_a_place_that_is_there_once_is_localized() -> None:
    world = one_place()
    match = matcher(world).match([seen(world, POSE, range(5))])[0]
    assert match.message.status is Status.LOCALIZED
    assert match.pose == pytest.approx(POSE, abs=1e-9)
    assert match.message.landmark_ids == ("l0", "l1", "l2", "l3", "l4")
    assert match.message.residual_m == pytest.approx(np.zeros(5), abs=1e-9)


def test_a_lucky_fit_is_no_surer_than_an_average_one() -> None:
    """Without any error the match is as likely an accident as with the errors that are to be expected."""
    world, rng = one_place(), np.random.default_rng(0)
    noise = rng.normal(size=(5, 2))
    found = matcher(world).match([seen(world, POSE, range(5), s * SIGMA_M * noise) for s in (0.0, 0.5, 1.5)])
    lucky, better, average = (match.message for match in found)
    assert lucky.chi2 < 1e-9 < better.chi2 < average.chi2 < average.dof
    assert lucky.expected_accidental == pytest.approx(average.expected_accidental, rel=0.1)
    assert lucky.expected_accidental == pytest.approx(better.expected_accidental, rel=0.1)


def test_objects_of_classes_that_the_map_lacks_are_left_out() -> None:
    scene = seen(WORLD, POSE, range(4), classes=("bench", "cat", "person", "dog"))
    options = (*scene.hypotheses[:3], (("dog", 0.9), ("bench", 0.1)))
    objects = matcher(WORLD).objects(replace(scene, hypotheses=options))
    np.testing.assert_array_equal(objects.rows, [0, 2, 3])
    np.testing.assert_array_equal(objects.points_xy, scene.positions_xy[[0, 2, 3]])
    assert objects.probabilities.shape == (3, 3)


def test_of_many_objects_the_nearest_are_matched() -> None:
    count = 30
    angle = np.arange(count) * 2.4
    points = np.column_stack([np.cos(angle), np.sin(angle)]) * np.linspace(40, 2, count)[:, None]
    names = ((("bench", 1.0),),) * count
    spread = np.tile(SIGMA_M**2 * np.eye(2), (count, 1, 1))
    scene = SceneObjects(0, "base", tuple(map(str, range(count))), names, points, spread, np.zeros(count))
    np.testing.assert_array_equal(matcher(WORLD).objects(scene).rows, np.arange(6, 30))


def test_settings_stand_in_for_what_is_unknown() -> None:
    config = LocalizeConfig(range_sigma_m=0.2, bearing_sigma_rad=0.1, spurious=0.3, misread=0.06, map_sigma_m=0.5)
    by = matcher(WORLD, config)
    unknown = replace(seen(WORLD, np.array([-2.0, 0.0, 0.0]), [0]), covariances=np.zeros((1, 2, 2)))
    objects = by.objects(unknown)
    np.testing.assert_allclose(objects.covariances[0], np.diag([0.2**2, (2.0 * 0.1) ** 2]), atol=1e-12)
    np.testing.assert_allclose(objects.spurious, 0.3)
    assert objects.probabilities[0].min() == pytest.approx(0.06 / 3)
    np.testing.assert_allclose(by.verifier.spread[0], 0.25 * np.eye(2))


@pytest.mark.parametrize(
    ("apart", "same"),
    [((0.49, 0, 0), True), ((0.4, 0.4, 0), False), ((0, 0, 0.16), True), ((0, 0, -0.18), False), ((0.51, 0, 0), False)],
)
def test_poses_half_a_metre_or_ten_degrees_apart_are_two_places(apart: tuple[float, ...], same: bool) -> None:
    others = np.array([POSE, POSE + np.array(apart)])
    np.testing.assert_array_equal(is_same_place(POSE, others), [True, same])


def test_independent_points_have_a_block_diagonal_covariance() -> None:
    blocks = np.arange(8.0).reshape(1, 2, 2, 2)
    expected = [[0, 1, 0, 0], [2, 3, 0, 0], [0, 0, 4, 5], [0, 0, 6, 7]]
    np.testing.assert_array_equal(block_diagonal(blocks), [expected])


def test_bundles_of_all_sizes_are_matched_each_by_itself() -> None:
    by = matcher(WORLD)
    scenes = [seen(WORLD, POSE, range(count)) for count in (5, 0, 3, 5, 1, 4)]
    together = by.match(scenes)
    for match, one in zip(together, scenes, strict=True):
        alone = by.match([one])[0].message
        assert (match.message.status, match.message.landmark_ids) == (alone.status, alone.landmark_ids)
        assert match.message.expected_accidental == pytest.approx(alone.expected_accidental, rel=1e-9)
