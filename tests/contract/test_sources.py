"""What every source keeps: found by name, recognised by content, ordered, counted, repeatable."""

import dataclasses
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.inspection.open_logs import OpenLog, open_logs
from mcap_landmarks.sources import Log, find_source, source_names, source_of
from pydantic import TypeAdapter

from tests.sources.bags import write_mrclam, write_plain_db3, write_ros1, write_ros2

Write = Callable[[Path], Path]
SAMPLES: dict[str, list[Write]] = {
    "rosbag1": [
        lambda folder: write_ros1(folder / "a.bag"),
        lambda folder: write_ros1(folder / "a.bag", compression="lz4"),
    ],
    "rosbag2": [
        lambda folder: write_ros2(folder / "bag"),
        lambda folder: write_ros2(folder / "bag", storage="mcap"),
        lambda folder: next(write_ros2(folder / "bag", storage="mcap").glob("*.mcap")),
        lambda folder: write_ros2(folder / "bag", mode="message"),
        lambda folder: write_plain_db3(folder / "a.db3"),
    ],
    "mrclam": [lambda folder: write_mrclam(folder / "set")],
}
EACH = [pytest.param(name, write, id=f"{name}-{i}") for name in source_names() for i, write in enumerate(SAMPLES[name])]


@contextmanager
def parts(path: Path) -> Iterator[list[Log]]:
    with open_logs(path, {"rosbag2": {"distro": "humble"}}) as logs:
        assert all(isinstance(log, OpenLog) for log in logs)
        yield [part for log in logs for part in log.parts]


@pytest.mark.parametrize("name", source_names())
def test_the_declaration_is_whole(name: str) -> None:
    source = find_source(name)
    assert source.name == name
    assert source.reads
    assert dataclasses.is_dataclass(source.config)
    TypeAdapter(source.config).validate_python({})
    assert source.config.__doc__


@pytest.mark.parametrize("name", source_names())
def test_strange_things_are_not_recognised(name: str, tmp_path: Path) -> None:
    (tmp_path / "words.txt").write_text("words")
    (tmp_path / "empty").touch()
    (tmp_path / "broken.zip").write_bytes(b"PK\x03\x04")
    for path in (tmp_path, tmp_path / "words.txt", tmp_path / "empty"):
        assert not find_source(name).recognises(path)
    with pytest.raises(RecordingError, match="nothing that can be converted"):
        source_of(tmp_path / "words.txt")


@pytest.mark.parametrize(("name", "write"), EACH)
class TestLog:
    def test_it_is_recognised_by_its_source_alone(self, name: str, write: Write, tmp_path: Path) -> None:
        path = write(tmp_path)
        assert [other for other in source_names() if find_source(other).recognises(path)] == [name]
        assert source_of(path) is find_source(name)

    def test_messages_are_counted_and_ordered(self, name: str, write: Write, tmp_path: Path) -> None:
        del name
        with parts(write(tmp_path)) as logs:
            for log in logs:
                messages = list(log.messages())
                stamps = [raw.log_time_ns for raw in messages]
                assert stamps == sorted(stamps)
                assert (log.start_ns, log.end_ns) == (stamps[0], stamps[-1])
                assert Counter(raw.connection for raw in messages) == {e.connection: e.count for e in log.channels}
                assert not log.losses

    def test_connections_are_ready_for_ros2(self, name: str, write: Write, tmp_path: Path) -> None:
        del name
        with parts(write(tmp_path)) as logs:
            for connection in (entry.connection for log in logs for entry in log.channels):
                assert "/msg/" in connection.message_type
                assert connection.schema
                assert (connection.message_encoding, connection.schema_encoding) == ("cdr", "ros2msg")
                assert "offered_qos_profiles" in connection.metadata

    def test_it_reads_alike_every_time(self, name: str, write: Write, tmp_path: Path) -> None:
        del name
        with parts(write(tmp_path)) as logs:
            first, second = (
                [[(*raw[1:4], bytes(raw.data)) for raw in log.messages()] for log in logs] for _ in range(2)
            )
        assert first == second

    def test_it_reads_what_is_asked_for(self, name: str, write: Write, tmp_path: Path) -> None:
        del name
        with parts(write(tmp_path)) as logs:
            for log in logs:
                everything = list(log.messages())
                chosen = log.channels[-1].connection
                first, end = everything[len(everything) // 4].log_time_ns, everything[len(everything) // 2].log_time_ns
                wanted = [
                    (raw.log_time_ns, bytes(raw.data))
                    for raw in everything
                    if raw.connection is chosen and first <= raw.log_time_ns < end
                ]
                found = [(raw.log_time_ns, bytes(raw.data)) for raw in log.messages([chosen], first, end)]
                assert found == wanted

    def test_it_tells_its_progress(self, name: str, write: Write, tmp_path: Path) -> None:
        told: list[int] = []
        with parts(write(tmp_path)) as logs:
            for log in logs:
                list(log.messages(progress=told.append))
        assert name == "mrclam" or sum(told) > 0
        assert all(advance >= 0 for advance in told)
