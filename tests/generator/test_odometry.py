"""Odometry drifts as configured, and the wheels really drive the robot."""

import numpy as np
import pytest
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks_generator.history import History
from mcap_landmarks_generator.odometry import OdometrySensor, WheelOdometry, true_poses
from mcap_landmarks_generator.randomness import Stream, draws
from mcap_landmarks_generator.scenario import TrajectorySpec, Waypoint
from mcap_landmarks_generator.sensor_specs import OdometrySpec
from mcap_landmarks_generator.trajectory import Driver
from mcap_landmarks_generator.world import STEP_NS, World
from numpy.typing import NDArray

Floats = NDArray[np.float64]

START = np.array([2.0, -1.0, 0.6])


@pytest.fixture(scope="module")
def driven() -> History:
    """Some 12 s of driving at four times the speed: a curve, a straight and a turn on the spot."""
    history = History()
    with World((), START) as world:
        history.append(world.robot.state(), standing=False)
        way = TrajectorySpec(waypoints=(Waypoint(at=(5.0, 0.0)), Waypoint(at=(11.0, 5.0), heading_deg=-90.0)))
        driver = Driver(way, START, 4.0)
        step = 0
        while not driver.done and step < 10_000:
            if step % 4 == 0:
                pose = true_poses(history, np.array([history.end_ns]))[0]
                command = driver.command(pose)
                world.robot.drive(command.speed_mps, command.turn_radps)
            world.step()
            history.append(world.robot.state(), standing=False)
            step += 1
    assert driver.done
    return history


def reckoned(history: History, spec: OdometrySpec, seed: int = 0) -> WheelOdometry:
    odometry = WheelOdometry(spec, draws(seed, Stream.SLIP))
    for time_ns in range(0, history.end_ns, 33_333_333):
        odometry.update(history.wheels(np.array([time_ns]))[0], 1 / 30)
    odometry.update(history.wheels(np.array([history.end_ns]))[0], 1 / 30)
    return odometry


def true_move(history: History) -> Floats:
    """Where the robot is (3,), seen from where it started."""
    end = true_poses(history, np.array([history.end_ns]))[0]
    c, s = np.cos(START[2]), np.sin(START[2])
    away = end[:2] - START[:2]
    return np.array([c * away[0] + s * away[1], -s * away[0] + c * away[1], float(wrap(end[2] - START[2]))])


@pytest.mark.slow
def test_without_errors_the_wheels_tell_the_way(driven: History) -> None:
    odometry = reckoned(driven, OdometrySpec(distance_slip=0.0, heading_slip_deg=0.0))
    error = odometry.pose - true_move(driven)
    assert np.hypot(error[0], error[1]) < 0.005 * 11.5, "the wheels slide"
    assert abs(np.rad2deg(wrap(error[2]))) < 0.3
    assert odometry.covariance == pytest.approx(np.zeros((3, 3)))


@pytest.mark.slow
def test_drift_over_20_seeds_is_the_configured_one() -> None:
    """Within 35 %: after 25 m straight on, the spread of distance and heading, and the covariance's own claim."""
    spec = OdometrySpec(distance_slip=0.02, heading_slip_deg=0.5)
    ends, claims = [], []
    for seed in range(20):
        odometry = WheelOdometry(spec, draws(seed, Stream.SLIP))
        length = 0.0
        for angle in np.linspace(0, 25.0 / 0.033, 800):
            before = odometry.pose.copy()
            odometry.update(np.array([angle, angle]), 1 / 30)
            turned = np.cos(before[2]), np.sin(before[2])
            length += float((odometry.pose - before)[:2] @ turned)
        ends.append([length - 25.0, odometry.pose[2], odometry.pose[1]])
        claims.append(np.sqrt(np.diag(odometry.covariance)))
    spread = np.sqrt(np.mean(np.square(ends), axis=0))
    assert spread[0] == pytest.approx(0.02 * 5, rel=0.35)
    assert np.rad2deg(spread[1]) == pytest.approx(0.5 * 5, rel=0.35)
    claimed = np.mean(claims, axis=0)
    assert spread[2] == pytest.approx(claimed[1], rel=0.35)
    assert np.rad2deg(claimed[2]) == pytest.approx(0.5 * 5, rel=0.01)


@pytest.mark.slow
def test_systematic_errors_scale_distance_and_turn(driven: History) -> None:
    exact = OdometrySpec(distance_slip=0.0, heading_slip_deg=0.0)
    too_large = OdometrySpec(distance_slip=0.0, heading_slip_deg=0.0, radius_error=0.02)
    too_wide = OdometrySpec(distance_slip=0.0, heading_slip_deg=0.0, baseline_error=0.02)
    turn = reckoned(driven, exact).pose[2]
    assert wrap(reckoned(driven, too_large).pose[2]) == pytest.approx(wrap(1.02 * turn), abs=1e-6)
    assert wrap(reckoned(driven, too_wide).pose[2]) == pytest.approx(wrap(turn / 1.02), abs=1e-6)


def test_messages_from_the_wheels_start_at_zero(driven: History) -> None:
    stamped = list(OdometrySensor(OdometrySpec(latency_s=0.01, jitter_s=0.0), 0, 10**18).measure(driven))
    first, transform = stamped[0].message, stamped[1].message
    assert isinstance(first, Odometry)
    assert isinstance(transform, TFMessage)
    assert (first.stamp_ns, stamped[0].log_time_ns) == (10**18 + 10_000_000, 10**18 + 11_000_000)
    assert first.pose == pytest.approx(np.zeros(3))
    assert (first.frame_id, first.child_frame_id) == ("odom", "base_footprint")
    assert len(stamped) == 2 * (driven.end_ns * 30 // 10**9 + 1)
    last = stamped[-2].message
    assert isinstance(last, Odometry)
    assert last.pose_covariance[0, 0] > 0
    assert last.pose_covariance[5, 5] > 0


def test_messages_from_the_world_are_the_true_pose(driven: History) -> None:
    spec = OdometrySpec(source="world", jitter_s=0.0)
    for stamped in OdometrySensor(spec, 0, 0).measure(driven):
        message = stamped.message
        if isinstance(message, Odometry):
            assert message.pose == pytest.approx(true_poses(driven, np.array([message.stamp_ns]))[0], abs=1e-9)
    assert abs(message_speed(driven, spec)) < 4 * 0.26 + 0.01


def message_speed(driven: History, spec: OdometrySpec) -> float:
    speeds = [
        stamped.message.linear_mps[0]
        for stamped in OdometrySensor(spec, 0, 0).measure(driven)
        if isinstance(stamped.message, Odometry)
    ]
    return float(np.max(speeds))


def test_the_robot_keeps_its_limits_and_arrives(driven: History) -> None:
    times = np.arange(0, driven.end_ns, STEP_NS, dtype=np.int64)
    poses = true_poses(driven, times)
    speeds = np.hypot(*np.diff(poses[:, :2], axis=0).T) / (STEP_NS / 1e9)
    assert speeds.max() < 4 * 0.26 * 1.02
    assert speeds.max() > 4 * 0.26 * 0.9
    assert np.abs(wrap(np.diff(poses[:, 2]))).max() / (STEP_NS / 1e9) < 4 * 1.82 * 1.02
    assert poses[-1, :2] == pytest.approx([11.0, 5.0], abs=0.005)
    assert np.rad2deg(poses[-1, 2]) == pytest.approx(-90.0, abs=0.2)
    assert np.abs(driven.positions(times)[:, 2]).max() < 0.001
