"""The LiDAR: beams cast through the world from where the robot is at each beam's time, and their noise."""

from collections.abc import Iterator

import numpy as np
from mcap_landmarks.channels import SCAN
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.stage import Stamped
from numpy.typing import NDArray

from mcap_landmarks_generator.clock import Delivery, measurement_times, to_ns
from mcap_landmarks_generator.history import History, rotate
from mcap_landmarks_generator.randomness import Stream, draws
from mcap_landmarks_generator.ring_lidar import intensities_of
from mcap_landmarks_generator.robot import SCAN_FRAME, SCAN_IN_BASE_M
from mcap_landmarks_generator.sensor_specs import LidarSpec
from mcap_landmarks_generator.world import Returns, World

Floats = NDArray[np.float64]

# Turtlebot3's scan: the last beam is at 6.28 rad, so 360 beams are 1.00228 degrees apart.
ANGLE_MAX_RAD = 6.28
# While someone walks, a turn of the LiDAR is cast in this many pieces, with everyone where they are at its middle.
_PIECES = 12


class Lidar:
    """Scans of one simulated recording, in order."""

    def __init__(self, spec: LidarSpec, seed: int, start_ns: int) -> None:
        self._spec, self._seed = spec, seed
        self._delivery = Delivery(spec, seed, Stream.LIDAR_DELIVERY, start_ns)
        self._times = measurement_times(spec, draws(seed, Stream.LIDAR_CLOCK))
        self._next_ns = next(self._times)
        self._index = 0
        self._period_ns = 0 if spec.instantaneous else to_ns(1 / spec.rate_hz)
        self._beam_ns = np.arange(spec.beams, dtype=np.int64) * self._period_ns // spec.beams

    def measure(self, history: History, world: World) -> Iterator[Stamped]:
        """The scans whose last beam lies in the past."""
        while self._next_ns + self._period_ns <= history.end_ns:
            delivered = self._delivery.of(self._next_ns, self._period_ns)
            if delivered is not None:
                returns = cast(world, history, self._spec, self._next_ns + self._beam_ns)
                ranges = noisy(returns.distances_m, self._spec, draws(self._seed, Stream.SCAN, self._index))
                yield Stamped(SCAN, delivered.log_time_ns, self._message(delivered.stamp_ns, ranges, returns))
            self._index += 1
            self._next_ns = next(self._times)

    def _message(self, stamp_ns: int, ranges: Floats, returns: Returns) -> LaserScan:
        spec = self._spec
        intensities = np.where(np.isfinite(ranges), intensities_of(returns), 0.0) if spec.intensities else np.zeros(0)
        return LaserScan(
            stamp_ns=stamp_ns,
            frame_id=SCAN_FRAME,
            angle_min_rad=0.0,
            angle_max_rad=ANGLE_MAX_RAD,
            angle_increment_rad=ANGLE_MAX_RAD / (spec.beams - 1),
            time_increment_s=self._period_ns / spec.beams / 1e9,
            scan_time_s=1 / spec.rate_hz,
            range_min_m=spec.range_min_m,
            range_max_m=spec.range_max_m,
            ranges_m=ranges.astype(np.float32),
            intensities=intensities.astype(np.float32),
        )


def beam_angles(spec: LidarSpec) -> Floats:
    """Directions (N,) of the beams in base_scan, in rad."""
    return np.linspace(0.0, ANGLE_MAX_RAD, spec.beams)


def cast(world: World, history: History, spec: LidarSpec, times_ns: NDArray[np.int64]) -> Returns:
    """What the beams meet first at their times (N,), infinitely far where there is nothing within reach."""
    angles = beam_angles(spec)
    directions = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    orientations = history.orientations(times_ns)
    starts = history.positions(times_ns) + rotate(orientations, np.broadcast_to(SCAN_IN_BASE_M, directions.shape))
    rays = rotate(orientations, directions)
    # A little beyond the reach, from where noise can bring an echo back into it.
    reach_m = spec.range_max_m + 4 * spec.sigma_m
    parts = []
    for piece in np.array_split(np.arange(spec.beams), _PIECES if world.has_walkers else 1):
        world.move_walkers(float(times_ns[piece].mean()) / 1e9)
        parts.append(world.returns(starts[piece], rays[piece], reach_m, spec.glass_deg))
    distances, cosines, numbers, passed = (
        np.concatenate(columns)
        for columns in zip(
            *((part.distances_m, part.cosines, part.name_of, part.passed) for part in parts), strict=True
        )
    )
    return Returns(distances, cosines, parts[0].names, numbers, passed)


def noisy(distances: Floats, spec: LidarSpec, rng: np.random.Generator) -> Floats:
    """Ranges (N,) from true distances: noise, dropouts, and nothing outside the limits of range."""
    ranges = distances + rng.normal(0.0, spec.sigma_m, len(distances))
    dropped = rng.random(len(distances)) < spec.dropout
    seen = (ranges >= spec.range_min_m) & (ranges <= spec.range_max_m) & ~dropped
    return np.where(seen, ranges, np.inf)
