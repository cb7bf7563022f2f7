"""The inertial measurement unit: turn rates and specific force from how the robot moved, with noise and biases."""

from collections.abc import Iterator

import numpy as np
from mcap_landmarks.stage import Channel, Stamped
from numpy.typing import NDArray

from mcap_landmarks_generator.clock import Delivery, measurement_times
from mcap_landmarks_generator.history import History, rotate
from mcap_landmarks_generator.imu_message import Imu
from mcap_landmarks_generator.randomness import Stream, draws
from mcap_landmarks_generator.sensor_specs import ImuSpec
from mcap_landmarks_generator.world import STEP_NS

Floats = NDArray[np.float64]

IMU = Channel("/imu", Imu)
IMU_FRAME = "imu_link"
_GRAVITY_MPS2 = np.array([0.0, 0.0, 9.81])
_OVER_NS = 5 * STEP_NS
"""Motion is differentiated over so long before and after: contacts of the wheels shake the body within single steps."""
KNOWN_AFTER_NS = 2 * _OVER_NS
"""So long after a time, at the latest, it is known what was felt then."""


class ImuSensor:
    """Messages of one simulated recording, in order."""

    def __init__(self, spec: ImuSpec, seed: int, start_ns: int) -> None:
        self._spec = spec
        self._times = measurement_times(spec, draws(seed, Stream.IMU_CLOCK))
        self._delivery = Delivery(spec, seed, Stream.IMU_DELIVERY, start_ns)
        self._noise = draws(seed, Stream.IMU)
        self._turn_bias = self._noise.normal(0.0, np.deg2rad(spec.turn_bias_dps), 3)
        self._force_bias = self._noise.normal(0.0, spec.force_bias_mps2, 3)
        self._next_ns = next(self._times)

    def measure(self, history: History) -> Iterator[Stamped]:
        """The messages whose time, and a little after it, lies in the past."""
        while max(self._next_ns, _OVER_NS) + _OVER_NS <= history.end_ns:
            delivered = self._delivery.of(self._next_ns)
            message = self._message(history, self._next_ns, delivered.stamp_ns if delivered is not None else 0)
            if delivered is not None:
                yield Stamped(IMU, delivered.log_time_ns, message)
            self._next_ns = next(self._times)

    def _message(self, history: History, time_ns: int, stamp_ns: int) -> Imu:
        spec = self._spec
        turn, force = true_motion(history, max(time_ns, _OVER_NS))
        turn_sigma = np.deg2rad(spec.turn_sigma_dps)
        return Imu(
            stamp_ns=stamp_ns,
            frame_id=IMU_FRAME,
            turn_radps=turn + self._turn_bias + self._noise.normal(0.0, turn_sigma, 3),
            force_mps2=force + self._force_bias + self._noise.normal(0.0, spec.force_sigma_mps2, 3),
            turn_variance=float(turn_sigma**2),
            force_variance=spec.force_sigma_mps2**2,
        )


def true_motion(history: History, time_ns: int) -> tuple[Floats, Floats]:
    """Turn rates (3,) rad/s and specific force (3,) m/s2 in the robot's own axes, by central differences."""
    times = np.array([time_ns - _OVER_NS, time_ns, time_ns + _OVER_NS])
    step_s = _OVER_NS / 1e9
    before, now, after = history.positions(times)
    orientations = history.orientations(times)
    # Columns: the axes x, y, z of the robot in the world, at each time.
    axes = np.stack([rotate(np.repeat(orientations[i : i + 1], 3, axis=0), np.eye(3)).T for i in range(3)])
    rate = (axes[2] - axes[0]) @ axes[1].T / (2 * step_s)  # the derivative of a rotation times its inverse is skew
    turn_world = np.array([rate[2, 1] - rate[1, 2], rate[0, 2] - rate[2, 0], rate[1, 0] - rate[0, 1]]) / 2
    force_world = (after - 2 * now + before) / step_s**2 + _GRAVITY_MPS2
    return axes[1].T @ turn_world, axes[1].T @ force_world
