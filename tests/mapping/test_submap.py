"""One log's observations to landmarks: evidence picks the scale of odometry's noise, slack keeps landmarks whole."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.estimation.odometry import OdometryNoise
from mcap_landmarks.mapping import submap
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.data_association import UNLABELLED
from mcap_landmarks.mapping.observations import LogObservations
from mcap_landmarks.mapping.submap import Submap, build_submap, motions_of

from tests.mapping.drives import Drive, as_observed, drive, landmarks_beside

CONFIG = BuildMapConfig()


def loop(laps: float, odometry: OdometryNoise, seed: int = 1, step_m: float = 0.5) -> tuple[Drive, LogObservations]:
    given = drive(landmarks_beside(6.0, 8, seed), 6.0, seed, laps=laps, step_m=step_m, odometry=odometry)
    return given, as_observed(given, ("a",) * 8)


def built(log: LogObservations, config: BuildMapConfig = CONFIG) -> Submap:
    return build_submap(log, np.zeros(len(log.bundle), dtype=np.int64), config)


def test_motions_are_the_steps_of_odometry_with_the_way_and_the_turning_between() -> None:
    given, log = loop(0.2, OdometryNoise())
    motions = motions_of(log)
    np.testing.assert_allclose(motions.relative, given.log.motions.relative, atol=1e-9)
    np.testing.assert_allclose(motions.distance_m, 0.5)
    np.testing.assert_allclose(motions.turn_rad, 0.5 / 6)


def test_landmarks_are_where_most_of_their_observations_lie() -> None:
    given, log = loop(0.3, OdometryNoise(0.001, 0.001, 0.001))
    made = built(log)
    numbers = sorted(set(given.log.landmark.tolist()))
    assert (made.landmark != UNLABELLED).all()
    assert len(made.positions_xy) == len(made.class_ids) == len(numbers)
    start = given.poses[0]
    c, s = np.cos(start[2]), np.sin(start[2])
    local = (given.landmarks_xy - start[:2]) @ np.array([[c, -s], [s, c]])
    for number in numbers:
        label = made.landmark[given.log.landmark == number]
        assert len(set(label.tolist())) == 1
        np.testing.assert_allclose(made.positions_xy[label[0]], local[number], atol=0.2)
    assert made.poses.shape == log.odom_from_base.shape


def labels_of(made: Submap, given: Drive) -> set[tuple[int, int]]:
    """Pairs of label and true landmark."""
    known = made.landmark != UNLABELLED
    return set(zip(made.landmark[known].tolist(), given.log.landmark[known].tolist(), strict=True))


def test_evidence_picks_the_scale_of_odometrys_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """Odometry is four times worse than assumed: taken as assumed, a second lap finds new landmarks."""
    given, log = loop(1.4, OdometryNoise(0.04, 0.04, 0.08), seed=4)
    config = replace(CONFIG, odometry_position_m=0.01, odometry_heading_rad=0.01, odometry_turning_rad=0.02)
    assert len(labels_of(built(log, config), given)) == 8
    asked = []

    def heard(*arguments: object) -> object:
        labels = label(*arguments)
        asked.append((arguments[1][0, 2, 2], labels.log_evidence))
        return labels

    label = submap.label_observations
    monkeypatch.setattr(submap, "label_observations", heard)
    best = built(log, config)
    variances = [variance / asked[2][0] for variance, _ in asked]
    np.testing.assert_allclose(variances, [1 / 16, 1 / 4, 1, 4, 16], rtol=1e-4)
    assert max(asked, key=lambda one: one[1])[0] == asked[4][0]
    monkeypatch.setattr(submap, "_SCALES", (4.0,))
    np.testing.assert_array_equal(best.poses, built(log, config).poses)
    monkeypatch.setattr(submap, "_SCALES", (0.25,))
    assert len(labels_of(built(log, config), given)) > 8


def test_slack_keeps_gates_wide_for_sensors_that_err_more_than_they_say() -> None:
    given, log = loop(0.6, OdometryNoise(0.02, 0.009, 0.02), seed=2)
    boasting = replace(log, covariances=log.covariances / 9)
    assert len(labels_of(built(boasting, replace(CONFIG, slack=3.0)), given)) == len(set(given.log.landmark.tolist()))
    strict = built(boasting, replace(CONFIG, slack=0.5))
    assert len(labels_of(strict, given)) > 8 or (strict.landmark == UNLABELLED).mean() > 0.2


def test_what_lies_off_first_loses_its_label_and_then_has_one_of_its_own() -> None:
    given, log = loop(0.3, OdometryNoise(0.001, 0.001, 0.001))
    most = int(np.bincount(given.log.landmark).argmax())
    last = int(np.flatnonzero(given.log.landmark == most)[-1])
    count, found = len(set(given.log.landmark.tolist())), []
    for off_m in (0.0, 0.2, 0.35, 1.0):
        points = log.points_xy.copy()
        points[last] += [off_m, 0.0]
        made = built(replace(log, points_xy=points))
        assert sorted(set(made.landmark.tolist()) - {UNLABELLED}) == list(range(len(made.positions_xy)))
        found.append((int(made.landmark[last]), len(made.positions_xy)))
    label = found[0][0]
    assert found == [(label, count), (label, count), (UNLABELLED, count), (count, count + 1)]


def test_classes_are_kept_apart() -> None:
    given, log = loop(0.3, OdometryNoise(0.001, 0.001, 0.001))
    ids = np.arange(len(log.bundle)) % 2
    made = build_submap(log, ids, CONFIG)
    np.testing.assert_array_equal(made.class_ids[made.landmark], ids)
    assert len(made.class_ids) > len(set(given.log.landmark.tolist()))
