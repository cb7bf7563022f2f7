"""Whether odometry and a sensor show the same motion at the same time, and which option puts it right if not."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from mcap_landmarks.estimation.clock_offset import ClockOffset, Turns, clock_offset
from mcap_landmarks.inspection.finding import Finding
from mcap_landmarks.inspection.sensor_mounts import Mount
from mcap_landmarks.inspection.turn_samples import (
    Read,
    SampledOdometry,
    SensorTurns,
    most_and_least_turning,
    read_turns,
    stretches,
)
from mcap_landmarks.moments import moment
from mcap_landmarks.stage import Connection

LEAST_BEARING_RAD = 0.01
"""The sigma of bearings that maps are built with where a log tells none (`mapping.config`)."""
_HARMFUL = 3.0
"""An offset costs results where it turns what is seen by more than so many sigmas of a bearing. Measured on the demo's
objects (0.44 rad/s): 0.05 s, or 2 sigmas, change nothing; 0.1 s, or 4, make four landmarks that are not there."""
_SURE = 3.0
_CLEAR_RAD = 0.5
_STILL_RAD = 0.05
_AROUND_NS = 2 * 10**9
"""A sensor clearly turns by half a radian, ten times the noise that matching adds up meanwhile; odometry stands still
if it turns by less than a tenth of it from 2 s before to 2 s after, whatever its clock."""
_AGAIN_S = 0.1
"""Odometry that is farther off tells the way between two messages too badly for it to count."""
_SILENCE = "--time-offset odometry=0 takes it as it is"


@dataclass(frozen=True, slots=True)
class Sight:
    """A sensor that sees how the robot turns: its role, its connection, and how it is mounted."""

    role: str
    connection: Connection
    mount: Mount


@dataclass(frozen=True, slots=True)
class Comparison:
    """What odometry on one topic and a sensor on another say of each other.

    `offset` is None where the data do not determine it; it is that of the negative turn if `is_reversed`. `rate_radps`
    is the root mean square turn rate, `bearing_rad` the sigma of a bearing. `still_ns` are log times from and to which
    odometry stood still while the sensor turned. `blamed` is whose stamps are off, by the log times.
    """

    odometry: str
    sensor: str
    role: str
    offset: ClockOffset | None
    is_reversed: bool
    rate_radps: float
    bearing_rad: float
    still_ns: tuple[tuple[int, int], ...]
    blamed: str

    @property
    def is_harmful(self) -> bool:
        """Whether the offset surely costs results."""
        if self.offset is None:
            return False
        least_s = abs(self.offset.offset_s) - _SURE * self.offset.sigma_s
        return least_s * self.rate_radps > _HARMFUL * self.bearing_rad


def compare(
    read: Read, span: tuple[int, int], topic: str, track: SampledOdometry, sights: Sequence[Sight]
) -> list[Comparison]:
    """Odometry on a topic against each of some sensors in the span of log times."""
    chosen = most_and_least_turning(track, stretches(*span))
    return [_compared(read, chosen, topic, track, sight) for sight in sights]


def _compared(
    read: Read, spans: Sequence[tuple[int, int]], topic: str, track: SampledOdometry, sight: Sight
) -> Comparison:
    seen = read_turns(read, sight.connection, spans, track, sight.mount)
    turns, sensor = seen.turns, sight.connection.topic
    offset, is_reversed = clock_offset(turns, track.headings), False
    if offset is not None and abs(offset.offset_s) > _AGAIN_S:  # the way between two messages is known better now
        track = replace(track, stamps_ns=track.stamps_ns - round(offset.offset_s * 1e9))
        seen = read_turns(read, sight.connection, spans, track, sight.mount)
        rest = clock_offset(seen.turns, track.headings)
        offset = rest and replace(rest, offset_s=offset.offset_s + rest.offset_s)
    if offset is None:
        offset = clock_offset(replace(turns, turned_rad=-turns.turned_rad), track.headings)
        is_reversed = offset is not None
    seconds = (turns.ends_ns - turns.starts_ns) * 1e-9
    rate = float(np.sqrt(np.square(turns.turned_rad).sum() / np.square(seconds).sum())) if len(turns) else 0.0
    blamed = topic if offset is None else _blamed(topic, sensor, track, seen, offset.offset_s)
    still = _stillness(turns, track)
    bearing = max(seen.bearing_rad, LEAST_BEARING_RAD)
    return Comparison(topic, sensor, sight.role, offset, is_reversed, rate, bearing, still, blamed)


def _blamed(odometry: str, sensor: str, track: SampledOdometry, seen: SensorTurns, offset_s: float) -> str:
    """The topic whose stamps are off by log times; odometry where these do not tell."""
    delays = abs(seen.delay_ns) - abs(track.delay_ns)
    return sensor if delays > abs(offset_s) * 1e9 / 2 else odometry


def _stillness(turns: Turns, track: SampledOdometry) -> tuple[tuple[int, int], ...]:
    """From and to which log times a sensor clearly turned while odometry stood still."""
    total = np.concatenate([[0.0], np.cumsum(turns.turned_rad)])
    spans: list[tuple[int, int]] = []
    breaks = np.flatnonzero(np.diff(turns.starts_ns) > _AROUND_NS) + 1
    for first, end in pairwise([0, *breaks, len(turns)]):
        for i in range(first, end):
            far = np.flatnonzero(np.abs(total[i + 1 : end + 1] - total[i]) >= _CLEAR_RAD)
            if not len(far):
                break
            span = int(turns.starts_ns[i]), int(turns.ends_ns[i + far[0]])
            if _stands(track, *span):
                joined = spans and span[0] <= spans[-1][1]
                spans[-1:] = [(spans[-1][0], span[1])] if joined else [*spans[-1:], span]
    delay_ns = round(track.delay_ns)
    return tuple((start_ns + delay_ns, end_ns + delay_ns) for start_ns, end_ns in spans)


def _stands(track: SampledOdometry, start_ns: int, end_ns: int) -> bool:
    """Whether odometry stands still around two times, as messages without a gap say."""
    left, right = np.searchsorted(track.stamps_ns, [start_ns - _AROUND_NS, end_ns + _AROUND_NS])
    stamps_ns = track.stamps_ns[left:right]
    if not len(stamps_ns) or stamps_ns[0] > start_ns or stamps_ns[-1] < end_ns:
        return False
    has_gap = len(stamps_ns) > 1 and int(np.diff(stamps_ns).max()) > _AROUND_NS
    return not has_gap and float(np.ptp(track.poses[left:right, 2])) < _STILL_RAD


def clock_findings(compared: Sequence[Comparison], silenced: Mapping[str, int] | None = None) -> Iterator[Finding]:
    """What is wrong between clocks, or with what odometry says; nothing of a role that has an offset already."""
    for one in compared:
        if silenced and {"odometry", one.role} & {*silenced}:
            continue
        if one.still_ns:
            yield _standing(one)
        elif one.is_reversed:
            text = f"it turns to the other side than {one.sensor} does"
            remedy = "correct the sign of its turn, or where the sensor sits (--extrinsics)"
            yield Finding("problem", "clock", one.odometry, text, f"{remedy}; {_SILENCE}")
        elif one.is_harmful and one.offset is not None:
            yield _apart(one, one.offset)


def _standing(one: Comparison) -> Finding:
    (start_ns, end_ns), more = one.still_ns[0], len(one.still_ns) - 1
    others = f" and {more} times more" if more else ""
    text = f"it stands still from {moment(start_ns)} to {moment(end_ns)}{others} while {one.sensor} turns"
    remedy = "record odometry that follows the robot, or cut the log with --end before or --start after"
    return Finding("problem", "clock", one.odometry, text, f"{remedy}; {_SILENCE}")


def _apart(one: Comparison, offset: ClockOffset) -> Finding:
    is_sensor = one.blamed == one.sensor
    late_s = -offset.offset_s if is_sensor else offset.offset_s
    far = f"{abs(late_s):.3f} s (+- {offset.sigma_s:.3f}) {'late' if late_s > 0 else 'early'}"
    text = f"its stamps are {far} against {one.sensor}"
    if is_sensor:
        text = f"the stamps of {one.sensor} are {far} against its own"
    remedy = f"give --time-offset {one.role if is_sensor else 'odometry'}={-late_s:+.3f}"
    return Finding("problem", "clock", one.odometry, text, f"{remedy}, or synchronise the clocks and record anew")
