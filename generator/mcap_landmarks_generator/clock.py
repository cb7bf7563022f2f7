"""When sensors measure."""

import itertools
from collections.abc import Iterator

import numpy as np

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
