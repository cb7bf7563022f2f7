"""Logs as tuples of messages: where messages of a channel lie, and the log with some of them changed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from mcap_landmarks.channels import CAMERA_INFO, DETECTIONS, ODOMETRY, SCAN
from mcap_landmarks.messages.codec import M, Message, decode, encode
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.stage import Channel, RawMessage

SECOND_NS = 10**9
Log = tuple[RawMessage, ...]
"""The messages of a log by log time."""
Change = Callable[[Log, np.random.Generator], Log]

Sensed = Odometry | LaserScan | Detections | CameraInfo
STAMPED: tuple[Channel[Message], ...] = (ODOMETRY, SCAN, DETECTIONS)
SENSORS: Mapping[str, Channel[Sensed]] = {
    channel.topic: channel for channel in (ODOMETRY, SCAN, DETECTIONS, CAMERA_INFO)
}


def rows_of(log: Log, channel: Channel[Message]) -> list[int]:
    """The rows of a channel's messages."""
    return [i for i, raw in enumerate(log) if raw.connection.topic == channel.topic]


def one_row(log: Log, channel: Channel[Message], rng: np.random.Generator, margin: int = 0) -> int:
    """The row of a random message of a channel, but of its first and last few."""
    rows = rows_of(log, channel)
    return rows[int(rng.integers(margin, len(rows) - margin))]


def changed(raw: RawMessage, channel: Channel[M], change: Callable[[M], Message]) -> RawMessage:
    """A message of a channel changed."""
    return raw._replace(data=encode(change(decode(channel.message, raw.data))))


def with_message(log: Log, row: int, raw: RawMessage) -> Log:
    """The log with one message in another's place."""
    return (*log[:row], raw, *log[row + 1 :])


def by_time(messages: Sequence[RawMessage]) -> Log:
    """A log of messages in any order; those of equal times keep theirs."""
    return tuple(sorted(messages, key=lambda raw: raw.log_time_ns))


def moment_in(log: Log, rng: np.random.Generator, low: float, high: float) -> int:
    """A log time at some share of the log."""
    first_ns, last_ns = log[0].log_time_ns, log[-1].log_time_ns
    return first_ns + round(rng.uniform(low, high) * (last_ns - first_ns))


def stretch_of_time(log: Log, rng: np.random.Generator, seconds: tuple[float, float]) -> tuple[int, int]:
    """A stretch of log time of so many seconds, as rows from the first and before the last."""
    length_ns = round(rng.uniform(*seconds) * SECOND_NS)
    first_ns = moment_in(log, rng, 0.1, 0.9)
    times_ns = [raw.log_time_ns for raw in log]
    first, last = np.searchsorted(times_ns, [first_ns, first_ns + length_ns])
    return int(first), int(last)


def without(
    log: Log, rng: np.random.Generator, channels: Sequence[Channel[Message]], seconds: tuple[float, float]
) -> Log:
    """The log without what some channels have in a random stretch of so many seconds."""
    first, last = stretch_of_time(log, rng, seconds)
    topics = {channel.topic for channel in channels}
    return tuple(raw for i, raw in enumerate(log) if not (first <= i < last and raw.connection.topic in topics))


def stamped(raw: RawMessage, stamp: Callable[[int], int]) -> RawMessage:
    """A message of a sensor with another stamp."""
    return changed(raw, SENSORS[raw.connection.topic], lambda one: replace(one, stamp_ns=stamp(one.stamp_ns)))


def any_of(channels: Sequence[Channel[Message]], rng: np.random.Generator) -> Channel[Message]:
    """A random channel."""
    return channels[int(rng.integers(len(channels)))]
