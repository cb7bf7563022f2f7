"""How other libraries read and convert logs, for comparison only; each gives what it counted."""

from collections.abc import Callable
from pathlib import Path

import small_mcap
from mcap.reader import make_reader
from mcap_landmarks.recording.reader import open_recording
from mcap_ros2_support_fast import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

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


def decode_mcap_rosbags(path: Path, type_: str) -> int:
    """Read by the mcap package, decoded by rosbags' typestore."""
    store, count = get_typestore(Stores.ROS2_HUMBLE), 0
    with path.open("rb") as stream:
        for _, _, message in make_reader(stream).iter_messages():
            count += store.deserialize_cdr(message.data, type_).header.stamp.sec > 0
    return count


def decode_mcap_fast(path: Path, _type: str) -> int:
    """Read by the mcap package, decoded by mcap-ros2-support-fast."""
    count = 0
    with path.open("rb") as stream:
        for found in make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            count += found.decoded_message.header.stamp.sec > 0
    return count


def decode_small_fast(path: Path, _type: str) -> int:
    """Read by small-mcap, decoded by mcap-ros2-support-fast."""
    count = 0
    with path.open("rb") as stream:
        for found in small_mcap.read_message_decoded(stream, decoder_factories=[DecoderFactory()]):
            count += found.decoded_message.header.stamp.sec > 0
    return count


def decode_rosbags(path: Path, _type: str) -> int:
    """Read and decoded by rosbags."""
    count = 0
    with AnyReader([path]) as reader:
        for on, _, data in reader.messages():
            count += reader.deserialize(data, on.msgtype).header.stamp.sec > 0
    return count
