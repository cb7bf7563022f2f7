"""A LiDAR of several rings: beams cast while it turns and the robot drives on, and what they return."""

from collections.abc import Iterator, Sequence

import numpy as np
from mcap_landmarks.stage import Channel, Stamped
from numpy.typing import NDArray

from mcap_landmarks_generator.clock import Delivery, measurement_times, to_ns
from mcap_landmarks_generator.history import History, rotate
from mcap_landmarks_generator.layout import PlacedObject
from mcap_landmarks_generator.randomness import Stream, draws
from mcap_landmarks_generator.ring_caster import RingCaster
from mcap_landmarks_generator.ring_cloud import RingCloud
from mcap_landmarks_generator.sensor_specs import RingLidarSpec
from mcap_landmarks_generator.world import Returns

Floats = NDArray[np.float64]

POINTS = Channel("/points", RingCloud)
RINGS_FRAME = "ring_lidar"
_REFLECTIVITY = {
    "stop sign": 1.0,
    "reflector": 3.0,
    "glass": 1.0,
    "car": 0.7,
    "traffic light": 0.5,
    "tree": 0.35,
    "": 0.25,
}
_OTHERWISE = 0.45
"""Share of the light at 905 nm that comes back from straight ahead: a road sign's reflecting sheet all of what the
receiver can tell (it saturates), a reflector's at any angle, paint more than cloth, asphalt (the ground, without a
name) about a quarter."""
_THROUGH = 0.96**2
"""Share of the light that is left after a surface of glass, there and back: each reflects 4 % (Fresnel, index 1.5)."""
_EDGE_M = 0.3
"""Neighbouring beams of a ring whose ranges differ by more lie on both sides of an edge."""
_RAIN_M = 4.0
"""Mean range of the drops that are seen: their echo falls with the fourth power of it."""


class RingLidar:
    """Clouds of one simulated recording, in order."""

    def __init__(self, spec: RingLidarSpec, objects: Sequence[PlacedObject], seed: int, start_ns: int) -> None:
        self._spec, self._seed = spec, seed
        self._caster = RingCaster(objects)
        self._delivery = Delivery(spec, seed, Stream.RINGS_DELIVERY, start_ns)
        self._times = measurement_times(spec, draws(seed, Stream.RINGS_CLOCK))
        self._next_ns = next(self._times)
        self._index = 0
        self._period_ns = to_ns(1 / spec.rate_hz)
        self._directions = directions(spec)

    def measure(self, history: History) -> Iterator[Stamped]:
        """The clouds whose last beam lies in the past."""
        while self._next_ns + self._period_ns <= history.end_ns:
            delivered = self._delivery.of(self._next_ns, self._period_ns)
            if delivered is not None:
                cloud = self._cloud(history, self._next_ns, delivered.stamp_ns)
                yield Stamped(POINTS, delivered.log_time_ns, cloud)
            self._index += 1
            self._next_ns = next(self._times)

    def _cloud(self, history: History, first_ns: int, stamp_ns: int) -> RingCloud:
        spec, rng = self._spec, draws(self._seed, Stream.RINGS, self._index)
        after_ns = np.arange(spec.beams, dtype=np.int64) * self._period_ns // spec.beams
        returns = cast_rings(self._caster, history, spec, self._directions, first_ns + after_ns)
        ranges = _measured(returns.distances_m.reshape(spec.beams, spec.rings), spec, rng)
        intensities = intensities_of(returns).reshape(ranges.shape)
        there = np.isfinite(ranges)
        beam, ring = np.nonzero(there)
        return RingCloud(
            stamp_ns=stamp_ns,
            frame_id=RINGS_FRAME,
            points_m=(ranges[there, None] * self._directions[beam, ring]).astype(np.float32),
            intensities=intensities[there].astype(np.float32),
            rings=ring.astype(np.int32),
            times_ns=after_ns[beam].astype(np.int32),
        )


def directions(spec: RingLidarSpec) -> Floats:
    """Unit vectors (beams, rings, 3) in the LiDAR's frame: beams turn left from straight ahead, rings from below."""
    azimuth = np.arange(spec.beams) * 2 * np.pi / spec.beams
    elevation = np.deg2rad(np.linspace(spec.lowest_deg, spec.highest_deg, spec.rings))
    level, up = np.cos(elevation), np.sin(elevation)
    unit = np.empty((spec.beams, spec.rings, 3))
    unit[..., 0], unit[..., 1] = np.cos(azimuth)[:, None] * level, np.sin(azimuth)[:, None] * level
    unit[..., 2] = up
    return unit


def cast_rings(
    caster: RingCaster, history: History, spec: RingLidarSpec, unit: Floats, times_ns: NDArray[np.int64]
) -> Returns:
    """What the beams (beams, rings) meet first, each at its beam's time (beams,), as one row after the other."""
    orientations = history.orientations(times_ns)
    mount = np.broadcast_to([0.0, 0.0, spec.height_m], (len(times_ns), 3))
    starts = history.positions(times_ns) + rotate(orientations, mount)
    rays = rotate(np.repeat(orientations, spec.rings, axis=0), unit.reshape(-1, 3)).reshape(unit.shape)
    reach_m = spec.range_max_m + 4 * spec.sigma_m
    return caster.returns(starts, rays, reach_m, spec.glass_deg, float(times_ns.mean()) / 1e9)


def _measured(distances: Floats, spec: RingLidarSpec, rng: np.random.Generator) -> Floats:
    """Ranges (beams, rings) from true distances, infinite where nothing comes back.

    A beam that is as wide as `divergence_mrad` meets an edge with the share of its width in the beams' distance, and
    then measures something between both sides. Rain returns some beams before they arrive.
    """
    spacing_rad = 2 * np.pi / spec.beams
    beside = np.roll(distances, -1, axis=0)
    near, far = np.minimum(distances, beside), np.maximum(distances, beside)
    edges = np.isfinite(far) & (far > near + _EDGE_M)
    mixed = edges & (rng.random(distances.shape) < spec.divergence_mrad * 1e-3 / spacing_rad)
    share = rng.random(distances.shape)
    ranges = distances.copy()
    ranges[mixed] = share[mixed] * distances[mixed] + (1 - share[mixed]) * beside[mixed]
    drops = rng.exponential(_RAIN_M, distances.shape)
    ranges = np.where((rng.random(distances.shape) < spec.rain) & (drops < ranges), drops, ranges)
    ranges = ranges + rng.normal(0.0, spec.sigma_m, distances.shape)
    lost = rng.random(distances.shape) < spec.dropout
    seen = (ranges >= spec.range_min_m) & (ranges <= spec.range_max_m) & ~lost
    return np.where(seen, ranges, np.inf)


def intensities_of(returns: Returns) -> Floats:
    """Intensities (N,) of 255 as the receiver gives them, distance taken out: material times cosine of the angle."""
    material = np.array([_REFLECTIVITY.get(name, _OTHERWISE) for name in returns.names])[returns.name_of]
    return 255 * np.clip(material * returns.cosines * _THROUGH**returns.passed, 0.0, 1.0)
