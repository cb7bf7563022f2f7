"""Where one map lies in another: found by pairs of landmarks, refused where nothing or several ways fit."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.geometry import se2
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.map_alignment import align_maps

from tests.mapping.drives import Array

CONFIG = BuildMapConfig()
MOVE = np.array([4.0, -3.0, 2.0])
MAP = np.array([[0.0, 0.0], [4.0, 1.0], [7.0, -2.0], [2.0, 6.0], [-3.0, 4.0], [9.0, 5.0]])
CLASSES = np.array([0, 1, 0, 1, 0, 1])


def aligned(map_xy: Array, map_ids: np.ndarray, rows: list[int], config: BuildMapConfig = CONFIG) -> Array | None:
    """Where a log that saw some of the map's landmarks lies in it."""
    seen = se2.transform_points(se2.inverse(MOVE), map_xy[rows])
    return align_maps(map_ids[rows], seen, map_ids, map_xy, config).pose


def found(pose: Array | None) -> bool:
    """Whether it lies there; two landmarks off by decimetres turn it a bit."""
    return pose is not None and bool(np.abs(se2.between(MOVE, pose)).max() < 0.1)


def test_three_landmarks_say_where_a_log_lies() -> None:
    pose = aligned(MAP, CLASSES, [1, 2, 3])
    assert pose is not None
    np.testing.assert_allclose(se2.between(MOVE, pose), 0, atol=1e-9)


def test_most_landmarks_win_over_those_that_are_not_there() -> None:
    crowd = np.concatenate([MAP, [[30.0, 30.0], [33.0, 31.0]]])
    ids = np.concatenate([CLASSES, [1, 0]])
    seen = se2.transform_points(se2.inverse(MOVE), crowd[:6])
    seen[0] += 3.0
    assert found(align_maps(ids[:6], seen, ids, crowd, CONFIG).pose)


def test_two_landmarks_do_where_all_classes_differ_and_not_where_they_repeat() -> None:
    ids = np.arange(6)
    assert found(aligned(MAP, ids, [1, 4]))
    assert aligned(MAP, CLASSES, [1, 4]) is None
    assert aligned(MAP, ids, [1]) is None


@pytest.mark.parametrize("classes", [np.full(6, 7), np.array([1, 0, 1, 0, 1, 0])])
def test_landmarks_of_other_classes_are_no_partners(classes: np.ndarray) -> None:
    seen = se2.transform_points(se2.inverse(MOVE), MAP)
    assert align_maps(classes, seen, CLASSES, MAP, CONFIG).pose is None


def test_a_place_that_looks_alike_two_ways_is_refused() -> None:
    square = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    assert aligned(square, np.zeros(4, dtype=np.int64), [0, 1, 2, 3]) is None
    assert found(aligned(square, np.array([0, 0, 0, 1]), [0, 1, 2, 3]))


@pytest.mark.parametrize("by", [np.array([40.0, 0.0, 0.0]), np.array([0.0, 0.0, 2.5])], ids=["elsewhere", "turned"])
def test_a_copy_of_the_place_is_refused(by: Array) -> None:
    """Elsewhere, or turned about the log's own origin, so that only the heading differs."""
    about = se2.compose(se2.compose(MOVE, by), se2.inverse(MOVE))
    twice = np.concatenate([MAP, se2.transform_points(about, MAP)])
    assert aligned(twice, np.tile(CLASSES, 2), [0, 1, 2, 3, 4, 5]) is None


def test_a_bit_off_is_not_another_place() -> None:
    """Poses of the right pairs differ by less than four tolerances and half a radian."""
    rng = np.random.default_rng(0)
    seen = se2.transform_points(se2.inverse(MOVE), MAP) + rng.normal(0, 0.1, MAP.shape)
    assert found(align_maps(CLASSES, seen, CLASSES, MAP, CONFIG).pose)


@pytest.mark.parametrize(("off_m", "fits"), [(0.5, True), (0.7, False)])
def test_a_partner_is_within_the_tolerance(off_m: float, fits: bool) -> None:
    """Three of one class, of which the third is off; it is too far to make pairs itself."""
    row = np.array([[0.0, 0.0], [1.5, 0.0], [0.0, 21.0]])
    seen = np.add(row, [[0, 0], [0, 0], [off_m, 0]])
    pose = align_maps(np.array([0, 1, 2]), seen, np.array([0, 1, 2]), row, CONFIG).pose
    assert pose is not None
    three = np.array([0, 1, 1])
    assert (align_maps(three, seen, three, row, CONFIG).pose is not None) is fits
    wider = replace(CONFIG, join_tolerance_m=0.8)
    assert align_maps(three, seen, three, row, wider).pose is not None


def test_pairs_up_to_the_reach_say_how_maps_lie() -> None:
    far = 3.0 * MAP  # from 12 m apart on
    assert found(aligned(far, CLASSES, [0, 1, 2]))
    assert aligned(far, CLASSES, [0, 1, 2], replace(CONFIG, join_reach_m=10.0)) is None


def test_pairs_that_stand_together_say_nothing_of_the_direction() -> None:
    close = 0.06 * MAP  # the first three within half a metre, the others up to 0.7 m apart
    assert aligned(close, np.arange(6), [0, 1, 2]) is None
    assert found(aligned(close, np.arange(6), [2, 4, 5]))


def test_lengths_that_differ_by_half_a_metre_are_not_alike() -> None:
    stretched = np.array([[0.0, 0.0], [8.0, 0.0]])
    for length, fits in ((8.45, True), (8.55, False)):
        seen = np.array([[0.0, 0.0], [length, 0.0]])
        pose = align_maps(np.arange(2), seen, np.arange(2), stretched, CONFIG).pose
        assert (pose is not None) is fits
        if pose is not None:  # middle on middle
            np.testing.assert_allclose(pose, [4 - length / 2, 0, 0], atol=1e-12)


def test_in_a_crowd_so_many_pairs_are_tried_as_are_needed() -> None:
    rng = np.random.default_rng(0)
    crowd, ids = rng.uniform(-30, 30, (60, 2)), rng.integers(0, 2, 60)
    assert found(aligned(crowd, ids, list(range(60))))


def test_nothing_seen_lies_nowhere() -> None:
    none, no_ids = np.zeros((0, 2)), np.zeros(0, dtype=np.int64)
    assert align_maps(no_ids, none, CLASSES, MAP, CONFIG).pose is None
    assert align_maps(CLASSES, MAP, no_ids, none, CONFIG).pose is None


def test_three_of_many_landmarks_that_fit_by_chance_do_not_say_where_a_log_lies() -> None:
    """The others stand where the map has none of their class, beside some that it has."""
    seen = np.add(MAP, [[0, 0]] * 3 + [[1.8, 0]] * 3)
    assert align_maps(CLASSES[:4], seen[:4], CLASSES, MAP, CONFIG).pose is not None
    refused = align_maps(CLASSES, seen, CLASSES, MAP, CONFIG)
    assert refused.pose is None
    assert refused.reason == "where it fits best, most of its landmarks stand beside others"


def test_the_reason_for_no_pose_is_told() -> None:
    assert align_maps(CLASSES[[1, 4]], MAP[[1, 4]], CLASSES, MAP, CONFIG).reason == "too few landmarks in common"
    square = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    alike = np.zeros(4, dtype=np.int64)
    assert align_maps(alike, square, alike, square, CONFIG).reason == "it fits in several ways"
