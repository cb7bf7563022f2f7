"""Matching without a pose: right places found, unknown ones refused, bad maps and bundles told."""

import dataclasses

import numpy as np
import pytest
from mcap_landmarks.errors import MapError
from mcap_landmarks.estimation.odometry import OdometryNoise
from mcap_landmarks.geometry.se2 import between
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.match import Match
from mcap_landmarks.localization.matching import Matcher
from mcap_landmarks.localization.sequence import SequenceLocalizer
from mcap_landmarks.maps.model import LandmarkMap, MapSource
from mcap_landmarks.messages.match import Status
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import OdometryAt

from tests.benchmark.worlds import Sensor, World, appendix_c, drive, error, pose_looking_at, random_world, scene
from tests.maps.examples import small_map


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
        observed = dataclasses.replace(observed, positions_xy=observed.positions_xy * scale)
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
    thousandfold = dataclasses.replace(world.landmark_map, positions_xy=1000 * world.positions_xy)
    with pytest.raises(MapError, match="not in metres"):
        stretch(dataclasses.replace(world, landmark_map=thousandfold), seed=12)


def test_maps_that_cannot_localize() -> None:
    nothing = dataclasses.replace(small_map(), tentative=np.ones(len(small_map()), dtype=bool), groups=())
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
