"""Memory of reading large logs: `python -m tests.benchmark.memory [--json] [--quick]`.

Peaks are of a process of its own, by its `VmHWM`: `ru_maxrss` of a child counts what its parent held when it was made.
The logs are written chunk by chunk with payloads of zeros as holes, so that 10 GB take few blocks of the disk.
"""

import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from io import SEEK_CUR
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap import records
from mcap_landmarks.recording.checksum import crc32
from mcap_landmarks.recording.container import CHUNK, MAGIC, MESSAGE, MESSAGE_FIXED, RECORD, Opcode, serialize
from mcap_landmarks.recording.summary import summary_section

from tests.benchmark.rows import Row, main

_GOAL_MB = 300
_READ = """
import sys
from pathlib import Path
from mcap_landmarks.recording.reader import open_recording
count = last = 0
with open_recording(Path(sys.argv[1])) as log:
    for raw in log.messages():
        assert raw.log_time_ns >= last
        last, count = raw.log_time_ns, count + 1
    assert not log.losses, log.losses
peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(count, int(peak.split()[1]) * 1024)
"""
_CHUNK_BYTES, _IMAGE_BYTES, _SMALL_BYTES = 4 << 20, 500_000, 100
Times = Callable[[int, int], int]
"""The time of a chunk's message, from the numbers of both."""


def measure(quick: bool) -> Iterator[Row]:
    """All rows; quick: 1 GB instead of 10."""
    large = 256 if quick else 2560
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "log.mcap"
        yield _row("memory", path, large, _IMAGE_BYTES, _one_after_another)
        yield _row("memory of 64 chunks of images that overlap", path, 64, _IMAGE_BYTES, _all_at_once)
        yield _row("memory of 64 chunks of small messages that overlap", path, 64, _SMALL_BYTES, _all_at_once)
        yield _row("memory of chunks that all overlap", path, large // 4, _IMAGE_BYTES, _all_at_once)


def _one_after_another(chunk: int, message: int) -> int:
    return 1 + chunk * 1_000_000 + message


def _all_at_once(chunk: int, message: int) -> int:
    return 1 + message * 1_000_000 + chunk


def _row(name: str, path: Path, chunks: int, payload: int, times: Times) -> Row:
    """The peak of reading every message of a log of so many chunks of 4 MiB; the cases are its bytes."""
    count = write_log(path, chunks, payload, times)
    words = [sys.executable, "-c", _READ, str(path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)
    found, peak = map(int, done.stdout.split())
    if found != count:
        raise RuntimeError(f"{found} messages are read of {count}")
    size = path.stat().st_size
    path.unlink()
    return Row(name, peak / 1e6, "MB", at_most=_GOAL_MB, cases=size)


def write_log(path: Path, chunks: int, payload: int, times: Times) -> int:
    """Write a log of zeros in payloads of so many bytes; how many messages it has.

    Chunks of small payloads are compressed; large ones are not, and their payloads holes.
    """
    each = _CHUNK_BYTES // (MESSAGE.size + payload)
    schema = records.Schema(id=1, name="std_msgs/msg/String", encoding="ros2msg", data=b"string data\n")
    channel = records.Channel(id=1, topic="/zeros", message_encoding="cdr", schema_id=1, metadata={})
    with path.open("wb") as stream:
        stream.write(MAGIC + serialize(records.Header(profile="ros2", library="benchmark"), schema, channel))
        indexes = [_write_chunk(stream, [times(chunk, i) for i in range(each)], payload) for chunk in range(chunks)]
        stream.write(serialize(records.DataEnd(data_section_crc=0)))
        statistics = records.Statistics(
            message_count=chunks * each,
            schema_count=1,
            channel_count=1,
            attachment_count=0,
            metadata_count=0,
            chunk_count=chunks,
            message_start_time=min(index.message_start_time for index in indexes),
            message_end_time=max(index.message_end_time for index in indexes),
            channel_message_counts={1: chunks * each},
        )
        stream.write(summary_section([[schema], [channel], [statistics], indexes], stream.tell()))
    return chunks * each


def _write_chunk(stream: BinaryIO, times_ns: list[int], payload: int) -> records.ChunkIndex:
    """Write a chunk of messages at some times, and its message index."""
    length, zeros = MESSAGE.size + payload, bytes(payload)
    heads = [MESSAGE.pack(Opcode.MESSAGE, MESSAGE_FIXED + payload, 1, i, t, t) for i, t in enumerate(times_ns)]
    content = b"".join(part for head in heads for part in (head, zeros))
    is_small = payload == _SMALL_BYTES
    data, compression = (zstandard.compress(content), "zstd") if is_small else (content, "")
    head = CHUNK.pack(times_ns[0], times_ns[-1], len(content), crc32(content))
    head += len(compression).to_bytes(4, "little") + compression.encode() + len(data).to_bytes(8, "little")
    start = stream.tell()
    stream.write(RECORD.pack(Opcode.CHUNK, len(head) + len(data)) + head)
    for part in [data] if is_small else heads:
        stream.write(part)
        stream.seek(0 if is_small else payload, SEEK_CUR)
    place = stream.tell()
    entries = [(time_ns, i * length) for i, time_ns in enumerate(times_ns)]
    index = serialize(records.MessageIndex(channel_id=1, records=entries))
    stream.write(index)
    return records.ChunkIndex(
        chunk_length=place - start,
        chunk_start_offset=start,
        compression=compression,
        compressed_size=len(data),
        message_end_time=times_ns[-1],
        message_index_length=len(index),
        message_index_offsets={1: place},
        message_start_time=times_ns[0],
        uncompressed_size=len(content),
    )


if __name__ == "__main__":
    sys.exit(main(measure, "Memory of reading large logs."))
