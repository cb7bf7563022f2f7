"""How other libraries read and convert logs, for comparison only; each gives what it counted."""

from collections.abc import Callable
from pathlib import Path

import small_mcap
from mcap.reader import make_reader
from mcap_landmarks.recording.reader import open_recording
from rosbags.highlevel import AnyReader

Read = Callable[[Path], int]
"""Reads all messages of a file; their number."""


def read_ours(path: Path) -> int:
    """By the toolkit: in the order of time, with CRCs."""
    count = 0
    with open_recording(path) as recording:
        for message in recording.messages():
            count += message.log_time_ns > 0
    return count


def read_mcap(path: Path, *, crcs: bool = False) -> int:
    """By the mcap package."""
    count = 0
    with path.open("rb") as stream:
        for _, _, message in make_reader(stream, validate_crcs=crcs).iter_messages():
            count += message.log_time > 0
    return count


def read_mcap_with_crcs(path: Path) -> int:
    """By the mcap package, which checks what it reads."""
    return read_mcap(path, crcs=True)


def read_small_mcap(path: Path) -> int:
    """By small-mcap, with CRCs."""
    count = 0
    with path.open("rb") as stream:
        for _, _, message in small_mcap.read_message(stream, validate_crc=True):
            count += message.log_time > 0
    return count


def read_rosbags(path: Path) -> int:
    """By rosbags, which checks no CRCs."""
    count = 0
    with AnyReader([path]) as reader:
        for _, time_ns, _ in reader.messages():
            count += time_ns > 0
    return count
