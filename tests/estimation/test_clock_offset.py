"""The offset between two clocks is found where turning tells it, with an honest sigma, and left open elsewhere."""

import numpy as np
import pytest
from mcap_landmarks.estimation.clock_offset import Headings, Turns, clock_offset
from mcap_landmarks.geometry.se2 import Array

SECOND = 10**9
START_NS = 1_700_000_000 * SECOND
NOISE_RAD = 0.005


def drive(times_s: Array) -> Array:
    """The heading of a robot that turns this way and that, never twice alike."""
    return 0.8 * np.sin(0.9 * times_s) + 0.5 * np.sin(1.7 * times_s + 1.0) + 0.2 * np.sin(4.1 * times_s)


def turns(heading: Array, times_s: Array, rng: np.random.Generator, noise_rad: float = NOISE_RAD) -> Turns:
    stamps = START_NS + np.round(times_s * SECOND).astype(np.int64)
    return Turns(stamps[:-1], stamps[1:], np.diff(heading) + rng.normal(0, noise_rad, len(stamps) - 1))


def headings(heading: Array, times_s: Array, late_s: float = 0.0) -> Headings:
    return Headings(START_NS + np.round((times_s + late_s) * SECOND).astype(np.int64), heading)


SCANS_S, ODOMETRY_S = np.arange(3.0, 37.0, 0.2), np.arange(0.0, 40.0, 0.05)


@pytest.mark.parametrize("late_s", [-1.0, -0.5, -0.05, 0.0, 0.1, 0.2, 0.5, 1.0])
def test_offsets_are_found(late_s: float) -> None:
    seen = turns(drive(SCANS_S), SCANS_S, np.random.default_rng(1))
    found = clock_offset(seen, headings(0.9 * drive(ODOMETRY_S), ODOMETRY_S, late_s))
    assert found is not None
    assert found.offset_s == pytest.approx(late_s, abs=4 * found.sigma_s)
    assert found.sigma_s < 0.01
    assert found.slope == pytest.approx(1 / 0.9, abs=0.02)
    assert found.alike > 0.98


def test_the_sigma_is_that_of_the_errors() -> None:
    known = headings(drive(ODOMETRY_S), ODOMETRY_S, 0.3)
    errors = []
    for seed in range(60):
        found = clock_offset(turns(drive(SCANS_S), SCANS_S, np.random.default_rng(seed), 0.02), known)
        assert found is not None
        errors.append((found.offset_s - 0.3) / found.sigma_s)
    assert 0.7 < np.sqrt(np.mean(np.square(errors))) < 1.3


def test_one_wrong_turn_in_twenty_does_not_matter() -> None:
    rng = np.random.default_rng(3)
    seen = turns(drive(SCANS_S), SCANS_S, rng)
    wrong = rng.random(len(seen)) < 0.05
    seen.turned_rad[wrong] += rng.normal(0, 0.2, int(wrong.sum()))
    found = clock_offset(seen, headings(drive(ODOMETRY_S), ODOMETRY_S, 0.2))
    assert found is not None
    assert found.offset_s == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize("period_s", [0.1, 0.2, 0.5])
def test_slow_odometry_is_enough(period_s: float) -> None:
    times = np.arange(0.0, 40.0, period_s)
    found = clock_offset(turns(drive(SCANS_S), SCANS_S, np.random.default_rng(4)), headings(drive(times), times, 0.5))
    assert found is not None
    assert found.offset_s == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize(
    ("seen", "known"),
    [
        (np.zeros(len(SCANS_S)), np.zeros(len(ODOMETRY_S))),
        (0.3 * SCANS_S, 0.3 * ODOMETRY_S),
        (0.3 * np.sin(2 * np.pi * SCANS_S), 0.3 * np.sin(2 * np.pi * ODOMETRY_S)),
        (drive(SCANS_S), drive(300 - 2 * ODOMETRY_S)),
        (drive(SCANS_S), np.zeros(len(ODOMETRY_S))),
        (drive(SCANS_S), -drive(ODOMETRY_S)),
    ],
    ids=["standing", "turning evenly", "the same turn every second", "another drive", "frozen", "the other way"],
)
def test_what_does_not_tell_is_left_open(seen: Array, known: Array) -> None:
    assert clock_offset(turns(seen, SCANS_S, np.random.default_rng(5)), headings(known, ODOMETRY_S)) is None


def test_offsets_beyond_the_window_are_left_to_log_times() -> None:
    seen = turns(drive(SCANS_S), SCANS_S, np.random.default_rng(6))
    assert clock_offset(seen, headings(drive(ODOMETRY_S), ODOMETRY_S, 3.0)) is None


def test_nothing_is_read_into_gaps() -> None:
    times = np.concatenate([ODOMETRY_S[ODOMETRY_S < 12], ODOMETRY_S[ODOMETRY_S > 16]])
    found = clock_offset(turns(drive(SCANS_S), SCANS_S, np.random.default_rng(7)), headings(drive(times), times, -0.2))
    assert found is not None
    assert found.offset_s == pytest.approx(-0.2, abs=0.01)
