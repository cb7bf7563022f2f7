"""When sensors measure, and when what they measured is stamped and logged."""

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from mcap_landmarks_generator.randomness import Stream, draws
from mcap_landmarks_generator.sensor_specs import SensorSpec

_MOST_JITTER = 0.4
"""In periods: measurements must not overtake each other."""


def to_ns(seconds: float) -> int:
    """Whole nanoseconds."""
    return round(seconds * 1e9)


def regular_times(rate_hz: float, phase_s: float = 0.0) -> Iterator[int]:
    """Times in ns after the start, without end: phase + k / rate."""
    return (to_ns(phase_s + k / rate_hz) for k in itertools.count())


def measurement_times(sensor: SensorSpec, rng: np.random.Generator) -> Iterator[int]:
    """Regular times, each with the sensor's jitter, none before the start."""
    most_s = _MOST_JITTER / sensor.rate_hz
    for time_ns in regular_times(sensor.rate_hz, sensor.phase_s):
        jitter_s = float(np.clip(rng.normal(0.0, sensor.jitter_s), -most_s, most_s))
        yield max(0, time_ns + to_ns(jitter_s))


class Delivered(NamedTuple):
    """A message that arrives: its header's stamp, and when it is logged."""

    stamp_ns: int
    log_time_ns: int


class Delivery:
    """What becomes of the messages of one sensor on their way to the log, one after the other."""

    def __init__(self, spec: SensorSpec, seed: int, stream: Stream, start_ns: int) -> None:
        self._spec, self._start_ns, self._rng = spec, start_ns, draws(seed, stream)

    def of(self, begun_ns: int, lasts_ns: int = 0) -> Delivered | None:
        """A measurement that begins some time after the start and lasts a while; None if its message is lost."""
        spec = self._spec
        lost, late = self._rng.random(2) < (spec.dropped, spec.late)
        ahead_s = spec.latency_s + spec.clock_offset_s + spec.clock_drift_ppm * 1e-6 * begun_ns / 1e9
        behind_s = spec.latency_s + spec.delay_s + (spec.late_s if late else 0.0)
        begun = self._start_ns + begun_ns
        return None if lost else Delivered(begun + to_ns(ahead_s), begun + lasts_ns + to_ns(behind_s))
