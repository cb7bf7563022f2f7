"""Damaged recordings: whatever the damage, a clear error or what can be had, and never a crash."""

import contextlib
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.errors import RecordingError, ToolkitError
from mcap_landmarks.recording.damage import Damage
from mcap_landmarks.recording.reader import open_recording, reading_from_front

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
from tests.recording.test_writer import write_log

RECOVERED = {
    "cut in the middle": 502,
    "cut in a zstd chunk": 754,
    "cut in an lz4 chunk": 754,
    "cut in a plain chunk": 785,
    "flipped early in a zstd chunk": 1017,
    "flipped late in a zstd chunk": 1017,
    "flipped in an lz4 chunk": 1017,
    "flipped in a plain chunk": 1017,
    "flipped, no summary": 1017,
    "flipped, no CRC": 1079,
    "chunk CRC": 1017,
    "zeroed block": 954,
    "zeroed block, no summary": 954,
    "loose messages, huge length": 1079,
    "loose messages, zeroed": 1073,
    "loose messages, cut": 648,
}
"""Sound messages that can be had, where not all: chunks hold 63, and zstd and lz4 come whole."""
COSTS_NO_MESSAGE = {
    "cut in the summary",
    "never finished",
    "metadata",
    "metadata, no summary",
    "attachment, no summary",
}


def _read(path: Path, *, from_front: bool = False) -> tuple[list[Truth], Damage, list[str]]:
    with open_recording(path, from_front=from_front) as recording:
        found = [(m.connection.topic, m.sequence, m.log_time_ns, bytes(m.data)) for m in recording.messages()]
        list(recording.attachments())
        return found, recording.damage, recording.losses


@pytest.mark.parametrize("from_front", [False, True])
@pytest.mark.parametrize("name", [name for name in DAMAGES if name not in {"0 bytes", "magic only", "not an MCAP"}])
def test_what_is_sound_is_read_and_the_rest_is_told(tmp_path: Path, name: str, *, from_front: bool) -> None:
    how, damage = DAMAGES[name]
    data, truth = write(**how)  # type: ignore[arg-type]
    (tmp_path / "log.mcap").write_bytes(damage(data))
    found, account, losses = _read(tmp_path / "log.mcap", from_front=from_front)
    wrong = Counter(found) - Counter(truth)
    assert len(found) - wrong.total() == RECOVERED.get(name, MESSAGES)
    assert wrong.total() == (name == "flipped, no CRC")
    assert bool(losses) == ((name in RECOVERED or name in COSTS_NO_MESSAGE) and not wrong)
    assert account.recovered == len(found)
    assert account.expected in {None, MESSAGES}
    assert any("cut at byte" in loss for loss in losses) == (
        name.split(maxsplit=1)[0] in {"cut", "never"} or "cut" in name
    )


@pytest.mark.parametrize("name", ["0 bytes", "magic only", "not an MCAP"])
def test_what_is_no_recording_is_named(tmp_path: Path, name: str) -> None:
    (tmp_path / "log.mcap").write_bytes(DAMAGES[name][1](write()[0]))
    with pytest.raises(RecordingError, match=r"log\.mcap"), open_recording(tmp_path / "log.mcap"):
        pass


def test_a_suspect_chunk_is_told_with_its_messages_and_where_reading_went_on(tmp_path: Path) -> None:
    data, _ = write()
    chunk = of_kind(data, CHUNK)[7]
    (tmp_path / "a.mcap").write_bytes(flip(data, chunk.start + 800))
    _, account, losses = _read(tmp_path / "a.mcap")
    assert [(one.offset, one.messages) for one in account.suspect_chunks] == [(chunk.start, 63)]
    assert losses == [
        f"the chunk at byte {chunk.start} is damaged (its CRC does not match); its 63 messages are left out"
    ]
    (tmp_path / "b.mcap").write_bytes(put(data, chunk.start, bytes(100)))
    _, account, losses = _read(tmp_path / "b.mcap")
    assert [(stretch.start, stretch.end) for stretch in account.resyncs] == [(chunk.start, chunk.end)]
    assert losses[0].startswith(f"{chunk.end - chunk.start} bytes passed over from byte {chunk.start} to byte ")


def test_an_index_that_names_chunks_twice_doubles_nothing(tmp_path: Path) -> None:
    data, truth = write()
    first, second = of_kind(data, CHUNK_INDEX)[:2]
    (tmp_path / "a.mcap").write_bytes(with_summary_crc(put(data, first.start, data[second.start : second.end])))
    found, account, _ = _read(tmp_path / "a.mcap")
    assert Counter(found) == Counter(truth)
    assert "its summary is not right" in account.notes[0]


def test_chunks_without_a_crc_are_named_as_unverified_and_no_loss(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(write(crcs=False)[0])
    _, account, losses = _read(tmp_path / "a.mcap")
    assert (account.unverified, losses) == (18, [])
    assert account.notes == ["18 chunks without a CRC: nothing verifies their messages"]


@pytest.mark.parametrize("crcs", [True, False])
def test_a_cut_chunk_is_not_said_to_have_no_crc(tmp_path: Path, *, crcs: bool) -> None:
    data = write("", crcs=crcs)[0]
    first = of_kind(data, CHUNK)[0]
    (tmp_path / "a.mcap").write_bytes(data[: first.end - 10])
    _, account, _ = _read(tmp_path / "a.mcap")
    told = [note for note in account.notes if "CRC" in note]
    cannot = "the CRC of the chunk that the end of the file cuts cannot be checked"
    assert told == ([cannot] if crcs else ["1 chunk without a CRC: nothing verifies its messages"])


def test_a_sound_log_of_ours_is_the_same_recording_however_it_is_read(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap", 3)
    with open_recording(tmp_path / "a.mcap") as recording:
        by_index = recording.fingerprint(), [bytes(m.data) for m in recording.messages()]
        assert recording.losses == recording.notes == []
    with reading_from_front(), open_recording(tmp_path / "a.mcap") as recording:
        assert by_index == (recording.fingerprint(), [bytes(m.data) for m in recording.messages()])
        assert recording.losses == recording.notes == []
        assert recording.damage.crc_matches


@pytest.mark.parametrize("seed", range(40))
def test_random_damage(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "log.mcap"
    write_log(path, 3)
    rng = np.random.default_rng(seed)
    with open_recording(path) as recording:
        whole = {(m.connection.topic, m.log_time_ns, bytes(m.data)) for m in recording.messages()}
    data = bytearray(path.read_bytes())
    for _ in range(rng.integers(1, 6)):
        place = int(rng.integers(8, len(data)))
        data[place : place + int(rng.integers(1, 9))] = rng.bytes(int(rng.integers(0, 9)))
    path.write_bytes(data)
    with contextlib.suppress(ToolkitError), open_recording(path) as recording:
        found = {(m.connection.topic, m.log_time_ns, bytes(m.data)) for m in recording.messages()}
        assert found <= whole
        assert whole <= found or recording.losses
