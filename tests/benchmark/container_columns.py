"""How columns of odometry and scans are had with each library, for comparison only: all end with the same arrays."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import small_mcap
from mcap.reader import make_reader
from mcap_landmarks.messages.layout import layout_of
from mcap_landmarks.messages.typestore import typestore
from mcap_landmarks.recording.channel_columns import ChannelColumns
from mcap_landmarks.recording.reader import open_recording
from mcap_ros2_support_fast import DecoderFactory
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader

Arrays = tuple[NDArray[np.int64], NDArray[Any]]
"""Stamps (N,) and, of odometry, position, quaternion, linear and angular velocity (N, 13), of scans the ranges."""
Take = Callable[[Path], Arrays]
_NUMBERS = ("pose.pose.position", "pose.pose.orientation", "twist.twist.linear", "twist.twist.angular")


def odometry_readers() -> Mapping[str, Take]:
    """By the name of a library, how it reads odometry."""
    return {"ours": _our_odometry, **{name: _taken(read, _odometry) for name, read in _DECODED.items()}}


def scan_readers() -> Mapping[str, Take]:
    """By the name of a library, how it reads scans."""
    return {"ours": _our_scans, **{name: _taken(read, _scans) for name, read in _DECODED.items()}}


def _ours(path: Path, topic: str, fields: tuple[str, ...]) -> ChannelColumns:
    with open_recording(path) as recording:
        (connection,) = recording.connections(topic)
        layout = layout_of(connection.message_type, connection.schema.decode())
        return recording.columns(connection, layout, ("header.stamp", *fields))


def _our_odometry(path: Path) -> Arrays:
    columns = _ours(path, "/odom", _NUMBERS).table.columns
    return columns["header.stamp"].values[:, 0], np.hstack([columns[name].values for name in _NUMBERS])


def _our_scans(path: Path) -> Arrays:
    found = _ours(path, "/scan", ("ranges",)).table
    return found.columns["header.stamp"].values[:, 0], found.columns["ranges"].values.reshape(found.rows, -1)


def _taken(read: Callable[[Path], Iterable[Any]], take: Callable[[Iterable[Any]], Arrays]) -> Take:
    return lambda path: take(read(path))


def _odometry(messages: Iterable[Any]) -> Arrays:
    stamps, numbers = [], []
    for message in messages:
        stamp, pose, twist = message.header.stamp, message.pose.pose, message.twist.twist
        place, turn, linear, angular = pose.position, pose.orientation, twist.linear, twist.angular
        stamps.append(stamp.sec * 10**9 + stamp.nanosec)
        rotation = turn.x, turn.y, turn.z, turn.w
        numbers.append(
            (place.x, place.y, place.z, *rotation, linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
        )
    return np.array(stamps, dtype=np.int64), np.array(numbers)


def _scans(messages: Iterable[Any]) -> Arrays:
    stamps, ranges = [], []
    for message in messages:
        stamps.append(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
        ranges.append(message.ranges)
    return np.array(stamps, dtype=np.int64), np.array(ranges, dtype=np.float32)


def _mcap_fast(path: Path) -> Iterator[Any]:
    with path.open("rb") as stream:
        for found in make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            yield found.decoded_message


def _mcap_rosbags(path: Path) -> Iterator[Any]:
    store = typestore()
    with path.open("rb") as stream:
        for schema, _, message in make_reader(stream).iter_messages():
            if schema is not None:
                yield store.deserialize_cdr(message.data, schema.name)


def _small_mcap(path: Path) -> Iterator[Any]:
    with path.open("rb") as stream:
        for found in small_mcap.read_message_decoded(stream, decoder_factories=[DecoderFactory()]):
            yield found.decoded_message


def _rosbags(path: Path) -> Iterator[Any]:
    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            yield reader.deserialize(data, connection.msgtype)


_DECODED: Mapping[str, Callable[[Path], Iterable[Any]]] = {
    "small-mcap with mcap-ros2-support-fast": _small_mcap,
    "mcap with mcap-ros2-support-fast": _mcap_fast,
    "mcap with rosbags' deserializer": _mcap_rosbags,
    "rosbags": _rosbags,
}
