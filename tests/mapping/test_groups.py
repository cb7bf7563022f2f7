"""Groups of three landmarks as the thesis has them, from what was seen along the way."""

import numpy as np
from mcap_landmarks.mapping.groups import groups_of
from mcap_landmarks.mapping.observations import LogObservations

from tests.mapping.drives import Array


def log_of(bundles: list[list[tuple[float, float]]]) -> LogObservations:
    """A robot that stands still; each bundle has objects at these points."""
    count = len(bundles)
    points = np.array([point for bundle in bundles for point in bundle])
    n = len(points)
    return LogObservations(
        np.arange(count),
        np.arange(count),
        np.zeros((count, 3)),
        np.zeros(count),
        np.zeros(count),
        np.repeat(np.arange(count), [len(bundle) for bundle in bundles]),
        ("a",) * n,
        points,
        np.tile(np.eye(2), (n, 1, 1)),
        np.zeros(n),
        count,
    )


NAMES = {number: f"l{number}" for number in range(9)}
FOUR = [(5.0, 1.0), (4.0, 0.0), (3.0, -1.0), (9.0, 2.0)]


def grouped(
    log: LogObservations, numbers: list[int], poses: Array, names: dict[int, str] = NAMES
) -> list[tuple[object, ...]]:
    groups = groups_of([log], [np.array(numbers)], [poses], names)
    return [(group.landmark_ids, *group.map_from_base.tolist()) for group in groups]


def test_the_three_nearest_of_a_bundle_from_left_to_right_with_its_pose() -> None:
    poses = np.array([[1.0, 2.0, 0.5]])
    assert grouped(log_of([FOUR]), [7, 3, 5, 1], poses) == [(("l7", "l3", "l5"), 1.0, 2.0, 0.5)]


def test_a_set_of_landmarks_is_kept_once_with_the_pose_that_saw_it_first() -> None:
    poses = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    mirrored = [(x, -y) for x, y in FOUR[:3]]
    log = log_of([FOUR[:3], mirrored, FOUR[1:]])
    found = grouped(log, [0, 1, 2, 0, 1, 2, 1, 2, 3], poses)
    assert found == [(("l0", "l1", "l2"), 1.0, 0.0, 0.0), (("l3", "l1", "l2"), 3.0, 0.0, 0.0)]


def test_only_landmarks_that_count_make_groups() -> None:
    poses = np.zeros((1, 3))
    confirmed = {0: "l0", 1: "l1", 3: "l3"}
    assert grouped(log_of([FOUR]), [0, 1, 2, 3], poses, confirmed) == [(("l3", "l0", "l1"), 0.0, 0.0, 0.0)]
    assert grouped(log_of([FOUR[:3]]), [0, 1, -1], poses) == []
    assert grouped(log_of([FOUR[:3]]), [0, 1, 1], poses) == []
