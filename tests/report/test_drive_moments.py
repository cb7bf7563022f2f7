"""Moments of a drive come in real time by the stamps, whatever clocks the log has."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from mcap_landmarks.channels import POSE
from mcap_landmarks.geometry.frames import FrameTree
from mcap_landmarks.messages.codec import encode
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.report.drive_moments import Moment, moments
from mcap_landmarks.stage import Connection, RawMessage

SECOND = 10**9
CONNECTION = Connection(POSE.topic, PoseStamped.ROS_TYPE, b"")


def shown(times: list[tuple[float, float]], fps: int = 2) -> list[Moment]:
    """The moments of poses with some stamps and log times in seconds; x is the number of each."""
    raws = [
        RawMessage(
            CONNECTION, log := round(logged * SECOND), log, 0,
            encode(PoseStamped.planar(round(stamp * SECOND), "map", np.array([i, 0.0, 0.0]))),
        )
        for i, (stamp, logged) in enumerate(times)
    ]  # fmt: skip
    return [*moments(raws, {CONNECTION: PoseStamped}, FrameTree.of([]), "base", Fraction(fps))]


@pytest.mark.parametrize(
    ("times", "seconds"),
    [
        ([(10, 10), (11, 11), (12, 12)], 2.0),
        ([(10, 110), (11, 110.5), (12, 111)], 2.0),  # replayed at twice the speed
        ([(11, 11), (10, 11.1), (12, 12)], 2.0),  # one comes late
        ([(10, 10), (5000, 11), (12, 12)], 2.0),  # one of another clock
        ([(10, 10), (70, 70)], 60.0),  # a pause
        ([(0, 10), (0, 11)], 1.0),  # no stamps
    ],
)
def test_a_second_of_the_stamps_is_a_second(times: list[tuple[float, float]], seconds: float) -> None:
    found = shown(times)
    steps = {later.time_ns - earlier.time_ns for earlier, later in itertools.pairwise(found)}
    assert steps == {SECOND // 2}
    assert len(found) == 2 * seconds + 1


def test_a_moment_knows_what_came_before_it() -> None:
    found = shown([(10, 10), (11, 11)])
    assert [None if one.pose is None else one.pose[0] for one in found] == [0, 0, 1]
