"""Several logs' landmarks as one numbered list."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.geometry import se2
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.data_association import UNLABELLED
from mcap_landmarks.mapping.merge_logs import merge_logs
from mcap_landmarks.mapping.submap import Submap

from tests.mapping.drives import Array

CONFIG = BuildMapConfig()
WORLD = np.array([[0.0, 0.0], [4.0, 1.0], [7.0, -2.0], [2.0, 6.0], [-3.0, 4.0], [9.0, 5.0], [12.0, 1.0], [14.0, 7.0]])
CLASSES = np.array([0, 1, 0, 1, 0, 1, 0, 0])
MOVE = np.array([4.0, -3.0, 2.0])


def submap(rows: list[int], move: Array = MOVE, seen: int = 5, shift: Array | None = None) -> Submap:
    """A log that saw some of the world's landmarks, each so often, from a frame at `move`."""
    positions = WORLD[rows] + (0 if shift is None else shift)
    landmark = np.concatenate([np.repeat(np.arange(len(rows)), seen), [UNLABELLED]])
    return Submap(landmark, CLASSES[rows], se2.transform_points(se2.inverse(move), positions), np.zeros((1, 3)))


def test_landmarks_seen_twice_have_one_number() -> None:
    merged = merge_logs([submap([0, 1, 2, 3], np.zeros(3)), submap([5, 3, 1, 2])], None, CONFIG)
    assert [numbers.tolist() for numbers in merged.of_log] == [[0, 1, 2, 3], [4, 3, 1, 2]]
    assert merged.class_ids.tolist() == [0, 1, 0, 1, 1]
    np.testing.assert_allclose(merged.positions_xy, WORLD[[0, 1, 2, 3, 5]], atol=1e-9)


def test_landmarks_that_are_known_come_first() -> None:
    known = CLASSES[:4], WORLD[:4]
    merged = merge_logs([submap([4, 2, 1, 3])], known, CONFIG)
    assert merged.of_log[0].tolist() == [4, 2, 1, 3]
    np.testing.assert_allclose(merged.positions_xy, WORLD[:5], atol=1e-9)
    assert merged.class_ids.tolist() == CLASSES[:5].tolist()


def test_the_log_with_most_landmarks_begins_and_then_comes_what_has_most_in_common() -> None:
    """The second has nothing in common with the first, but with the third."""
    merged = merge_logs(
        [submap([0, 1, 2, 3], np.zeros(3)), submap([5, 6, 7]), submap([2, 3, 1, 5, 6, 7])], None, CONFIG
    )
    assert merged.order == (2, 0, 1)
    assert [numbers.tolist() for numbers in merged.of_log] == [[6, 2, 0, 1], [3, 4, 5], [0, 1, 2, 3, 4, 5]]


def test_the_order_of_logs_decides_only_between_equals() -> None:
    logs = [submap([0, 1, 2, 3, 4]), submap([3, 2, 1, 5, 6, 7]), submap([2, 5, 6, 7]), submap([0, 1, 2])]
    merged = merge_logs(logs, None, CONFIG)
    for order in itertools.permutations(range(4)):
        again = merge_logs([logs[i] for i in order], None, CONFIG)
        assert [order[row] for row in again.order] == list(merged.order)
        for i, numbers in zip(order, again.of_log, strict=True):
            assert numbers.tolist() == merged.of_log[i].tolist()
        assert (again.positions_xy == merged.positions_xy).all()


def test_logs_that_cannot_be_laid_on_the_rest_are_left_out() -> None:
    alone = [submap([0, 1, 2, 3], np.zeros(3)), submap([4, 5, 6]), submap([1, 2, 3]), submap([7])]
    merged = merge_logs(alone, None, CONFIG)
    assert merged.order == (0, 2)
    assert (merged.of_log[1], merged.of_log[3]) == (None, None)
    assert dict(merged.reasons) == dict.fromkeys((1, 3), "too few landmarks in common")


def test_of_groups_that_have_nothing_in_common_the_one_of_most_logs_is_the_map() -> None:
    """Though a log of the other begins, which has more landmarks."""
    other = submap([0, 1, 2, 3, 4])
    far = [replace(other, class_ids=other.class_ids + 7), replace(submap([0, 1, 2]), class_ids=CLASSES[:3] + 7)]
    merged = merge_logs([far[0], submap([0, 1, 2, 3]), far[1], submap([1, 2, 3]), submap([3, 2, 1])], None, CONFIG)
    assert merged.order == (1, 3, 4)
    assert [i for i, numbers in enumerate(merged.of_log) if numbers is None] == [0, 2]


def test_what_is_spare_begins_nothing_and_does_not_count() -> None:
    logs = [submap([0, 1, 2]), submap([1, 2, 3, 4, 5, 6]), submap([7])]
    assert merge_logs(logs, None, CONFIG, spare=[1, 2]).order == (0,)
    assert merge_logs(logs, None, CONFIG, spare=[2]).order == (1,)


@pytest.mark.parametrize(("off_m", "same"), [(1.7, True), (1.9, False)])
def test_within_three_tolerances_it_is_the_same_landmark(off_m: float, same: bool) -> None:
    shift = np.zeros((5, 2))
    shift[4] = [off_m, 0.0]
    merged = merge_logs([submap([0, 1, 2, 3, 6], np.zeros(3)), submap([0, 1, 2, 3, 6], shift=shift)], None, CONFIG)
    assert merged.of_log[1].tolist() == ([0, 1, 2, 3, 4] if same else [0, 1, 2, 3, 5])
    closer = replace(CONFIG, join_tolerance_m=0.4)
    merged = merge_logs([submap([0, 1, 2, 3, 6], np.zeros(3)), submap([0, 1, 2, 3, 6], shift=shift)], None, closer)
    assert merged.of_log[1].tolist() == [0, 1, 2, 3, 5]


def test_each_landmark_has_one_partner_and_the_nearest_pairs_are_taken() -> None:
    """Two of a class near one of the map: the further is new, unless it has a partner further on."""
    rows = [0, 1, 2, 3]
    twins = submap([*rows, 2], shift=np.array([[0, 0]] * 4 + [[0.6, 0.0]]))
    merged = merge_logs([submap(rows, np.zeros(3)), twins], None, CONFIG)
    assert merged.of_log[1].tolist() == [0, 1, 2, 3, 4]
    both = submap([*rows, 2], np.zeros(3), shift=np.array([[0, 0]] * 4 + [[1.2, 0.0]]))
    merged = merge_logs([both, twins], None, CONFIG)
    assert merged.of_log[1].tolist() == [0, 1, 2, 3, 4]


def test_a_landmark_of_another_class_at_the_same_place_is_another() -> None:
    other = submap([0, 1, 2, 3, 4])
    renamed = replace(other, class_ids=np.array([0, 1, 0, 1, 1]))
    merged = merge_logs([submap([0, 1, 2, 3, 4], np.zeros(3)), renamed], None, CONFIG)
    assert merged.of_log[1].tolist() == [0, 1, 2, 3, 5]


def test_landmarks_seen_once_or_twice_do_not_say_where_a_log_lies() -> None:
    """Unless there are no others."""
    firm, passing = submap([1, 2, 3], seen=3), submap([4, 5], seen=2, shift=np.full((2, 2), 3.0))
    both = Submap(
        np.concatenate([firm.landmark, np.where(passing.landmark >= 0, passing.landmark + 3, UNLABELLED)]),
        np.concatenate([firm.class_ids, passing.class_ids]),
        np.concatenate([firm.positions_xy, passing.positions_xy]),
        firm.poses,
    )
    # The two that were seen in passing, off by as much, fit elsewhere together with a copy of them.
    first = submap([1, 2, 3, 4, 5], np.zeros(3))
    merged = merge_logs([first, both], None, CONFIG)
    assert merged.of_log[1].tolist() == [0, 1, 2, 5, 6]
    merged = merge_logs([first, submap([1, 2, 3], seen=2)], None, CONFIG)
    assert merged.of_log[1].tolist() == [0, 1, 2]
