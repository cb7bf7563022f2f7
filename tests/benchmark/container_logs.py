"""The logs that the benchmark of the container reads: made here from seeds, and written by others' writers, too."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.codec import Message, encode
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.qos import KEY, qos_profile
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.messages.typestore import definition, typestore
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Connection, RawMessage
from numpy.typing import NDArray
from rosbags.interfaces import Connection as BagConnection
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as FolderWriter

START_NS = 1_700_000_000 * 10**9
_IMAGE_BYTES, _BEAMS = 200_000, 360
_RNG_SEED = 15


def connection(topic: str, message: type[Message]) -> Connection:
    """The connection of a topic with messages of ours."""
    metadata = {KEY: qos_profile(latched=False)}
    return Connection(topic, message.ROS_TYPE, definition(message.ROS_TYPE).encode(), metadata=metadata)


def raw(on: Connection, time_ns: int, sequence: int, message: Message) -> RawMessage:
    """A message as it lies in a log; it was published a little before it was logged."""
    return RawMessage(on, time_ns, time_ns - 100_000, sequence, encode(message))


def odometry(count: int, rate_hz: int = 50) -> Iterator[RawMessage]:
    """A robot that drives in circles."""
    on, step_ns, noise = connection("/odom", Odometry), 10**9 // rate_hz, _noise(count)
    for i in range(count):
        time_ns = START_NS + i * step_ns
        pose = np.array([np.cos(i / 300), np.sin(i / 300), i / 300 % 6]) + noise[i]
        yield raw(
            on, time_ns, i, Odometry.planar(time_ns, ("odom", "base_footprint"), pose, np.diag([0.01, 0.01, 0.1]))
        )


def transforms(count: int, rate_hz: int = 50) -> Iterator[RawMessage]:
    """The same as transforms."""
    on, step_ns, noise = connection("/tf", TFMessage), 10**9 // rate_hz, _noise(count)
    for i in range(count):
        time_ns = START_NS + i * step_ns + 1_000_000
        step = Transform.planar(time_ns, ("odom", "base_footprint"), noise[i])
        yield raw(on, time_ns, i, TFMessage((step,)))


def scans(count: int, rate_hz: int = 10) -> Iterator[RawMessage]:
    """Scans of 360 beams with noise."""
    on, step_ns, rng = connection("/scan", LaserScan), 10**9 // rate_hz, np.random.default_rng(_RNG_SEED)
    ranges = rng.uniform(0.2, 12, (64, _BEAMS)).astype(np.float32)
    for i in range(count):
        time_ns = START_NS + i * step_ns + 2_000_000
        yield raw(on, time_ns, i, _scan(time_ns, ranges[i % 64]))


def images(count: int, rate_hz: int = 10) -> Iterator[RawMessage]:
    """Compressed images: bytes without structure, as JPEG's are."""
    on, step_ns, rng = connection("/camera/image_raw/compressed", CompressedImage), 10**9 // rate_hz, _rng()
    pool = rng.integers(0, 256, (16, _IMAGE_BYTES), dtype=np.uint8)
    for i in range(count):
        time_ns = START_NS + i * step_ns + 3_000_000
        yield raw(on, time_ns, i, CompressedImage(time_ns, "camera", "jpeg", pool[i % 16].tobytes()))


def by_time(*streams: Iterable[RawMessage]) -> list[RawMessage]:
    """All messages in the order of time."""
    return sorted((message for stream in streams for message in stream), key=lambda message: message.log_time_ns)


def write_ours(path: Path, messages: Iterable[RawMessage]) -> Path:
    """Written by the toolkit."""
    with create_recording(path) as writer:
        for message in messages:
            writer.write(message)
    return path


def write_mcap(path: Path, messages: Iterable[RawMessage], compression: CompressionType) -> Path:
    """Written by the mcap package, all topics in the same chunks, as recorders do."""
    channels: dict[Connection, int] = {}
    with path.open("wb") as stream:
        writer = Writer(stream, compression=compression, enable_crcs=True)
        writer.start("ros2", "benchmark")
        for message in messages:
            on = message.connection
            if on not in channels:
                schema = writer.register_schema(on.message_type, on.schema_encoding, on.schema)
                channels[on] = writer.register_channel(on.topic, on.message_encoding, schema, dict(on.metadata))
            writer.add_message(
                channels[on], message.log_time_ns, message.data, message.publish_time_ns, message.sequence
            )
        writer.finish()
    return path


def write_bag(path: Path, messages: Iterable[RawMessage]) -> Path:
    """Written by rosbags as a bag of ROS 1."""
    humble = typestore()
    with BagWriter(path) as writer:
        known: dict[Connection, BagConnection] = {}
        for message in messages:
            on = message.connection
            if on not in known:
                known[on] = writer.add_connection(on.topic, on.message_type, typestore=humble)
            writer.write(known[on], message.log_time_ns, humble.cdr_to_ros1(message.data, on.message_type))
    return path


def write_db3(path: Path, messages: Iterable[RawMessage], *, is_compressed: bool = False) -> Path:
    """Written by rosbags as a folder with a file of SQLite, each message compressed with zstd if wanted."""
    humble = typestore()
    writer = FolderWriter(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
    if is_compressed:
        writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        known: dict[Connection, BagConnection] = {}
        for message in messages:
            on = message.connection
            if on not in known:
                known[on] = writer.add_connection(on.topic, on.message_type, typestore=humble)
            writer.write(known[on], message.log_time_ns, message.data)
    return path


def _scan(time_ns: int, ranges: NDArray[np.float32]) -> LaserScan:
    step = 2 * np.pi / len(ranges)
    return LaserScan(time_ns, "base_scan", 0.0, 2 * np.pi - step, step, 0.0, 0.1, 0.1, 12.0, ranges, ranges)


def _noise(count: int) -> Array:
    return _rng().normal(0, 1e-3, (count, 3))


def _rng() -> np.random.Generator:
    return np.random.default_rng(_RNG_SEED)
