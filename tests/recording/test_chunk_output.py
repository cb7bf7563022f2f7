"""Chunks that are compressed beside: the order and the bytes are those of writing one after the other."""

import io
import threading
import zlib
from pathlib import Path

import pytest
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.recording import chunk_output
from mcap_landmarks.recording.chunk_form import LARGE_BYTES, ChunkForm, OpenChunk
from mcap_landmarks.recording.chunk_output import ChunkOutput
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Connection, RawMessage

ON = Connection("/some", "std_msgs/msg/UInt8", b"uint8 data")
FORM = ChunkForm(size_bytes=1 << 16)


def chunk(number: int, *, compressed: bool, size: int = 1 << 18) -> OpenChunk:
    data = bytearray(f"{number} " * (size // 2), "ascii")[:size]
    return OpenChunk(compressed, data, size=len(data), start_ns=number, end_ns=number)


def message(number: int, size: int = 1 << 12) -> RawMessage:
    return RawMessage(ON, number, number, number, number.to_bytes(4, "little") * (size // 4))


def test_chunks_keep_their_order_and_the_file_its_crc() -> None:
    """Those that are not compressed are ready at once, and wait all the same."""
    stream = io.BytesIO()
    output = ChunkOutput(stream, FORM)
    for number in range(8):
        output.chunk(chunk(number, compressed=number % 2 == 0))
    output.put(b"what comes behind")
    indexes, crc = output.chunk_indexes, output.crc
    output.close()
    assert [(index.message_start_time, index.compression) for index in indexes] == [
        (number, "" if number % 2 else "zstd") for number in range(8)
    ]
    places = [index.chunk_start_offset for index in indexes]
    assert places == sorted(places)
    assert crc == zlib.crc32(stream.getvalue())
    assert stream.getvalue().endswith(b"what comes behind")


def test_what_waits_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chunk_output, "_MOST_WAITING", 1 << 19)
    stream, begun, go_on = io.BytesIO(), threading.Event(), threading.Event()
    output = ChunkOutput(stream, FORM)

    def compress(data: bytes) -> bytes:
        begun.set()
        assert go_on.wait(10)
        return data

    monkeypatch.setattr(output, "_compress", compress)
    output.chunk(chunk(0, compressed=True))
    output.chunk(chunk(1, compressed=False))
    assert begun.wait(10)
    assert not stream.getvalue()
    threading.Timer(0.05, go_on.set).start()
    output.chunk(chunk(2, compressed=False))  # waits for the first, since it would be too much
    assert len(stream.getvalue()) > 3 << 18
    output.close()


class Full(io.BytesIO):
    """A disk that becomes full."""

    def write(self, data: object, /) -> int:
        if self.tell() > 1 << 18:
            raise OSError(28, "No space left on device")
        return super().write(data)  # type: ignore[arg-type] # whatever a file takes


def test_a_full_disk_is_told_to_who_writes() -> None:
    output = ChunkOutput(Full(), FORM)

    def write() -> None:
        for number in range(100):
            output.chunk(chunk(number, compressed=False))

    with pytest.raises(OSError, match="No space left"):
        write()
    output.close()


def test_an_error_leaves_neither_a_thread_nor_a_file(tmp_path: Path) -> None:
    before = threading.active_count()

    def write() -> None:
        with create_recording(tmp_path / "a.mcap") as writer:
            for number in range(2000):
                writer.write(message(number))
            assert threading.active_count() == before + 1
            raise RecordingError("the source is gone")

    with pytest.raises(RecordingError, match="the source is gone"):
        write()
    assert threading.active_count() == before
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("size", [LARGE_BYTES - 4, LARGE_BYTES, 1 << 18])
@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_payloads_of_every_size_come_back(tmp_path: Path, compression: str, size: int) -> None:
    """Large ones are not copied on their way; the bytes are those of payloads that are views, which always are."""
    sent = [message(number, size if number % 3 else 64) for number in range(12)]
    form = ChunkForm(compression, size_bytes=1 << 16)
    paths = tmp_path / "bytes.mcap", tmp_path / "views.mcap"
    for path, messages in zip(paths, (sent, [one._replace(data=memoryview(one.data)) for one in sent]), strict=True):
        with create_recording(path, form=form) as writer:
            for one in messages:
                writer.write(one)
    with open_recording(paths[0]) as recording:
        assert [(raw.sequence, bytes(raw.data)) for raw in recording.messages()] == [
            (raw.sequence, raw.data) for raw in sent
        ]
    assert paths[0].read_bytes() == paths[1].read_bytes()
