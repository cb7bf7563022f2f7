"""Recordings to recordings: cut, filtered, split, merged, renamed and written anew, and nothing is lost."""

from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Attachment
from mcap_landmarks.channels import ODOMETRY, TF_STATIC
from mcap_landmarks.errors import UsageError
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.progress import unwatched
from mcap_landmarks.recording.chunk_form import ChunkForm
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.runs.convert import Conversion, convert
from mcap_landmarks.runs.output_formats import OutputForm
from mcap_landmarks.runs.splitting import Split
from mcap_landmarks.runs.topic_selection import Selection
from mcap_landmarks.stage import Connection, RawMessage, Stamped

from tests.runs.conversion import doctor

SECOND = 10**9
SCHEMA = b"uint8 data"
MOUNT = Transform.planar(0, ("base", "camera"), (0.1, 0.2, 0.0))


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twenty seconds: static transforms once, odometry at 20 Hz, and bytes at 10 Hz with their own publish times."""
    path = tmp_path_factory.mktemp("edit") / "log.mcap"
    with create_recording(path, {"notes": {"weather": "rain"}}) as writer:
        writer.add(Stamped(TF_STATIC, 0, TFMessage((MOUNT,))))
        numbers = Connection("/numbers", "std_msgs/msg/UInt8", SCHEMA, metadata={"offered_qos_profiles": ""})
        for i in range(400):
            now = i * SECOND // 20
            writer.add(Stamped(ODOMETRY, now, Odometry.planar(now, ("odom", "base"), (i, 0, 0), np.eye(3))))
            if i % 2 == 0:
                writer.write(RawMessage(numbers, now, now + 7, 1000 - i, bytes([0, 1, 0, 0, i % 200])))
        writer.attach(Attachment(5, 6, "plan.txt", "text/plain", b"left, then right"))
    return path


def edited(log: Path, output: Path, selection: Selection | None = None, **form: object) -> Conversion:
    written = OutputForm(**form)  # type: ignore[arg-type] # as given
    return convert([log], output, selection or Selection(), {}, unwatched, form=written)


def messages(path: Path) -> list[tuple[str, int, int, int, bytes]]:
    """What another tool reads, having checked all CRCs; those of one time by topic."""
    assert doctor(path) == []
    with path.open("rb") as stream:
        found = [
            (channel.topic, message.log_time, message.publish_time, message.sequence, message.data)
            for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages()
        ]
    return sorted(found, key=lambda each: (each[1], each[0]))


def test_nothing_of_a_whole_recording_changes(log: Path, tmp_path: Path) -> None:
    edited(log, tmp_path / "out.mcap")
    assert messages(tmp_path / "out.mcap") == messages(log)
    with (tmp_path / "out.mcap").open("rb") as stream, log.open("rb") as before:
        new, old = make_reader(stream), make_reader(before)
        assert list(new.iter_attachments()) == list(old.iter_attachments())
        assert {"notes"} < {record.name for record in new.iter_metadata()}
        first, second = new.get_summary(), old.get_summary()
    assert first is not None
    assert second is not None
    assert (first.channels, first.schemas) == (second.channels, second.schemas)


def test_what_is_cut_begins_with_what_holds(log: Path, tmp_path: Path) -> None:
    edited(log, tmp_path / "out.mcap", Selection((), 7 * SECOND, 12 * SECOND))
    found = messages(tmp_path / "out.mcap")
    wanted = [each for each in messages(log) if 7 * SECOND <= each[1] < 12 * SECOND]
    assert [each for each in found if each[0] != "/tf_static"] == wanted
    assert [each[:2] for each in found if each[0] == "/tf_static"] == [("/tf_static", 7 * SECOND)]


@pytest.mark.parametrize(
    ("selection", "topics"),
    [
        (Selection(("/o.*",)), {"/odom"}),
        (Selection(exclude=("/o.*",)), {"/numbers", "/tf_static"}),
        (Selection(types=("std_msgs/.*", ".*/Odometry")), {"/numbers", "/odom"}),
        (Selection(("/.*",), types=(".*/UInt8",), exclude=("/odom",)), {"/numbers"}),
    ],
)
def test_topics_and_types_are_chosen(log: Path, tmp_path: Path, selection: Selection, topics: set[str]) -> None:
    edited(log, tmp_path / "out.mcap", selection)
    assert messages(tmp_path / "out.mcap") == [each for each in messages(log) if each[0] in topics]


@pytest.mark.parametrize(
    ("selection", "said"),
    [
        (Selection(("/camera",)), "--topics matches none of /numbers, /odom, /tf_static"),
        (Selection(exclude=("/.*",)), "--exclude leaves none of /numbers, /odom, /tf_static"),
        (Selection(types=("UInt8",)), r"--types matches none of /numbers \(std_msgs/msg/UInt8\), /odom"),
        (Selection(types=("[",)), "--types '\\[' is not a regular expression"),
        (Selection(remap=(("/nothing", "/odom"),)), "--remap /nothing: there is no such topic; there are /numbers"),
        (Selection(remap=(("/numbers", "/odom"),)), "one topic; messages of one topic are of one type"),
    ],
)
def test_what_cannot_be_is_refused(log: Path, tmp_path: Path, selection: Selection, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        edited(log, tmp_path / "out.mcap", selection)
    assert list(tmp_path.iterdir()) == []


def test_topics_are_renamed(log: Path, tmp_path: Path) -> None:
    edited(log, tmp_path / "out.mcap", Selection(remap=(("/numbers", "/digits"),)))
    renamed = [("/digits" if each[0] == "/numbers" else each[0], *each[1:]) for each in messages(log)]
    assert messages(tmp_path / "out.mcap") == sorted(renamed, key=lambda each: (each[1], each[0]))


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_chunks_are_written_anew(log: Path, tmp_path: Path, compression: str) -> None:
    edited(log, tmp_path / "out.mcap", chunks=ChunkForm(compression, 4096))
    assert messages(tmp_path / "out.mcap") == messages(log)
    with (tmp_path / "out.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert {chunk.compression for chunk in summary.chunk_indexes} == {compression.replace("none", "")}
    assert max(chunk.uncompressed_size for chunk in summary.chunk_indexes) < 8192
    assert len(summary.chunk_indexes) > 20


@pytest.mark.parametrize(
    ("split", "counts"),
    [
        (Split(duration_ns=6 * SECOND), [181, 180, 180, 60]),
        (Split(count=250), [250, 249, 102]),
        (Split(size_bytes=4000), None),
    ],
    ids=["time", "count", "size"],
)
def test_parts_make_the_whole(log: Path, tmp_path: Path, split: Split, counts: list[int] | None) -> None:
    done = edited(log, tmp_path / "parts", split=split)
    assert [output.path.name for output in done.outputs] == [f"log_{i}.mcap" for i in range(len(done.outputs))]
    parts = [messages(output.path) for output in done.outputs]
    assert len(parts) > 2
    for number, part in enumerate(parts):
        carried = [each for each in part if each[0] == "/tf_static"]
        assert [each[1] for each in carried] == [part[0][1]]
        if number:
            part.remove(carried[0])
            assert parts[number - 1][-1][1] < part[0][1], "no two parts overlap"
    assert list(chain.from_iterable(parts)) == messages(log)
    if counts is not None:
        assert [len(part) for part in parts] == counts
    assert sum(output.declared for output in done.outputs) == 601 + len(parts) - 1
    assert [output.lost for output in done.outputs] == [0] * len(parts)


def test_a_split_into_fewer_parts_leaves_none_of_the_others(log: Path, tmp_path: Path) -> None:
    edited(log, tmp_path / "parts", split=Split(duration_ns=3 * SECOND))
    edited(log, tmp_path / "parts", split=Split(duration_ns=11 * SECOND))
    assert sorted(path.name for path in (tmp_path / "parts").iterdir()) == ["log_0.mcap", "log_1.mcap"]
    (tmp_path / "parts" / "log_2.mcap").write_bytes(b"something else")
    with pytest.raises(UsageError, match="is no part of this log"):
        edited(log, tmp_path / "parts", split=Split(duration_ns=11 * SECOND))


def test_a_split_into_too_many_parts_is_refused(log: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="more than 10000 files"):
        edited(log, tmp_path / "parts", split=Split(duration_ns=1_000_000))
    assert list(tmp_path.iterdir()) == []


def test_parts_are_merged_again(log: Path, tmp_path: Path) -> None:
    done = edited(log, tmp_path / "parts", Selection(exclude=("/tf_static",)), split=Split(duration_ns=6 * SECOND))
    convert([output.path for output in done.outputs], tmp_path / "whole.mcap", Selection(), {}, unwatched)
    assert messages(tmp_path / "whole.mcap") == [each for each in messages(log) if each[0] != "/tf_static"]


def test_other_recordings_are_merged(log: Path, tmp_path: Path) -> None:
    with create_recording(tmp_path / "other.mcap") as writer:
        writer.write(RawMessage(Connection("/more", "std_msgs/msg/UInt8", SCHEMA), 9, 9, 0, bytes([0, 1, 0, 0, 5])))
    convert([log, tmp_path / "other.mcap"], tmp_path / "both.mcap", Selection(), {}, unwatched)
    assert len(messages(tmp_path / "both.mcap")) == 602
