"""recover: everything sound arrives as it was, the rest is told, and exit codes say which it was."""

import json
from collections import Counter
from pathlib import Path

import pytest
from jsonschema import validate
from mcap.reader import make_reader
from mcap.writer import Writer

from tests.cli.calls import call, refused, schema_of
from tests.recording.damages import (
    CHUNK,
    CHUNK_INDEX,
    DAMAGES,
    MESSAGES,
    Truth,
    flip,
    of_kind,
    put,
    with_summary_crc,
    write,
)
from tests.recording.test_damage import COSTS_NO_MESSAGE, RECOVERED
from tests.sources.bags import write_plain_db3, write_ros1, write_ros2


def _messages(path: Path) -> list[Truth]:
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return [(c.topic, m.sequence, m.log_time, m.data) for _, c, m in reader.iter_messages()]


def _report(path: Path) -> dict[str, str]:
    with path.open("rb") as stream:
        return next(m.metadata for m in make_reader(stream).iter_metadata() if m.name == "mcap-landmarks.recover")


@pytest.mark.parametrize("name", [name for name in DAMAGES if name not in {"0 bytes", "magic only", "not an MCAP"}])
def test_the_output_holds_all_that_is_sound(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    how, damage = DAMAGES[name]
    data, truth = write(**how)  # type: ignore[arg-type]
    log, out = tmp_path / "log.mcap", tmp_path / "out.mcap"
    log.write_bytes(damage(data))
    code = call("recover", log, "-o", out, "--json")
    document = json.loads(capsys.readouterr().out)
    validate(document, schema_of("recover"))
    found = _messages(out)
    wrong = Counter(found) - Counter(truth)
    assert len(found) - wrong.total() == RECOVERED.get(name, MESSAGES)
    assert wrong.total() == (name == "flipped, no CRC")  # which is named as unverified
    assert code == (3 if name in COSTS_NO_MESSAGE or (name in RECOVERED and not wrong) else 0)
    assert document["recovered"] == len(found)
    assert json.loads(_report(out)["losses"]) == document["losses"]
    assert bool(document["losses"]) == (code == 3)


@pytest.mark.parametrize("name", ["0 bytes", "magic only", "not an MCAP"])
def test_what_is_no_recording_leaves_no_output(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    (tmp_path / "log.mcap").write_bytes(DAMAGES[name][1](write()[0]))
    assert "log.mcap" in refused(capsys, 1, "recover", tmp_path / "log.mcap", "-o", tmp_path / "out.mcap")
    assert [path.name for path in tmp_path.iterdir()] == ["log.mcap"]


def test_channels_of_any_kind_stay_as_they_are(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="other", library="x")
        schema = writer.register_schema("thing", "jsonschema", b"{}")
        plain = writer.register_channel("/plain", "text", 0, {"who": "me"})
        typed = writer.register_channel("/json", "json", schema)
        for i in range(5):
            writer.add_message(plain, i, b"words", i + 1, i)
            writer.add_message(typed, i, b"{}", i + 1, i)
        writer.add_attachment(1, 2, "a.txt", "text/plain", b"abc")
        writer.add_metadata("about", {"a": "b"})
        writer.finish()
    assert call("recover", tmp_path / "a.mcap", "-o", tmp_path / "b.mcap") == 0
    assert call("recover", tmp_path / "a.mcap", "-o", tmp_path / "c.mcap") == 0
    assert (tmp_path / "b.mcap").read_bytes() == (tmp_path / "c.mcap").read_bytes()
    with (tmp_path / "b.mcap").open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "other"
        found = [
            (s and s.name, c.topic, c.message_encoding, c.metadata, m.publish_time)
            for s, c, m in reader.iter_messages()
        ]
        assert found[:2] == [(None, "/plain", "text", {"who": "me"}, 1), ("thing", "/json", "json", {}, 1)]
        assert len(found) == 10
        assert [(a.name, a.data) for a in reader.iter_attachments()] == [("a.txt", b"abc")]
        assert {m.name for m in reader.iter_metadata()} >= {"about", "mcap-landmarks.run"}


def test_it_tells_what_is_lost_and_never_writes_over_the_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, _ = write()
    chunk = of_kind(data, CHUNK)[7]
    log, out = tmp_path / "log.mcap", tmp_path / "out.mcap"
    log.write_bytes(flip(put(data, of_kind(data, CHUNK)[2].start, bytes(50)), chunk.start + 800))
    assert call("recover", log, "-o", out) == 3
    told = capsys.readouterr()
    assert f"suspect chunk at byte {chunk.start}: 63 messages, its CRC does not match" in told.out
    assert "954 of 1080 messages recovered" in told.out
    assert "passed over from byte" in told.err
    assert "is the input itself" in refused(capsys, 2, "recover", log, "-o", log)
    out.write_bytes(b"something else")
    assert "--overwrite" in refused(capsys, 2, "recover", log, "-o", out)
    assert call("recover", log, "-o", out, "--overwrite") == 3


def test_bags_are_recovered_as_far_as_they_can_be_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = write_ros1(tmp_path / "a.bag")
    bag.write_bytes(bag.read_bytes()[: bag.stat().st_size * 3 // 4])
    assert call("recover", bag, "-o", tmp_path / "bag.mcap", "--json") == 3
    document = json.loads(capsys.readouterr().out)
    validate(document, schema_of("recover"))
    assert 0 < document["recovered"] == len(_messages(tmp_path / "bag.mcap")) < 80
    assert json.loads(_report(tmp_path / "bag.mcap")["losses"]) == document["losses"]
    assert call("recover", write_ros2(tmp_path / "folder"), "-o", tmp_path / "folder.mcap") == 0
    assert len(_messages(tmp_path / "folder.mcap")) == 40
    empty = write_plain_db3(tmp_path / "empty.db3", count=0)
    assert "empty.db3" in refused(capsys, 1, "recover", empty, "-o", tmp_path / "empty.mcap")


@pytest.mark.parametrize("name", ["flipped in a plain chunk", "attachment, no summary", "metadata", "zeroed block"])
def test_a_check_tells_all_that_recover_would_lose(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    how, damage = DAMAGES[name]
    (tmp_path / "log.mcap").write_bytes(damage(write(**how)[0]))  # type: ignore[arg-type]
    assert call("recover", tmp_path / "log.mcap", "-o", tmp_path / "out.mcap", "--json") == 3
    losses = json.loads(capsys.readouterr().out)["losses"]
    assert call("info", tmp_path / "log.mcap", "--check", "--json") == 3
    assert json.loads(capsys.readouterr().out)["losses"] == [f"log.mcap: {loss}" for loss in losses]


def test_a_check_notes_what_nothing_verifies_and_what_is_there_twice(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.mcap").write_bytes(write(crcs=False)[0])
    assert call("info", tmp_path / "a.mcap", "--check") == 0
    assert "note: a.mcap: 18 chunks without a CRC" in capsys.readouterr().err
    how, damage = DAMAGES["chunk there twice"]
    (tmp_path / "b.mcap").write_bytes(damage(write(**how)[0]))  # type: ignore[arg-type]
    assert call("info", tmp_path / "b.mcap", "--check") == 0
    assert "counted once" in capsys.readouterr().err


def test_lenient_reads_what_an_index_hides(tmp_path: Path) -> None:
    """An index that leaves a channel out of a chunk, and is right in all else: only reading the chunk tells."""
    data, _ = write()
    offsets = of_kind(data, CHUNK_INDEX)[3].start + 9 + 32 + 4
    log, out = tmp_path / "log.mcap", tmp_path / "out.mcap"
    log.write_bytes(with_summary_crc(put(data, offsets, b"\x63\x00")))
    topic = ("--topics", "/topic_1")  # the first that this entry names
    assert call("convert", log, "-o", out, *topic) == 3
    assert len(_messages(out)) < MESSAGES // 6
    assert call("convert", log, "-o", out, *topic, "--lenient") == 0
    assert len(_messages(out)) == MESSAGES // 6
    for words in (("info", log), ("info", log, "--check"), ("diff", log, log)):
        assert call(*words, "--lenient") == 0
