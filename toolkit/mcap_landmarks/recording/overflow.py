"""Messages of chunks that overlap with more others than memory should hold: they wait in a temporary file."""

import os
import tempfile
from array import array
from collections.abc import Sequence
from contextlib import ExitStack
from struct import Struct
from typing import BinaryIO, Self, cast

from mcap_landmarks import memory
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.recording.chunk_messages import Open
from mcap_landmarks.stage import Connection, RawMessage

_MESSAGE_BYTES = 256
"""A message as an object: a tuple of five, its three numbers, and the head of its payload (CPython 3.11, 64 bits)."""
_HEAD = Struct("<IIQQ")  # the connection's number, sequence, log time, publish time


class Overflow:
    """Bounds what open blocks hold; beyond that, the order of time is made by an external merge of sorted runs.

    Held are up to `memory.SMALL` bytes, or what --max-memory says: with the interpreter and the chunk that is being
    read under 300 MB (`tests.benchmark.memory`). The messages of a block that would be more are written in the order of
    time to one unnamed file in the folder for temporary files (TMPDIR), and read back one by one. That file is emptied
    as soon as no open block has messages in it.
    """

    def __init__(self, place: object) -> None:
        self._place, self._bound = place, memory.most(0)
        self._held: dict[int, int] = {}
        self._spilled: set[int] = set()
        self._ending = ExitStack()
        self._file: BinaryIO | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.close()

    def kept(self, active: Open, number: int, messages: Sequence[RawMessage], size: int) -> Sequence[RawMessage]:
        """The messages of a block of so many bytes that is about to be opened beside others, held or not.

        Raises:
            RecordingError: there is no room for those that cannot be held.
        """
        if not active:
            self._held, self._spilled = {number: size + _MESSAGE_BYTES * len(messages)}, set()
            return messages
        is_open = {entry[1] for entry in active}
        self._held = {key: held for key, held in self._held.items() if key in is_open}
        self._spilled &= is_open
        weight = size + _MESSAGE_BYTES * len(messages)
        if sum(self._held.values()) + weight <= self._bound:
            self._held[number] = weight
            return messages
        try:
            file = self._opened()
            self._spilled.add(number)
            return _written(messages, file)
        except OSError as error:
            raise RecordingError(
                f"{self._place}: {len(is_open) + 1} of its chunks overlap in time, and the folder for temporary files "
                f"has no room for their messages ({error.strerror}); free space there, name one that has some as "
                "TMPDIR, allow more with --max-memory, or read shorter stretches with --start and --end"
            ) from error

    def _opened(self) -> BinaryIO:
        if self._file is None:
            file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - the end of the block closes it
            self._file = self._ending.enter_context(cast(BinaryIO, file))
        if not self._spilled:
            self._file.seek(0)
            self._file.truncate()
        return self._file


def _written(messages: Sequence[RawMessage], file: BinaryIO) -> Sequence[RawMessage]:
    """The messages from the file, at whose end they are written; only where they lie is kept."""
    numbers: dict[Connection, int] = {}
    starts, batch = array("q", [file.tell()]), bytearray()
    for connection, log_time_ns, publish_time_ns, sequence, data in messages:
        key = numbers.setdefault(connection, len(numbers))
        batch += _HEAD.pack(key, sequence, log_time_ns, publish_time_ns)
        batch += data
        starts.append(starts[-1] + _HEAD.size + len(data))
        if len(batch) > 1 << 20:
            _append(file, batch)
            batch.clear()
    _append(file, batch)
    connections, descriptor = list(numbers), file.fileno()

    def message(number: int) -> RawMessage:
        record = os.pread(descriptor, starts[number + 1] - starts[number], starts[number])
        key, sequence, log_time_ns, publish_time_ns = _HEAD.unpack_from(record)
        return RawMessage(connections[key], log_time_ns, publish_time_ns, sequence, record[_HEAD.size :])

    return memory.Lazily(range(len(starts) - 1), message)


def _append(file: BinaryIO, data: bytearray) -> None:
    with memoryview(data) as view:
        written = 0
        while written < len(data):  # a disk that becomes full takes less, and says why at the next call
            written += file.write(view[written:])
