"""Odometry that leaps: what holds together, what is left out, and what one robot cannot have driven."""

import numpy as np
import pytest
from mcap_landmarks.estimation.odometry_pieces import NO_PIECE, find_pieces, leaps
from mcap_landmarks.geometry.se2 import Array, between, compose, exp

TIMES_S = np.arange(120) / 20.0
POSES = np.array([exp(np.array([0.5, 0.0, 0.2]) * t) for t in TIMES_S])
"""A robot that drives an arc at 0.5 m/s."""


def test_a_robot_that_drives_stands_or_turns_on_the_spot_never_leaps() -> None:
    turning = np.column_stack([np.zeros((120, 2)), 2.0 * TIMES_S])
    stopping = np.where((TIMES_S > 3.0)[:, None], POSES[60], POSES)
    for poses in (POSES, turning, stopping, np.zeros((120, 3))):
        assert not leaps(TIMES_S, poses).any()
        assert (find_pieces(TIMES_S, poses).piece == 0).all()


@pytest.mark.parametrize("row", [0, 1, 60, 119])
def test_an_outlier_is_left_out(row: int) -> None:
    poses = POSES.copy()
    poses[row] += [5.0, -3.0, 0.0]
    found = find_pieces(TIMES_S, poses)
    assert np.flatnonzero(found.piece == NO_PIECE).tolist() == [row]
    kept = found.piece != NO_PIECE
    np.testing.assert_allclose(found.poses[kept], POSES[kept])
    assert sum(found.dropped.values()) == 1


@pytest.mark.parametrize("start", [np.zeros(3), np.array([40.0, 3.0, -2.0])])
def test_a_leap_between_two_messages_is_bridged(start: Array) -> None:
    """The robot is taken to have driven on: how far that may be off is known."""
    poses = POSES.copy()
    poses[70:] = compose(start, between(POSES[70], POSES[70:]))
    found = find_pieces(TIMES_S, poses)
    assert (found.piece == 0).all()
    assert found.bridged == 1
    np.testing.assert_allclose(found.poses, POSES, atol=1e-9)
    assert np.flatnonzero(found.slack.any(axis=1)).tolist() == [70]


def test_a_leap_over_a_gap_makes_two_pieces() -> None:
    times_s, poses = np.delete(TIMES_S, slice(60, 80)), np.delete(POSES, slice(60, 80), axis=0)
    poses[60:] = between(poses[60], poses[60:])
    found = find_pieces(times_s, poses)
    assert found.piece.tolist() == [0] * 60 + [1] * 40
    assert not found.bridged


def test_a_gap_that_the_robot_drove_through_makes_none() -> None:
    times_s, poses = np.delete(TIMES_S, slice(60, 80)), np.delete(POSES, slice(60, 80), axis=0)
    assert (find_pieces(times_s, poses).piece == 0).all()


def test_two_robots_on_one_topic_are_told_with_their_places() -> None:
    times_s = np.sort(np.concatenate([TIMES_S, TIMES_S + 0.02]))
    poses = np.empty((240, 3))
    poses[::2], poses[1::2] = POSES, compose(np.array([9.0, 4.0, 1.0]), POSES)
    found = find_pieces(times_s, poses)
    assert found.places == ((0.0, 0.0), (9.0, 4.0))
    assert (found.piece == NO_PIECE).all()
