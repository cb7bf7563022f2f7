"""Odometry from the wheels, with errors of the assumed geometry and slip, or from the world as Gazebo can give it."""

from collections.abc import Iterator

import numpy as np
from mcap_landmarks.channels import BASE_FRAME, ODOM_FRAME, ODOMETRY, TF
from mcap_landmarks.geometry import se2
from mcap_landmarks.geometry.angles import yaw_from_quaternion
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.stage import Stamped
from numpy.typing import NDArray

from mcap_landmarks_generator.clock import Delivery, measurement_times
from mcap_landmarks_generator.history import History
from mcap_landmarks_generator.randomness import Stream, draws
from mcap_landmarks_generator.robot import WHEEL_DISTANCE_M, WHEEL_RADIUS_M
from mcap_landmarks_generator.sensor_specs import OdometrySpec

Floats = NDArray[np.float64]

_FRAMES = (ODOM_FRAME, BASE_FRAME)
# What odometry from the world claims: a millimetre and a third of a milliradian.
_WORLD_COVARIANCE = np.diag([1e-6, 1e-6, 1e-7])


class WheelOdometry:
    """Dead reckoning from wheel angles: pose (3,) in the frame odom, its covariance (3, 3), speeds forward and turn.

    Slip is a random walk: after a wheel travel of d metres the distance has the standard deviation
    `distance_slip` * sqrt(d), the heading `heading_slip_deg` * sqrt(d). Turns on the spot slip too.
    """

    def __init__(self, spec: OdometrySpec, rng: np.random.Generator) -> None:
        self.pose = np.zeros(3)
        self.covariance = np.zeros((3, 3))
        self.speeds = (0.0, 0.0)
        self._rng = rng
        self._slip = np.array([spec.distance_slip, np.deg2rad(spec.heading_slip_deg)])
        self._radius_m = WHEEL_RADIUS_M * (1 + spec.radius_error)
        self._baseline_m = WHEEL_DISTANCE_M * (1 + spec.baseline_error)
        self._wheels_rad: Floats | None = None

    def update(self, wheels_rad: Floats, period_s: float) -> None:
        """Take the angles (2,) of the wheels, `period_s` after the last ones."""
        before = wheels_rad if self._wheels_rad is None else self._wheels_rad
        self._wheels_rad = wheels_rad
        left, right = (wheels_rad - before) * self._radius_m
        spread = self._slip * np.sqrt((abs(left) + abs(right)) / 2)
        slip = self._rng.normal(0.0, 1.0, 2) * spread
        distance, turn = (left + right) / 2 + slip[0], (right - left) / self._baseline_m + slip[1]
        heading = self.pose[2] + turn / 2
        moved = np.array([[1.0, 0.0, -distance * np.sin(heading)], [0.0, 1.0, distance * np.cos(heading)], [0, 0, 1]])
        along = np.array([[np.cos(heading), 0.0], [np.sin(heading), 0.0], [0.0, 1.0]]) * spread
        self.covariance = moved @ self.covariance @ moved.T + along @ along.T
        self.pose = se2.compose(self.pose, se2.exp([distance, 0.0, turn]))
        if period_s > 0:
            self.speeds = (float(distance / period_s), float(turn / period_s))


class OdometrySensor:
    """Odometry messages and transforms of one simulated recording, in order."""

    def __init__(self, spec: OdometrySpec, seed: int, start_ns: int) -> None:
        self._spec = spec
        self._delivery = Delivery(spec, seed, Stream.ODOMETRY_DELIVERY, start_ns)
        self._times = measurement_times(spec, draws(seed, Stream.ODOMETRY_CLOCK))
        self._next_ns = next(self._times)
        self._last_ns = self._next_ns
        self._last_pose: Floats | None = None
        self._wheels = WheelOdometry(spec, draws(seed, Stream.SLIP))

    def measure(self, history: History) -> Iterator[Stamped]:
        """The messages whose time lies in the past."""
        while self._next_ns <= history.end_ns:
            period_s = (self._next_ns - self._last_ns) / 1e9
            at_ns = np.array([self._next_ns])
            if self._spec.source == "world":
                pose, covariance, speeds = self._from_world(history, at_ns, period_s)
            else:
                self._wheels.update(history.wheels(at_ns)[0], period_s)
                pose, covariance, speeds = self._wheels.pose, self._wheels.covariance, self._wheels.speeds
            delivered = self._delivery.of(self._next_ns)
            if delivered is not None:
                stamp_ns, log_ns = delivered
                yield Stamped(ODOMETRY, log_ns, Odometry.planar(stamp_ns, _FRAMES, pose, covariance, speeds))
                yield Stamped(TF, log_ns, TFMessage((Transform.planar(stamp_ns, _FRAMES, pose),)))
            self._last_ns = self._next_ns
            self._next_ns = next(self._times)

    def _from_world(
        self, history: History, at_ns: NDArray[np.int64], period_s: float
    ) -> tuple[Floats, Floats, tuple[float, float]]:
        pose = true_poses(history, at_ns)[0]
        speeds = (0.0, 0.0)
        if self._last_pose is not None and period_s > 0:
            step = se2.log(se2.between(self._last_pose, pose)) / period_s
            speeds = (float(step[0]), float(step[2]))
        self._last_pose = pose
        return pose, _WORLD_COVARIANCE, speeds


def true_poses(history: History, at_ns: NDArray[np.int64]) -> Floats:
    """True poses x, y, heading (N, 3) of base_footprint in the frame map."""
    heading = yaw_from_quaternion(history.orientations(at_ns))
    return np.column_stack([history.positions(at_ns)[:, :2], heading])
