"""Columns are what reading message by message gives, however the messages lie and whatever the file says of them."""

import io
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, IndexType, Writer
from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.columns import Kind
from mcap_landmarks.messages.layout import Layout, layout_of
from mcap_landmarks.messages.parts import make
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.typestore import definition, typestore
from mcap_landmarks.recording.channel_columns import ChannelColumns
from mcap_landmarks.recording.reader import Recording, open_recording

from tests.recording import damages

SCAN = LaserScan.ROS_TYPE
SECOND = 10**9


@dataclass(frozen=True)
class Scan:
    """A message: when it is logged, its frame, how many beams it has, in which bytes."""

    topic: str
    time_ns: int
    frame: str
    beams: int
    little_endian: bool = True
    spoil: Callable[[bytes], bytes] = bytes


def data_of(scan: Scan, number: int) -> bytes:
    stamp = make("builtin_interfaces/Time", sec=number - 2, nanosec=number)
    ros = make(
        "sensor_msgs/LaserScan",
        header=make("std_msgs/Header", stamp=stamp, frame_id=scan.frame),
        angle_min=0.5 + number,
        angle_max=1.5,
        angle_increment=0.1,
        time_increment=0.0,
        scan_time=0.1,
        range_min=0.2,
        range_max=9.0,
        ranges=np.arange(scan.beams, dtype=np.float32) + number,
        intensities=np.arange(scan.beams // 2, dtype=np.float32) - number,
    )
    return scan.spoil(bytes(typestore().serialize_cdr(ros, SCAN, little_endian=scan.little_endian)))


def log_of(
    scans: list[Scan],
    compression: CompressionType = CompressionType.NONE,
    index: IndexType = IndexType.ALL,
    chunk_size: int = 2000,
) -> bytes:
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size, compression, index, use_chunking=chunk_size > 0)
    writer.start("ros2", "test")
    schema = writer.register_schema(SCAN, "ros2msg", definition(SCAN).encode())
    channels: dict[str, int] = {}
    for number, scan in enumerate(scans):
        if scan.topic not in channels:
            channels[scan.topic] = writer.register_channel(scan.topic, "cdr", schema)
        writer.add_message(channels[scan.topic], scan.time_ns, data_of(scan, number), scan.time_ns + 7, number)
    writer.finish()
    return stream.getvalue()


def one_by_one(
    recording: Recording, layout: Layout, start_ns: int | None, end_ns: int | None
) -> list[tuple[object, ...]]:
    """What rosbags decodes of the messages on /scan, in their order."""
    rows = []
    for raw in recording.messages(recording.connections("/scan"), start_ns, end_ns):
        try:
            ros = typestore().deserialize_cdr(layout.in_little_endian(bytes(raw.data)), SCAN)
            layout.table([layout.in_little_endian(bytes(raw.data))])
        except Exception:  # noqa: BLE001, S112 - whatever rosbags says of spoilt bytes
            continue
        stamp, ranges, intensities = ros.header.stamp, ros.ranges.tolist(), ros.intensities.tolist()
        known = ros.header.frame_id.encode(), ros.angle_min, ranges, intensities
        rows.append((raw.log_time_ns, raw.publish_time_ns, stamp.sec * SECOND + stamp.nanosec, *known))
    return rows


def rows_of(found: ChannelColumns) -> list[tuple[object, ...]]:
    def lists(name: str) -> list[list[float]]:
        column = found.table.columns[name]
        assert column.counts is not None
        return [part[:, 0].tolist() for part in np.split(column.values, np.cumsum(column.counts)[:-1])][
            : len(column.counts)
        ]

    single = [
        found.table.columns[name].values[:, 0].tolist() for name in ("header.stamp", "header.frame_id", "angle_min")
    ]
    times = found.log_time_ns.tolist(), found.publish_time_ns.tolist()
    return list(zip(*times, *single, lists("ranges"), lists("intensities"), strict=True))


def read(path: Path, start_ns: int | None = None, end_ns: int | None = None) -> tuple[ChannelColumns, list[str]]:
    """The columns of /scan, held against what is read one by one, and the losses."""
    layout = layout_of(SCAN, definition(SCAN))
    with open_recording(path) as recording:
        found = recording.columns(recording.connections("/scan")[0], layout, None, start_ns, end_ns)
        losses = list(recording.losses)
    with open_recording(path) as recording:
        expected = one_by_one(recording, layout, start_ns, end_ns)
        assert rows_of(found) == expected
        assert losses == recording.losses
    return found, losses


def cut(data: bytes) -> bytes:
    return data[:-9]


def long(data: bytes) -> bytes:
    return data + bytes(8)


def strange(data: bytes) -> bytes:
    return b"\x00\x07" + data[2:]


def lying(data: bytes) -> bytes:
    """The frame is said to be longer than the message."""
    return data[:12] + struct.pack("<I", 2**31) + data[16:]


SCANS = st.builds(
    Scan,
    st.sampled_from(["/scan", "/scan", "/other"]),
    st.integers(0, 20).map(lambda seconds: seconds * SECOND),
    st.sampled_from(["", "a", "ab", "cd", "base_scan", "laser"]),
    st.sampled_from([0, 1, 4, 4, 4, 30]),
    st.sampled_from([True] * 8 + [False]),
    st.sampled_from([bytes] * 12 + [cut, long, strange, lying]),
)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(
    st.lists(SCANS, max_size=40).map(lambda scans: [Scan("/scan", 0, "first", 4), *scans]),
    st.sampled_from(list(CompressionType)),
    st.sampled_from([IndexType.ALL, IndexType.ALL, IndexType.NONE, IndexType.CHUNK]),
    st.sampled_from([0, 700, 100_000]),
    st.sampled_from([(None, None), (3 * SECOND, None), (SECOND, 9 * SECOND)]),
)
def test_columns_are_what_the_messages_say(
    tmp_path_factory: pytest.TempPathFactory,
    scans: list[Scan],
    compression: CompressionType,
    index: IndexType,
    chunk_size: int,
    span: tuple[int | None, int | None],
) -> None:
    path = tmp_path_factory.getbasetemp() / "columns.mcap"
    path.write_bytes(log_of(scans, compression, index, chunk_size))
    found, losses = read(path, *span)
    assert losses == []
    first, last = span[0] or 0, span[1] or 2**64
    own = sum(scan.topic == "/scan" and first <= scan.time_ns < last for scan in scans)
    assert len(found.log_time_ns) + found.broken == own


def test_of_many_layouts_all_are_read(tmp_path: Path) -> None:
    """More than are gathered: the others are read one by one, and all come in their order."""
    path = tmp_path / "a.mcap"
    path.write_bytes(log_of([Scan("/scan", i * SECOND, "x" * (i % 50), 4) for i in range(150)], chunk_size=100_000))
    assert len(read(path)[0].log_time_ns) == 150


def test_only_what_is_asked_for_is_gathered(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(log_of([Scan("/scan", 5, "base_scan", 3)]))
    with open_recording(path) as recording:
        (connection,) = recording.connections("/scan")
        layout = layout_of(SCAN, connection.schema.decode())
        found = recording.columns(connection, layout, ["ranges", "header.stamp"])
        assert {name: column.kind for name, column in found.table.columns.items()} == {
            "header.stamp": Kind.TIME,
            "ranges": Kind.NUMBER,
        }
        with pytest.raises(MessageError, match=r"sensor_msgs/msg/LaserScan has no field 'range'"):
            recording.columns(connection, layout, ["range"])


@pytest.mark.parametrize("entry", ["another", "twice", "nowhere", "none"])
def test_a_wrong_message_index_costs_nothing(tmp_path: Path, entry: str) -> None:
    """One that names no message, another one, or one twice is not believed: the chunk's records are."""
    data = bytearray(log_of([Scan(("/scan", "/other")[i % 3 == 2], i, "base_scan", 4) for i in range(40)]))
    places = damages.of_kind(bytes(data), damages.MESSAGE_INDEX)
    first = places[0].start + 9 + 6
    wrong = {"another": bytes(data[places[1].start + 23 :][:8]), "twice": bytes(data[first + 24 : first + 32])}
    wrong |= {"nowhere": struct.pack("<Q", 10**6), "none": struct.pack("<Q", 5)}
    data[first + 8 : first + 16] = wrong[entry]
    (tmp_path / "a.mcap").write_bytes(data)
    found, losses = read(tmp_path / "a.mcap")
    assert (len(found.log_time_ns), losses) == (27, [])


def test_a_damaged_chunk_is_told_and_the_others_are_read(tmp_path: Path) -> None:
    data = bytearray(log_of([Scan("/scan", i, "base_scan", 4) for i in range(60)]))
    chunk = damages.of_kind(bytes(data), damages.CHUNK)[1]
    data[chunk.end - 3] ^= 1
    (tmp_path / "a.mcap").write_bytes(data)
    found, (loss,) = read(tmp_path / "a.mcap")
    assert 0 < len(found.log_time_ns) < 60
    assert loss.endswith("messages are left out")


def test_chunks_of_messages_of_one_size_are_read_by_their_step(tmp_path: Path) -> None:
    """Only those of one channel: others lie between its messages, or one is of another size."""
    alike = [Scan("/scan", i * SECOND, "base_scan", 30) for i in range(40)]
    logs = {
        "alike": alike,
        "odd": [*alike[:20], Scan("/scan", 20 * SECOND, "base_scan", 4), *alike[21:]],
        "mixed": [*alike[:20], Scan("/other", 20 * SECOND, "base_scan", 30), *alike[21:]],
        "strange": [*alike[:20], Scan("/scan", 20 * SECOND, "base_scan", 30, spoil=strange), *alike[21:]],
    }
    broken = {}
    for name, scans in logs.items():
        path = tmp_path / f"{name}.mcap"
        path.write_bytes(log_of(scans, index=IndexType.NONE | IndexType.CHUNK, chunk_size=100_000))
        broken[name] = read(path)[0].broken
    assert broken == {"alike": 0, "odd": 0, "mixed": 0, "strange": 1}
