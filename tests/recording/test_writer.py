"""What the writer writes: readable by other tools, indexed, atomic, and the same bytes every time."""

import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_landmarks.channels import CAMERA_IMAGE, ODOMETRY, SCENE_OBJECTS
from mcap_landmarks.errors import RecordingError, ToolkitError, UsageError
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Connection, RawMessage, Stamped
from rosbags.highlevel import AnyReader

SECOND = 10**9


def write_log(path: Path, seconds: int = 12) -> None:
    """Odometry at 20 Hz and images at 5 Hz, with metadata."""
    with create_recording(path, {"mcap-landmarks.run": {"verb": "test"}}) as writer:
        for i in range(20 * seconds):
            now = i * SECOND // 20
            writer.add(Stamped(ODOMETRY, now, Odometry.planar(now, ("odom", "base"), (i, 0, 0), np.eye(3))))
            if i % 4 == 0:
                image = CompressedImage(now, "camera", "jpeg", bytes(1000))
                writer.add(Stamped(CAMERA_IMAGE, now, image))


def test_other_tools_read_it(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_log(path)
    with AnyReader([path]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        decoded = [reader.deserialize(data, connection.msgtype) for connection, _, data in reader.messages()]
    assert counts == {"/odom": 240, "/camera/image_raw/compressed": 60}
    assert len(decoded) == 300
    with path.open("rb") as stream:
        summary = make_reader(stream, validate_crcs=True).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == 300
    channel_of_images = next(c.id for c in summary.channels.values() if c.topic == CAMERA_IMAGE.topic)
    for chunk in summary.chunk_indexes:
        images = channel_of_images in chunk.message_index_offsets
        assert chunk.compression == ("" if images else "zstd")
        assert len(chunk.message_index_offsets) == 1
        assert chunk.message_end_time - chunk.message_start_time <= 5 * SECOND


def test_what_is_read_once_holds_the_same_and_is_compressed_quickly(tmp_path: Path) -> None:
    contents, forms = [], []
    for is_passing in (False, True):
        path = tmp_path / f"{is_passing}.mcap"
        with create_recording(path, is_passing=is_passing) as writer:
            for i in range(100):
                writer.add(Stamped(ODOMETRY, i, Odometry.planar(i, ("odom", "base"), (i, 0, 0), np.eye(3))))
        with open_recording(path) as recording:
            contents.append([(raw.log_time_ns, bytes(raw.data)) for raw in recording.messages()])
        with path.open("rb") as stream:
            summary = make_reader(stream, validate_crcs=True).get_summary()
        assert summary is not None
        forms.append({chunk.compression for chunk in summary.chunk_indexes})
    assert contents[0] == contents[1]
    assert forms == [{"zstd"}, {"lz4"}]


@pytest.mark.slow
def test_doctor_finds_nothing(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_log(path)
    doctor = Path(sys.executable).with_name("pymcap-cli")
    done = subprocess.run([doctor, "doctor", path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_same_content_same_bytes(tmp_path: Path) -> None:
    for name in "ab":
        write_log(tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_publish_time_sequence_and_payload_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    connection = Connection("/x", "std_msgs/msg/UInt8", b"uint8 data", metadata={"offered_qos_profiles": ""})
    raws = [RawMessage(connection, 10 + i, 3 + i, 70 - i, bytes([0, 1, 0, 0, i])) for i in range(5)]
    with create_recording(path) as writer:
        for raw in raws:
            writer.write(raw)
    with open_recording(path) as recording:
        found = [(m.log_time_ns, m.publish_time_ns, m.sequence, bytes(m.data)) for m in recording.messages()]
        assert recording.channels[0].connection.metadata == connection.metadata
    assert found == [tuple(raw[1:]) for raw in raws]


def test_topics_and_times_are_filtered(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_log(path)
    with open_recording(path) as recording:
        odometry = recording.connections(ODOMETRY.topic)
        times = [m.log_time_ns for m in recording.messages(odometry, 2 * SECOND, 4 * SECOND)]
        assert times == [i * SECOND // 20 for i in range(40, 80)]
        assert list(recording.messages(recording.connections("/nothing"))) == []
        everything = [m.log_time_ns for m in recording.messages()]
        assert everything == sorted(everything)
        assert (recording.start_ns, recording.end_ns) == (0, 239 * SECOND // 20)


def test_an_error_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_log(path, 1)
    before = path.read_bytes()
    with pytest.raises(ZeroDivisionError), create_recording(path):
        raise ZeroDivisionError
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["log.mcap"]


def test_targets_that_cannot_be_written(tmp_path: Path) -> None:
    with (
        pytest.raises(UsageError, match="does not exist; create it first"),
        create_recording(tmp_path / "no" / "log.mcap"),
    ):
        pass
    with pytest.raises(UsageError, match="not a regular file"), create_recording(Path("/dev/null")):
        pass


def test_a_full_disk_leaves_nothing(tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        with pytest.raises(RecordingError, match=r"cannot be written.*free space"):
            write_log(tmp_path / "log.mcap")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"#ROSBAG V2.0\n", "not an MCAP file"),
        (b"\x89MCAP0\r\n", "ends within its MCAP header"),
        (b"\x89MCAP0\r\n\x01\xff\xff\xff\xff\xff\xff\xff\xff", "ends within its MCAP header"),
    ],
)
def test_what_is_no_recording(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=words), open_recording(path):
        pass


def test_a_missing_file_and_a_folder(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no such file"), open_recording(tmp_path / "no.mcap"):
        pass
    with pytest.raises(ToolkitError, match="is a folder; convert it first"), open_recording(tmp_path):
        pass


def test_a_flipped_byte_costs_its_chunk_and_is_told(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_log(path)
    data = bytearray(path.read_bytes())
    image = data.find(bytes(500))
    data[image + 250] ^= 1
    path.write_bytes(data)
    with open_recording(path) as recording:
        found = list(recording.messages())
        assert len(recording.losses) == 1
        assert "CRC" in recording.losses[0]
        assert 240 <= len(found) < 300
        assert sum(m.connection.topic == ODOMETRY.topic for m in found) == 240
    with open_recording(path, verify=False) as recording:
        assert len(list(recording.messages())) == 300


def test_without_summary_everything_is_read(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_log(path)
    with open_recording(path) as recording:
        whole = [(m.log_time_ns, bytes(m.data)) for m in recording.messages()]
        fingerprint = recording.fingerprint()
    data = path.read_bytes()
    path.write_bytes(data + b"garbage after the end")
    with open_recording(path) as recording:
        assert [(m.log_time_ns, bytes(m.data)) for m in recording.messages()] == whole
        assert recording.losses == []
        assert recording.fingerprint() == fingerprint


def test_the_fingerprint_tells_contents_apart(tmp_path: Path) -> None:
    names = {}
    for seconds in (5, 6):
        path = tmp_path / f"{seconds}.mcap"
        write_log(path, seconds)
        with open_recording(path) as recording:
            names[seconds] = recording.fingerprint()
    assert len(set(names.values())) == 2


def test_a_declared_channel_needs_no_message(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with create_recording(path) as writer:
        writer.declare(writer.connection(SCENE_OBJECTS))
    with open_recording(path) as recording:
        assert [(c.connection.topic, c.count) for c in recording.channels] == [(SCENE_OBJECTS.topic, 0)]
        assert recording.start_ns is None


def test_a_cut_chunk_gives_its_first_messages(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_log(path)
    with open_recording(path) as recording:
        whole = [(m.connection.topic, m.log_time_ns, bytes(m.data)) for m in recording.messages()]
    data = path.read_bytes()
    counts = []
    for size in range(len(data) // 4, len(data), len(data) // 23):
        path.write_bytes(data[:size])
        with open_recording(path) as recording:
            found = [(m.connection.topic, m.log_time_ns, bytes(m.data)) for m in recording.messages()]
            assert len([loss for loss in recording.losses if "cut at byte" in loss]) == 1
        assert set(found) <= set(whole)
        counts.append(len(found))
    assert counts == sorted(counts)
    assert len(set(counts)) > 10  # a cut costs messages, not whole chunks
