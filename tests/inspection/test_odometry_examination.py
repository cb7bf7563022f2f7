"""Odometry before it is used: what is left out, mended or refused, and that good odometry stays as it is."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.inspection.odometry_examination import ExaminedOdometry, OdometryMessages, examine
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.recording.clocks import clock_of

COUNT, STEP_NS, SPEED_MPS = 60, 50_000_000, 0.4
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])


def good(count: int = COUNT) -> list[Odometry]:
    """Straight ahead, with velocities; three seconds of it."""
    return [
        Odometry.planar(
            (i + 1) * STEP_NS,
            ("odom", "base_link"),
            (SPEED_MPS * i * STEP_NS / 1e9, 0.0, 0.0),
            np.zeros((3, 3)),
            (SPEED_MPS, 0.0),
        )
        for i in range(count)
    ]


def examined(messages: list[Odometry], base_from_child: Array | None = None) -> ExaminedOdometry:
    gathered = OdometryMessages()
    for i, message in enumerate(messages):
        gathered.take((i + 1) * STEP_NS, message)
    place = np.eye(4) if base_from_child is None else base_from_child
    return examine("/odom", gathered, clock_of(*gathered.times), lambda _: place)


def way_m(found: ExaminedOdometry) -> float:
    assert found.track is not None
    return float(found.track.odom_from_base[-1, 0] - found.track.odom_from_base[0, 0])


WAY_M = SPEED_MPS * (COUNT - 1) * STEP_NS / 1e9


def test_good_odometry_stays_as_it_is() -> None:
    found = examined(good())
    assert found.track is not None
    assert (found.track.frame_id, len(found.track.stamps_ns)) == ("odom", COUNT)
    assert (found.refusal, found.notes, sum(found.dropped.values())) == ("", (), 0)
    np.testing.assert_allclose(way_m(found), WAY_M)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"orientation_xyzw": np.zeros(4)}, "without orientation"),
        ({"orientation_xyzw": np.full(4, np.nan)}, "not finite"),
        ({"position_m": np.full(3, np.inf)}, "not finite"),
        ({"pose_covariance": np.eye(6) * 9999.0, "position_m": np.zeros(3)}, "robot is lost"),
        ({"position_m": np.array([7.0, 7.0, 0.0])}, "leap away"),
        ({"child_frame_id": "trailer"}, "another frame"),
        ({"stamp_ns": 0}, "stamp cannot be"),
        ({"stamp_ns": 30 * STEP_NS}, "repeat the time of another"),
    ],
)
def test_one_message_that_cannot_be_is_left_out_and_counted(change: dict[str, object], reason: str) -> None:
    messages = good()
    messages[30] = replace(messages[30], **change)
    found = examined(messages)
    assert found.track is not None
    assert len(found.track.stamps_ns) == COUNT - 1
    assert [count for told, count in found.dropped.items() if reason in told] == [1]
    np.testing.assert_allclose(way_m(found), WAY_M)


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_velocities_stand_in_for_poses_without_orientation(value: float) -> None:
    found = examined([replace(message, orientation_xyzw=np.full(4, value)) for message in good()])
    assert found.track is not None
    np.testing.assert_allclose(way_m(found), WAY_M)
    assert found.track.frame_id == ""  # what is added up is in no frame of the log's
    assert any("velocities are added up" in note for note in found.notes)


def test_poses_that_stand_still_while_velocities_do_not_are_left_out() -> None:
    messages = good()
    messages[20:45] = [replace(message, position_m=messages[20].position_m) for message in messages[20:45]]
    found = examined(messages)
    assert any("stand still" in reason and count >= 24 for reason, count in found.dropped.items())
    np.testing.assert_allclose(way_m(found), WAY_M)


def test_a_robot_that_stands_still_is_fine() -> None:
    still = [replace(message, position_m=np.zeros(3), linear_mps=np.zeros(3)) for message in good()]
    found = examined(still)
    assert found.track is not None
    assert (len(found.track.stamps_ns), found.notes, sum(found.dropped.values())) == (COUNT, (), 0)


def test_odometry_of_a_camera_becomes_that_of_the_base() -> None:
    """The camera looks along its z axis, and so does the frame of its odometry."""
    optical = np.array([[0.0, 0, 1, 0.1], [-1, 0, 0, 0], [0, -1, 0, 0.3], [0, 0, 0, 1]])
    along_z = [
        replace(message, child_frame_id="optical", position_m=message.position_m[[1, 2, 0]]) for message in good()
    ]
    found = examined(along_z, optical)
    assert found.track is not None
    poses = found.track.odom_from_base
    np.testing.assert_allclose(np.hypot(*(poses[-1, :2] - poses[0, :2])), WAY_M)
    assert any("does not lie flat" in note for note in found.notes)


@pytest.mark.parametrize(
    ("messages", "complaint"),
    [
        ([replace(one, orientation_xyzw=np.zeros(4), linear_mps=np.zeros(3)) for one in good()], "no orientation"),
        ([replace(one, child_frame_id=f"tug{i % 2}") for i, one in enumerate(good())], "several frames, tug0, tug1"),
        ([replace(one, position_m=one.position_m * 1000) for one in good()], "as if it were in mm"),
    ],
)
def test_what_cannot_be_understood_is_refused_with_a_remedy(messages: list[Odometry], complaint: str) -> None:
    found = examined(messages)
    assert found.track is None
    assert complaint in found.refusal
    assert "--odom" in found.refusal


def test_poses_that_slide_away_from_their_velocities_are_left_out_and_nothing_joins_what_follows() -> None:
    """As a filter that is put right over a second does it: no step is a leap."""
    slid = [
        replace(one, position_m=one.position_m + np.array([0.0, 0.12 * np.clip(i - 100, 0, 10), 0.0]))
        for i, one in enumerate(good(4 * COUNT))
    ]
    found = examined(slid)
    assert found.track is not None
    assert found.dropped["odometry messages whose poses move otherwise than their velocities"] > 8
    assert found.track.piece.tolist() == sorted(found.track.piece.tolist())
    assert found.track.piece[-1] == 1


def test_velocities_of_another_frame_say_nothing_of_poses() -> None:
    turned = [replace(one, linear_mps=one.linear_mps[[1, 0, 2]]) for one in good()]
    assert (sum(examined(turned).dropped.values()), way_m(examined(turned))) == (0, pytest.approx(WAY_M))


@pytest.mark.parametrize("scale", [0.1, 50.0])
def test_quaternions_may_be_scaled_but_degrees_are_none(scale: float) -> None:
    scaled = [replace(one, orientation_xyzw=scale * one.orientation_xyzw) for one in good()]
    assert not examined(scaled).notes
    degrees = [replace(one, orientation_xyzw=np.array([0.0, 0.0, 2.0 * i, 1.0])) for i, one in enumerate(good())]
    (note,) = examined(degrees).notes
    assert "have no orientation" in note
    assert way_m(examined(degrees)) == pytest.approx(WAY_M)
