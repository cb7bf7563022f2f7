"""Which topic of poses is taken, and what of it can be used."""

from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import MAP_POSE, ODOMETRY, POSE, POSE_COVARIANCE, TF, TRUTH_POSE
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.evaluation.pose_topics import read_poses
from mcap_landmarks.messages.poses import Odometry, PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.stage import Channel

from tests.diff.recordings import START_NS, write

SPREAD = np.diag([0.01, 0.04, 0.0025])


def entry(channel: Channel, i: int, pose: tuple[float, float, float] = (1.0, 2.0, 0.5)):  # type: ignore[no-untyped-def] # noqa: ANN201 - of a log
    time_ns = START_NS + i
    if channel.message is PoseStamped:
        return channel, time_ns, PoseStamped.planar(time_ns, "map", pose)
    if channel.message is PoseWithCovarianceStamped:
        return channel, time_ns, PoseWithCovarianceStamped.planar(time_ns, "map", pose, SPREAD)
    return channel, time_ns, Odometry.planar(time_ns, ("odom", "base"), pose, SPREAD)


def test_the_topic_that_says_most_is_taken(tmp_path: Path) -> None:
    """What localize found with covariances, if every pose has one; else what it found, what map found, and so on."""
    there = []
    order = [ODOMETRY, TRUTH_POSE, MAP_POSE, POSE, POSE_COVARIANCE]
    for number, channel in enumerate(order):
        there.append(entry(channel, 0))
        track = read_poses(write(tmp_path / "log.mcap", there))
        assert track.topic == channel.topic
        assert track.others == tuple(other.topic for other in reversed(order[:number]))
    without = write(tmp_path / "log.mcap", [*there, entry(POSE, 1)])
    assert read_poses(without).topic == POSE.topic
    assert read_poses(without, ODOMETRY.topic).frame == "odom"


def test_covariances_come_along_where_they_are_known(tmp_path: Path) -> None:
    log = write(tmp_path / "log.mcap", [entry(POSE_COVARIANCE, 0), entry(POSE, 0)])
    np.testing.assert_allclose(read_poses(log).trajectory.covariances, [SPREAD])
    assert np.isnan(read_poses(log, POSE.topic).trajectory.covariances).all()
    unknown = PoseWithCovarianceStamped.planar(START_NS, "map", (0, 0, 0), np.zeros((3, 3)))
    log = write(tmp_path / "log.mcap", [(POSE_COVARIANCE, START_NS, unknown)])
    assert np.isnan(read_poses(log).trajectory.covariances).all()


def test_two_of_equal_rank_are_not_guessed_between(tmp_path: Path) -> None:
    left, right = Channel("/left/odom", Odometry), Channel("/right/odom", Odometry)
    log = write(tmp_path / "log.mcap", [entry(left, 0), entry(right, 0)])
    with pytest.raises(UsageError, match=r"log\.mcap: /left/odom and /right/odom have poses; choose with --topic"):
        read_poses(log)
    assert read_poses(log, "/right/odom").topic == "/right/odom"


def test_transforms_are_taken_by_their_child(tmp_path: Path) -> None:
    def moved(i: int) -> TFMessage:
        frames = [("map", "odom"), ("/odom", "/base")]
        return TFMessage(tuple(Transform.planar(START_NS + i, pair, (i, 0, 0)) for pair in frames))

    log = write(tmp_path / "log.mcap", [(TF, START_NS + i, moved(i)) for i in range(3)])
    with pytest.raises(RecordingError, match="has no poses"):
        read_poses(log)
    with pytest.raises(UsageError, match="/tf has map -> odom and odom -> base; choose with --child"):
        read_poses(log, "/tf")
    with pytest.raises(UsageError, match="choose with --child"):
        read_poses(log, "/tf", "camera")
    track = read_poses(log, "/tf", "base")
    assert (track.frame, track.trajectory.poses[:, 0].tolist()) == ("odom", [0, 1, 2])


def test_what_cannot_be_used_is_left_out_and_told(tmp_path: Path) -> None:
    again, nowhere = entry(TRUTH_POSE, 0, (9, 9, 0)), entry(TRUTH_POSE, 1, (np.nan, 0, 0))
    high = PoseStamped(START_NS + 2, "map", np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, 0.0, 1.0]))
    other = PoseStamped(START_NS + 3, "world", np.zeros(3), np.zeros(4))
    more = [(TRUTH_POSE, START_NS + 2, high), (TRUTH_POSE, START_NS + 3, other)]
    track = read_poses(write(tmp_path / "log.mcap", [entry(TRUTH_POSE, 0), again, nowhere, *more]))
    assert (track.trajectory.time_ns - START_NS).tolist() == [0, 2, 3]
    np.testing.assert_allclose(track.trajectory.poses, [[1, 2, 0.5], [1, 2, 0], [0, 0, np.nan]])
    assert track.notes == (
        "1 poses are not finite; they are left out",
        "1 poses have the time of another one; the first of each time stays",
        "poses are given in the plane: heights (up to 3 m) and tilts are left out",
        "the poses are in several frames: map, world",
    )
    with pytest.raises(RecordingError, match="/ground_truth/pose has no pose that can be used; 1 poses are not finite"):
        read_poses(write(tmp_path / "log.mcap", [nowhere]))


def test_a_topic_without_poses_is_refused(tmp_path: Path) -> None:
    log = write(tmp_path / "log.mcap", [entry(POSE, 0)])
    with pytest.raises(UsageError, match="/scan is not in the log; --topic takes geometry_msgs/msg/PoseStamped"):
        read_poses(log, "/scan")
