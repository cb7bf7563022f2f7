"""Maps of small worlds whose classes repeat, from odometry that drifts."""

import dataclasses
from collections.abc import Iterable

import numpy as np
import pytest
from mcap_landmarks.channels import SCENE_OBJECTS
from mcap_landmarks.errors import MapError
from mcap_landmarks.evaluation.alignment import fit
from mcap_landmarks.geometry.se2 import Array, compose, transform_points
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.observations import LogObservations
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import Bundle
from mcap_landmarks.stages.build_map import collect, solve

from tests.stages.worlds import circle, drive, ring

CONFIG = BuildMapConfig()


def observe(bundles: Iterable[Bundle], config: BuildMapConfig) -> LogObservations:
    return dataclasses.replace(collect(bundles, config), fingerprint="test")


def aligned_rmse(landmark_map: LandmarkMap, classes: tuple[str, ...], positions: Array) -> float:
    """RMSE of confirmed landmarks after one fit, each paired with the nearest of its class."""
    keep = np.flatnonzero(~landmark_map.tentative)
    estimate = landmark_map.positions_xy[keep]
    names = [landmark_map.classes[i] for i in keep]
    best = np.inf
    for i in range(len(positions)):  # the pairing is unknown: start it from each landmark in turn
        for j in range(len(positions)):
            if i == j or classes[i] != names[0] or classes[j] != names[1]:
                continue
            start = fit(estimate[:2], positions[[i, j]])
            moved = transform_points(start, estimate)
            distance = np.linalg.norm(moved[:, None] - positions, axis=2)
            distance[np.array(names)[:, None] != np.array(classes)] = np.inf
            nearest = distance.argmin(axis=1)
            if len(set(nearest)) < len(nearest):
                continue
            final = fit(estimate, positions[nearest])
            miss = np.linalg.norm(transform_points(final, estimate) - positions[nearest], axis=1)
            best = min(best, float(np.sqrt((miss**2).mean())))
    return best


@pytest.mark.slow
def test_a_loop_with_repeated_classes_closes() -> None:
    classes, positions = ring()
    log = observe(drive(circle(), classes, positions, seed=1), CONFIG)
    landmark_map, trajectories, *_ = solve([log], None, CONFIG)
    assert sorted(np.array(landmark_map.classes)[~landmark_map.tentative]) == sorted(classes)
    assert aligned_rmse(landmark_map, classes, positions) < 0.03
    truth = circle()
    estimate = trajectories[0].map_from_base
    moved = compose(truth[0], estimate)
    assert np.linalg.norm(moved[:, :2] - truth[:, :2], axis=1).max() < 0.15
    np.testing.assert_allclose(landmark_map.radii_m[~landmark_map.tentative], 0.2, atol=1e-9)
    assert landmark_map.sources[0].bundles == len(truth)
    assert all(len(group.landmark_ids) == 3 for group in landmark_map.groups)


@pytest.mark.slow
def test_two_logs_make_one_map() -> None:
    classes, positions = ring()
    logs = [
        observe(drive(circle(0.7), classes, positions, seed=2), CONFIG),
        observe(drive(circle(-0.7), classes, positions, seed=3), CONFIG),
    ]
    landmark_map, *_ = solve(logs, None, CONFIG)
    assert sorted(np.array(landmark_map.classes)[~landmark_map.tentative]) == sorted(classes)
    assert aligned_rmse(landmark_map, classes, positions) < 0.05
    assert [source.bundles for source in landmark_map.sources] == [240, 240]


@pytest.mark.slow
def test_a_prior_keeps_its_frame_and_ids() -> None:
    classes, positions = ring()
    first, *_ = solve([observe(drive(circle(0.6), classes, positions, seed=4), CONFIG)], None, CONFIG)
    log = observe(drive(circle(1.0), classes, positions, seed=5), CONFIG)
    second, *_ = solve([log], first, CONFIG)
    assert second.ids[: len(first)] == first.ids
    assert np.linalg.norm(second.positions_xy[: len(first)] - first.positions_xy, axis=1).max() < 0.1
    assert (~second.tentative).sum() == len(classes)
    assert second.sightings[: len(first)].sum() > first.sightings.sum()


@pytest.mark.slow
def test_the_same_log_gives_the_same_map() -> None:
    classes, positions = ring()
    maps = [solve([observe(drive(circle(), classes, positions, seed=6), CONFIG)], None, CONFIG)[0] for _ in range(2)]
    np.testing.assert_array_equal(maps[0].positions_xy, maps[1].positions_xy)
    assert maps[0].ids == maps[1].ids


@pytest.mark.slow
def test_a_misread_class_is_tentative() -> None:
    classes, positions = ring()
    rng = np.random.default_rng(8)

    def misread(bundle: Bundle) -> Bundle:
        seen = bundle.get(SCENE_OBJECTS)
        assert seen is not None
        names = tuple((("trolley", 0.9),) if rng.random() < 0.02 else name for name in seen.hypotheses)
        changed: SceneObjects = dataclasses.replace(seen, hypotheses=names)
        return dataclasses.replace(bundle, messages={SCENE_OBJECTS: changed})

    log = observe(map(misread, drive(circle(), classes, positions, seed=9)), CONFIG)
    assert "trolley" in log.classes
    landmark_map, *_ = solve([log], None, CONFIG)
    confirmed = np.array(landmark_map.classes)[~landmark_map.tentative]
    assert sorted(confirmed) == sorted(classes)


@pytest.mark.slow
def test_logs_of_different_places_do_not_join() -> None:
    classes, positions = ring()
    rng = np.random.default_rng(10)
    elsewhere = tuple(rng.permutation(classes)), positions * [1.0, -1.0] * rng.uniform(0.6, 1.4, (len(positions), 1))
    logs = [
        observe(drive(circle(0.5), classes, positions, seed=11), CONFIG),
        observe(drive(circle(0.2), ("pole",) * len(classes), elsewhere[1], seed=12), CONFIG),
    ]
    with pytest.raises(MapError, match="log 2 cannot be laid on the rest"):
        solve(logs, None, CONFIG)


def test_nothing_to_map_is_an_error() -> None:
    log = observe(drive(circle(), ("a",), np.array([[500.0, 500.0]]), seed=13), CONFIG)
    with pytest.raises(MapError, match="no bundle holds an object"):
        solve([log], None, CONFIG)


def test_the_thesis_method_keeps_ordered_triples() -> None:
    config = BuildMapConfig(method="thesis")
    classes, positions = ring()
    log = observe(drive(circle(), classes, positions, seed=14), config)
    landmark_map, *_ = solve([log], None, config)
    triples = [
        tuple(landmark_map.classes[landmark_map.ids.index(name)] for name in g.landmark_ids)
        for g in landmark_map.groups
    ]
    assert len(set(triples)) == len(triples)
    assert len(landmark_map) == 3 * len(triples)
