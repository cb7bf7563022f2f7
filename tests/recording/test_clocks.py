"""Stamps that cannot be are found, and a clock that was set back goes on counting."""

import numpy as np
import pytest
from mcap_landmarks.recording.clocks import Times, clock_of, set_back, shifts_of, strays

SECOND = 10**9
LOG_NS: Times = 1_700_000_000 * SECOND + np.arange(60, dtype=np.int64) * SECOND // 10
STAMP_NS: Times = LOG_NS - 20_000_000


@pytest.mark.parametrize("row", [0, 1, 30, 58, 59])
@pytest.mark.parametrize("stamp_ns", [0, 5, STAMP_NS[30] + 86_400 * SECOND, STAMP_NS[30] - 60 * SECOND])
def test_one_stamp_that_cannot_be_is_found_wherever_it_is(row: int, stamp_ns: int) -> None:
    stamps_ns = STAMP_NS.copy()
    stamps_ns[row] = stamp_ns
    assert np.flatnonzero(strays(LOG_NS, stamps_ns)).tolist() == [row]
    clock = clock_of(LOG_NS, stamps_ns)
    assert clock.moment(int(LOG_NS[row]), stamp_ns) is None
    assert clock.moment(int(LOG_NS[20]), int(STAMP_NS[20])) == STAMP_NS[20]
    assert clock.delay_ns == 20_000_000


def test_stamps_that_nobody_sets_are_log_times() -> None:
    nothing = np.zeros_like(STAMP_NS)
    assert not strays(LOG_NS, nothing).any()
    assert clock_of(LOG_NS, nothing).moment(7 * SECOND, 0) == 7 * SECOND


def test_a_recorder_that_writes_late_makes_no_stamp_stray() -> None:
    """It catches up afterwards: log times lie close together, and stamps still are in order."""
    log_ns = LOG_NS.copy()
    log_ns[20:40] = log_ns[40]
    assert not strays(log_ns, STAMP_NS).any()
    assert not set_back(log_ns, STAMP_NS)


def test_simulated_time_is_no_error() -> None:
    assert not strays(LOG_NS, STAMP_NS - STAMP_NS[0] + SECOND).any()


@pytest.mark.parametrize("by_s", [1, 30, 86_400])
def test_a_clock_that_was_set_back_goes_on_counting(by_s: int) -> None:
    stamps_ns = STAMP_NS - np.where(np.arange(60) >= 25, by_s * SECOND, 0)
    shifts_ns, first_ns = shifts_of(LOG_NS, stamps_ns)
    assert (shifts_ns, first_ns) == ((0, by_s * SECOND), LOG_NS[25])
    clock = clock_of(LOG_NS, stamps_ns, shifts_ns, first_ns)
    moments = [clock.moment(*pair) for pair in zip(LOG_NS.tolist(), stamps_ns.tolist(), strict=True)]
    assert moments == STAMP_NS.tolist()


def test_two_programs_that_take_turns_set_no_clock_back() -> None:
    stamps_ns = STAMP_NS - np.where(np.arange(60) % 2, 2 * SECOND, 0)
    assert not set_back(LOG_NS, stamps_ns)
