"""The MCAP conformance suite: 416 small files and what each holds, read with and without their summaries."""

import json
import zipfile
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording


def _expected(records: list[dict]) -> tuple[list[tuple], list[str], set[str], int]:
    messages, topics, metadata, attachments = [], {}, set(), 0
    for record in records:
        fields = dict(record["fields"])
        kind = record["type"]
        if kind == "Channel":
            topics[fields["id"]] = fields["topic"]
        elif kind == "Message":
            data = bytes(int(byte) for byte in fields["data"])
            messages.append(
                (
                    fields["channel_id"],
                    int(fields["log_time"]),
                    int(fields["publish_time"]),
                    int(fields["sequence"]),
                    data,
                )
            )
        elif kind == "Metadata":
            metadata.add(fields["name"])
        elif kind == "Attachment":
            attachments += 1
    return [(topics[m[0]], *m[1:]) for m in messages], sorted(topics.values()), metadata, attachments


def test_every_file_of_the_suite(shared_data: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(shared_data / "mcap-conformance.zip") as suite:
        names = sorted(name for name in suite.namelist() if name.endswith(".mcap"))
        assert len(names) == 416
        for name in names:
            path = tmp_path / "file.mcap"
            path.write_bytes(suite.read(name))
            messages, topics, metadata, attachments = _expected(json.loads(suite.read(name[:-5] + ".json"))["records"])
            with open_recording(path) as recording:
                found = [
                    (m.connection.topic, m.log_time_ns, m.publish_time_ns, m.sequence, bytes(m.data))
                    for m in recording.messages()
                ]
                assert found == sorted(messages, key=lambda message: message[1]), name
                assert sorted(entry.connection.topic for entry in recording.channels) == topics, name
                assert sum(entry.count for entry in recording.channels) == len(messages), name
                assert set(recording.metadata) == metadata, name
                assert len(list(recording.attachments())) == attachments, name
                assert recording.losses == [], name


def test_the_mcap_package_reads_what_we_write_of_every_file(shared_data: Path, tmp_path: Path) -> None:
    path, written = tmp_path / "file.mcap", tmp_path / "written.mcap"
    with zipfile.ZipFile(shared_data / "mcap-conformance.zip") as suite:
        for name in sorted(name for name in suite.namelist() if name.endswith(".mcap")):
            path.write_bytes(suite.read(name))
            messages, topics, metadata, attachments = _expected(json.loads(suite.read(name[:-5] + ".json"))["records"])
            with open_recording(path) as recording, create_recording(written, recording.metadata) as writer:
                for entry in recording.channels:
                    writer.declare(entry.connection)
                for raw in recording.messages():
                    writer.write(raw)
                for attachment in recording.attachments():
                    writer.attach(attachment)
            with written.open("rb") as stream:
                reader = make_reader(stream, validate_crcs=True)
                found = [
                    (channel.topic, m.log_time, m.publish_time, m.sequence, m.data)
                    for _, channel, m in reader.iter_messages()
                ]
                summary = reader.get_summary()
                assert found == sorted(messages, key=lambda message: message[1]), name
                assert summary is not None, name
                assert sorted(channel.topic for channel in summary.channels.values()) == topics, name
                assert {record.name for record in reader.iter_metadata()} == metadata, name
                assert len(list(reader.iter_attachments())) == attachments, name


@pytest.mark.parametrize("cut", [0.3, 0.6, 0.95])
def test_a_cut_file_gives_what_lies_before_the_cut(shared_data: Path, tmp_path: Path, cut: float) -> None:
    whole = (shared_data / "bags" / "topics_and_services.mcap").read_bytes()
    with open_recording(shared_data / "bags" / "topics_and_services.mcap") as recording:
        expected = [(m.log_time_ns, bytes(m.data)) for m in recording.messages()]
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole[: int(len(whole) * cut)])
    with open_recording(path) as recording:
        found = [(m.log_time_ns, bytes(m.data)) for m in recording.messages()]
        assert any("cut at byte" in loss for loss in recording.losses)
    assert all(message in expected for message in found)
    assert len(found) <= len(expected)
