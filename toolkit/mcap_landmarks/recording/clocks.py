"""Which header stamps of a topic to believe: stray ones are found, and clocks that were set back go on counting.

Stamps are held against log times, which only rise. The difference, a topic's delay, hardly changes from message to
message, whatever clock the stamps are of.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Times = NDArray[np.int64]

_AROUND = 11
"""A delay is held against the median of so many: up to five stray stamps in a row show."""
_OFF_S = 0.5
"""Delays vary by less than this, but where a recorder writes late; then stamps still are in order."""
_FAR_OFF_S = 5.0
"""The first and last stamps of a log have a neighbour on one side only: they are stray if they are so far off."""
_BACK_S = 0.25
"""A clock that was set back by less costs as much of a log as it was set back."""
_MANY = 0.5
"""Where more stamps than this share are zero, the driver sets none, and log times stand in."""


@dataclass(frozen=True, slots=True)
class Clock:
    """The stamps of one topic: log time and stamp of the stray ones, and what has to be added after each setting back.

    `shifts_ns` rise and begin with 0; `delay_ns` is the topic's usual delay before the first. `offset_ns` is what the
    user adds to all stamps.
    """

    strays: frozenset[tuple[int, int]] = frozenset()
    shifts_ns: tuple[int, ...] = (0,)
    delay_ns: int = 0
    offset_ns: int = 0

    def is_plain(self, stamp_ns: int) -> bool:
        """Whether there is nothing to correct in a stamp; one of zero stays, so that log times stand in."""
        return not (self.strays or self.offset_ns) and (len(self.shifts_ns) == 1 or not stamp_ns)

    def moment(self, log_time_ns: int, stamp_ns: int) -> int | None:
        """The time of a message: its stamp as if the clock had never been set back, None where it is stray.

        Log times stand in for stamps of zero.
        """
        if (log_time_ns, stamp_ns) in self.strays:
            return None
        return (stamp_ns or log_time_ns) + self.shift_ns(log_time_ns, stamp_ns) + self.offset_ns

    def shift_ns(self, log_time_ns: int, stamp_ns: int) -> int:
        """How far the clock had been set back when a message was stamped."""
        if len(self.shifts_ns) == 1 or not stamp_ns:
            return 0
        late_ns = log_time_ns - stamp_ns - self.delay_ns
        return min(self.shifts_ns, key=lambda shift_ns: abs(late_ns - shift_ns))


def strays(log_ns: Times, stamp_ns: Times) -> NDArray[np.bool_]:
    """Which of some messages (N,), by log time, have a stamp that cannot be: zero, or far before or after the others'.

    Where most stamps are zero none of those is stray: nobody sets them, and log times stand in.
    """
    zero = stamp_ns == 0
    found, rows = zero & (zero.sum() <= _MANY * len(zero)), np.flatnonzero(~zero)
    if len(rows) > 2:
        found[rows] = _astray(log_ns[rows], stamp_ns[rows])
    return np.asarray(found)


def _astray(log_ns: Times, stamp_ns: Times) -> NDArray[np.bool_]:
    delay_s = delays_s(log_ns, stamp_ns)
    size = min(_AROUND, len(delay_s) - 1 + len(delay_s) % 2)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(delay_s, size // 2, mode="symmetric"), size)
    off_s = np.abs(delay_s - np.median(around, axis=1))
    suspect = off_s > _OFF_S
    if not suspect.any():
        return suspect
    good = np.flatnonzero(~suspect)
    after = np.searchsorted(good, np.arange(len(delay_s)), side="left")
    low, high = np.int64(-(2**63)), np.int64(2**63 - 1)
    before_ns = np.where(after > 0, stamp_ns[good[np.maximum(after - 1, 0)]], low)
    after_ns = np.where(after < len(good), stamp_ns[good[np.minimum(after, len(good) - 1)]], high)
    out_of_order = (stamp_ns < before_ns) | (stamp_ns > after_ns)
    at_an_end = ((after == 0) | (after == len(good))) & (off_s > _FAR_OFF_S)
    found: NDArray[np.bool_] = suspect & (out_of_order | at_an_end)
    return found


def delays_s(log_ns: Times, stamp_ns: Times) -> NDArray[np.float64]:
    """How much later than stamped messages (N,) were logged, in s, relative to the first."""
    late = log_ns - stamp_ns
    found: NDArray[np.float64] = (late - late[:1]) / 1e9
    return found


def set_back(log_ns: Times, stamp_ns: Times) -> list[tuple[int, int]]:
    """Where a clock was set back: (log time of the first message after, by how many ns), of stamps that are not stray.

    A loop of a player is that, and a simulation or computer that starts again.
    """
    if len(stamp_ns) < 2:
        return []
    found, delay_s = [], delays_s(log_ns, stamp_ns)
    for i in np.flatnonzero(np.diff(stamp_ns) < -_BACK_S * 1e9) + 1:
        before, after = delay_s[max(i - _AROUND + 1, 0) : i], delay_s[i : i + _AROUND - 1]
        # Quartiles: where two programs take turns half of the delays on either side are those of the other side.
        if np.quantile(after, 0.25) - np.quantile(before, 0.75) > _BACK_S:
            found.append((int(log_ns[i]), round(float(np.median(after) - np.median(before)) * 1e9)))
    return found


def shifts_of(log_ns: Times, stamp_ns: Times) -> tuple[tuple[int, ...], int | None]:
    """How far a clock was set back by and by, from 0 on, and the log time of the first time; of messages (N,)."""
    good = ~strays(log_ns, stamp_ns) & (stamp_ns != 0)
    backs = set_back(log_ns[good], stamp_ns[good])
    shifts = np.cumsum([0, *(by_ns for _, by_ns in backs)])
    return tuple(shifts.tolist()), backs[0][0] if backs else None


def clock_of(log_ns: Times, stamp_ns: Times, shifts_ns: tuple[int, ...] = (0,), first_ns: int | None = None) -> Clock:
    """The clock of a topic's messages (N,): `shifts_ns` are those of the log, `first_ns` the log time of the first."""
    bad = strays(log_ns, stamp_ns)
    pairs = frozenset(zip(log_ns[bad].tolist(), stamp_ns[bad].tolist(), strict=True))
    before = ~bad & (stamp_ns != 0) & (log_ns < (first_ns if first_ns is not None else np.int64(2**63 - 1)))
    delay_ns = int(np.median(log_ns[before] - stamp_ns[before])) if before.any() else 0
    return Clock(pairs, shifts_ns, delay_ns)
