"""ROS 2 bags: payloads as they are, definitions from where they can be trusted, damage told."""

import sqlite3
from pathlib import Path

import pytest
import zstandard
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.sources import Log, McapFile, SourceLog, find_source
from mcap_landmarks.sources._db3 import Db3Log
from mcap_landmarks.sources.rosbag2 import Rosbag2Config
from mcap_landmarks.stage import RawMessage

from tests.sources.bags import HUMBLE, SECOND, START_NS, scan, text, times, write_plain_db3, write_ros2

SOURCE = find_source("rosbag2")


def read(
    path: Path, distro: str | None = None, definitions: tuple[Path, ...] = ()
) -> tuple[list[RawMessage], SourceLog]:
    with SOURCE.open(path, Rosbag2Config(distro, tuple(map(str, definitions)))) as logs:
        (log,) = logs
        parts = [part for part in log.parts if not isinstance(part, McapFile)]
        for part in parts:
            part.verify(lambda _topic: True)
        return [raw for part in parts for raw in part.messages()], log


def why_left_out(path: Path, distro: str | None = None, definitions: tuple[Path, ...] = ()) -> str:
    """Of a bag with one topic, why it cannot be carried."""
    messages, log = read(path, distro, definitions)
    assert messages == []
    (topic,) = only_part(log).left_out
    assert (topic.topic, topic.messages) == ("/talk", 20)
    return topic.reason


def only_part(log: SourceLog) -> Log:
    (part,) = log.parts
    assert not isinstance(part, McapFile)
    return part


@pytest.mark.parametrize("mode", [None, "message", "file"])
def test_payloads_pass_through(tmp_path: Path, mode: str | None) -> None:
    messages, log = read(write_ros2(tmp_path / "bag", mode=mode))
    scans = [raw for raw in messages if raw.connection.topic == "/scan"]
    assert [raw.log_time_ns for raw in scans] == times(20)
    for raw in scans:
        wanted = HUMBLE.serialize_cdr(scan(HUMBLE, raw.log_time_ns), "sensor_msgs/msg/LaserScan")
        assert bytes(raw.data) == bytes(wanted)
    assert len(messages) == 40
    assert {entry.count for entry in only_part(log).channels} == {20}
    connection = scans[0].connection
    assert (connection.schema_encoding, connection.message_type) == ("ros2msg", "sensor_msgs/msg/LaserScan")
    assert connection.metadata["topic_type_hash"].startswith("RIHS01_")


def test_mcap_files_are_named_not_read(tmp_path: Path) -> None:
    folder = write_ros2(tmp_path / "bag", storage="mcap", mode="file")
    with SOURCE.open(folder, Rosbag2Config()) as logs:
        (part,) = logs[0].parts
        assert isinstance(part, McapFile)
        plain = part.path
        assert plain.read_bytes()[:6] == b"\x89MCAP0"
    assert not plain.exists()


@pytest.mark.parametrize("index", [True, False])
def test_rows_come_in_the_order_of_time(tmp_path: Path, index: bool) -> None:
    messages, _ = read(write_plain_db3(tmp_path / "a.db3", index=index), "humble")
    assert [raw.log_time_ns for raw in messages] == times(20)
    assert messages[3].data == bytes(HUMBLE.serialize_cdr(text(HUMBLE, "word 3" * 20), "std_msgs/msg/String"))
    assert messages[0].connection.metadata["offered_qos_profiles"] == "- history: 3"
    assert b"string data" in messages[0].connection.schema


@pytest.mark.parametrize("index", [True, False])
def test_a_time_range_reads_only_that(tmp_path: Path, index: bool) -> None:
    with SOURCE.open(write_plain_db3(tmp_path / "a.db3", index=index), Rosbag2Config("humble")) as logs:
        found = only_part(logs[0]).messages(start_ns=times(20)[5], end_ns=times(20)[8])
        assert [raw.log_time_ns for raw in found] == times(20)[5:8]


def test_a_type_that_is_the_same_in_every_distribution_needs_no_name_of_one(tmp_path: Path) -> None:
    messages, _ = read(write_plain_db3(tmp_path / "a.db3"))
    assert len(messages) == 20
    assert messages[0].connection.schema == b"string data\n"


def test_where_distributions_differ_one_is_asked_for(tmp_path: Path) -> None:
    reason = why_left_out(write_plain_db3(tmp_path / "a.db3", message_type="sensor_msgs/msg/Range"))
    assert "distributions differ in it; name the one it was recorded with, such as --distro" in reason


def test_the_metadata_may_name_the_distribution(tmp_path: Path) -> None:
    write_plain_db3(tmp_path / "bag_0.db3")
    (tmp_path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  relative_file_paths: [bag_0.db3]\n  ros_distro: humble\n"
    )
    assert len(read(tmp_path)[0]) == 20
    assert len(read(tmp_path / "bag_0.db3")[0]) == 20


def test_a_distribution_whose_type_does_not_fit_is_refused(tmp_path: Path) -> None:
    path = write_plain_db3(tmp_path / "a.db3", message_type="geometry_msgs/msg/Point")
    assert "bytes are not humble's geometry_msgs/msg/Point" in why_left_out(path, "humble")
    path = write_plain_db3(tmp_path / "b.db3", message_type="my_msgs/msg/Own")
    reason = why_left_out(path, "humble")
    assert reason.startswith("neither the file nor humble defines my_msgs/msg/Own")
    assert "--distro" not in reason
    with pytest.raises(UsageError, match=r"known are .*humble"):
        read(path, "hydro")


def test_messages_that_are_not_cdr_are_refused(tmp_path: Path) -> None:
    path = write_plain_db3(tmp_path / "a.db3")
    with sqlite3.connect(path) as database:
        database.execute("UPDATE topics SET serialization_format = 'protobuf'")
    database.close()
    assert why_left_out(path, "humble") == "its messages are protobuf, not CDR"


def test_a_damaged_payload_is_told(tmp_path: Path) -> None:
    folder = write_ros2(tmp_path / "bag", mode="message")
    path = next(folder.glob("*.db3"))
    with sqlite3.connect(path) as database:
        database.execute("UPDATE messages SET data = CAST(substr(data, 1, 9) AS BLOB) WHERE id = 5")
    database.close()
    messages, log = read(folder)
    assert len(messages) == 39
    assert "cannot be decompressed" in only_part(log).losses[0]


def test_messages_without_topic_are_told(tmp_path: Path) -> None:
    path = write_plain_db3(tmp_path / "a.db3")
    with sqlite3.connect(path) as database:
        database.execute("UPDATE messages SET topic_id = 7 WHERE id < 4")
    database.close()
    messages, log = read(path, "humble")
    assert len(messages) == 17
    assert "3 messages of topics that are nowhere described" in only_part(log).losses[0]


@pytest.mark.parametrize("share", [0.95, 0.6])
def test_a_cut_file_gives_what_lies_before_the_cut(tmp_path: Path, share: float) -> None:
    path = write_plain_db3(tmp_path / "a.db3", count=2000)
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    messages, log = read(path, "humble")
    assert 2000 * (share - 0.2) < len(messages) < 2000
    assert [raw.log_time_ns for raw in messages] == sorted(raw.log_time_ns for raw in messages)
    assert "cut or damaged" in only_part(log).losses[0]
    assert only_part(log).channels[0].count == len(messages)


def test_a_damaged_index_does_not_cost_messages(tmp_path: Path) -> None:
    path = write_plain_db3(tmp_path / "a.db3", count=2000)
    with sqlite3.connect(path) as database:
        root, page_bytes = database.execute(
            "SELECT rootpage, (SELECT page_size FROM pragma_page_size) FROM sqlite_master WHERE name = 'timestamp_idx'"
        ).fetchone()
    database.close()
    data = bytearray(path.read_bytes())
    data[(root - 1) * page_bytes : (root - 1) * page_bytes + 8] = b"\xff" * 8
    path.write_bytes(data)
    messages, log = read(path, "humble")
    assert [raw.log_time_ns for raw in messages] == times(2000)
    assert "damaged" in only_part(log).losses[0]


def test_a_write_ahead_log_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.db3"
    write_plain_db3(path)
    writer = sqlite3.connect(path)
    writer.execute("PRAGMA journal_mode=WAL")
    writer.execute("PRAGMA wal_autocheckpoint=0")
    data = bytes(HUMBLE.serialize_cdr(text(HUMBLE, "late"), "std_msgs/msg/String"))
    writer.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (1, ?, ?)", (START_NS + 99 * SECOND, data))
    writer.commit()
    messages, _ = read(path, "humble")
    writer.close()
    assert len(messages) == 21


def test_the_folder_is_left_as_it_was(tmp_path: Path) -> None:
    folder = write_ros2(tmp_path / "bag")
    before = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    read(folder)
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == before


class TestFolder:
    """Which files of a folder belong to the bag."""

    def split(self, folder: Path, parts: int = 3) -> None:
        folder.mkdir()
        for i in range(parts):
            write_plain_db3(folder / f"bag_{i + 8}.db3")
        names = ", ".join(f"old/bag_{i + 8}.db3" for i in range(parts))
        (folder / "metadata.yaml").write_text(
            f"rosbag2_bagfile_information:\n  ros_distro: humble\n  relative_file_paths: [{names}]\n"
        )

    def test_listed_files_are_taken_in_order(self, tmp_path: Path) -> None:
        self.split(tmp_path / "bag")
        messages, log = read(tmp_path / "bag")
        assert len(messages) == 60
        assert log.name == "bag"

    def test_a_missing_part_is_told(self, tmp_path: Path) -> None:
        self.split(tmp_path / "bag")
        (tmp_path / "bag/bag_9.db3").unlink()
        messages, log = read(tmp_path / "bag")
        assert len(messages) == 40
        assert "bag_9.db3, a part of the bag, is missing" in log.losses[0]

    def test_a_file_of_another_bag_is_named_and_not_taken(self, tmp_path: Path) -> None:
        self.split(tmp_path / "bag")
        write_plain_db3(tmp_path / "bag/other.db3")
        messages, log = read(tmp_path / "bag")
        assert (len(messages), log.losses) == (60, ())
        assert "other.db3 is no part of the bag" in log.notes[0]

    @pytest.mark.parametrize("content", [None, "rosbag2_bagfile_information: [", "- 1"])
    def test_without_list_all_are_taken(self, tmp_path: Path, content: str | None) -> None:
        self.split(tmp_path / "bag", parts=4)
        metadata = tmp_path / "bag/metadata.yaml"
        metadata.unlink() if content is None else metadata.write_text(content)
        with SOURCE.open(tmp_path / "bag", Rosbag2Config("humble")) as logs:
            names = [part._path.name for part in logs[0].parts if isinstance(part, Db3Log)]
            assert names == ["bag_8.db3", "bag_9.db3", "bag_10.db3", "bag_11.db3"]
            assert "took all 4 storage files" in logs[0].notes[0]

    def test_a_file_beside_its_compressed_self_counts_once(self, tmp_path: Path) -> None:
        folder = write_ros2(tmp_path / "bag", mode="file")
        compressed = next(folder.glob("*.zstd"))
        plain = zstandard.ZstdDecompressor().decompressobj().decompress(compressed.read_bytes())
        (folder / compressed.name.removesuffix(".zstd")).write_bytes(plain)
        assert len(read(folder)[0]) == 40

    def test_an_empty_folder_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
        with pytest.raises(RecordingError, match="holds no storage file"):
            read(tmp_path)
        (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {relative_file_paths: [a.db3]}\n")
        with pytest.raises(RecordingError, match="none of the files"):
            read(tmp_path)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.db3", b"", "is empty"),
        ("a.db3", b"not a database, but long enough", "not an SQLite file"),
        ("a.mcap", b"not a recording, but long enough", "not an MCAP file"),
        ("a.db3", b"SQLite format 3\0" + b"\xff" * 2000, "no ROS 2 bag, or too damaged"),
        ("a.db3.zstd", b"\x28\xb5\x2f\xfd" + b"\xff" * 40, "cannot be decompressed"),
    ],
)
def test_what_is_no_bag_is_refused(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=words):
        read(path)


def test_another_database_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.db3"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE things(id INTEGER)")
    database.close()
    with pytest.raises(RecordingError, match="no tables of topics and messages"):
        read(path)
