"""Chunks that overlap beyond the bound of memory are read in the order of time all the same."""

import tempfile
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import pytest
from mcap.writer import CompressionType, Writer
from mcap_landmarks import memory
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.recording.container import MESSAGE
from mcap_landmarks.recording.reader import open_recording

CHUNKS, EACH, SIZE = 12, 20, 100


@pytest.fixture
def tiny_bound() -> Iterator[None]:
    """So little may be held that three chunks of the log are too much."""
    memory.allow("20K")
    yield
    memory.allow(None)


def overlapping(path: Path) -> Path:
    """A log whose chunks all last as long as it does, but for the last two, of which each begins after all others."""
    stream = BytesIO()
    writer = Writer(stream, compression=CompressionType.ZSTD, chunk_size=EACH * (MESSAGE.size + SIZE) - 1)
    writer.start("ros2", "test")
    ids = [writer.register_channel(topic, "cdr", 0) for topic in ("/a", "/b")]
    for chunk in range(CHUNKS):
        for i in range(EACH):
            time_ns = 1 + i * CHUNKS + chunk if chunk < CHUNKS - 2 else 10**6 * chunk + i
            writer.add_message(ids[i % 2], time_ns, bytes([chunk, i]) * (SIZE // 2), time_ns - 1, i)
    writer.finish()
    path.write_bytes(stream.getvalue())
    return path


def read(path: Path, start_ns: int | None = None, end_ns: int | None = None) -> list[tuple[str, int, int, int, bytes]]:
    with open_recording(path) as log:
        return [(raw[0].topic, *raw[1:4], bytes(raw.data)) for raw in log.messages(None, start_ns, end_ns)]


@pytest.mark.usefixtures("tiny_bound")
@pytest.mark.parametrize("span", [(None, None), (30, 170)], ids=["all", "a stretch"])
def test_a_tiny_bound_changes_nothing_but_where_messages_wait(
    tmp_path: Path, span: tuple[int | None, int | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = overlapping(tmp_path / "log.mcap")
    opened: list[object] = []
    real = tempfile.TemporaryFile
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda **how: opened.append(how) or real(**how))
    bounded = read(path, *span)
    assert len(opened) == 1
    memory.allow(None)
    assert bounded == read(path, *span)
    assert len(opened) == 1, "what may be held waits in no file"
    assert [raw[1] for raw in bounded] == sorted(raw[1] for raw in bounded)
    if span == (None, None):
        assert len(bounded) == CHUNKS * EACH


@pytest.mark.usefixtures("tiny_bound")
def test_no_room_for_what_waits_is_said_with_the_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = overlapping(tmp_path / "log.mcap")

    def full(**_how: object) -> object:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    with pytest.raises(RecordingError, match=r"log.mcap: \d+ of its chunks overlap.*No space left.*TMPDIR"):
        read(path)
