"""The path for viewers: never far behind, whole at the end, and small in all however long the drive."""

from itertools import pairwise

import numpy as np
from mcap_landmarks.localization.drawn_path import DrawnPath
from mcap_landmarks.messages.poses import Path, PoseStamped


def drawn(count: int) -> list[tuple[int, Path]]:
    """Paths by the number of poses that there were."""
    path = DrawnPath()
    found = [(i + 1, path.add(PoseStamped.planar(i, "map", [i, 0.0, 0.5]))) for i in range(count)]
    return [(i, sent) for i, sent in [*found, (count, path.rest())] if sent is not None]


def test_what_is_drawn_is_never_a_tenth_behind() -> None:
    sent = drawn(1000)
    counts = [count for count, _ in sent]
    assert counts[:12] == [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 13]
    assert all(later - 1 <= 1.1 * count for count, later in pairwise(counts))
    assert counts[-1] == 1000
    assert all(len(path.poses) == count == path.stamp_ns + 1 for count, path in sent)
    assert sum(len(path.poses) for _, path in sent) <= 12 * 1000


def test_long_paths_are_thinned_and_keep_their_ends() -> None:
    sent = drawn(20_000)
    assert max(len(path.poses) for _, path in sent) <= 2001
    last = [pose.stamp_ns for pose in sent[-1][1].poses]
    assert (last[0], last[-1]) == (0, 19_999)
    assert set(np.diff(last[:-1]).tolist()) == {16}
    assert sum(len(path.poses) for _, path in sent) < 80_000


def test_a_pose_without_heading_can_be_drawn() -> None:
    bare = DrawnPath().add(PoseStamped(3, "map", np.array([1.0, 2, 0]), np.zeros(4)))
    assert bare is not None
    assert bare.poses[0].orientation_xyzw.tolist() == [0, 0, 0, 1]
    assert bare.frame_id == "map"


def test_nothing_localized_is_no_path() -> None:
    assert DrawnPath().rest() is None
