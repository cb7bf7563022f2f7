"""One SQLite file of a ROS 2 bag: its topics, definitions and messages, also where it is damaged."""

import contextlib
import sqlite3
from array import array
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import zstandard

from mcap_landmarks import memory
from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.progress import Progress
from mcap_landmarks.sources._db3_salvage import salvaged_rows
from mcap_landmarks.sources._db3_topics import (
    Db3Topic,
    about_in,
    columns_of,
    definitions_in,
    distribution_in,
    rows_of,
    texts_of,
    topic_of,
)
from mcap_landmarks.sources._definitions import Definitions
from mcap_landmarks.sources._loss_account import LossAccount
from mcap_landmarks.sources._shape import Definition, OmittedTopic, Payload
from mcap_landmarks.sources._verification import defined, settled
from mcap_landmarks.stage import ChannelSummary, Connection, RawMessage
from mcap_landmarks.wording import counted

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_PIECE_BYTES = 256
"""So much is unpacked at a time of what does not say its size: zstd makes at most 128 KiB of 4 bytes (RFC 8878)."""
_REPORT_BYTES = 1 << 20
"""Progress is told each time that so much was read."""
_FIRST, _LAST = -(2**63), 2**63 - 1
"""The limits of SQLite's integers."""
_Row = tuple[int, int, int, bytes]  # time, row id, topic id, data
_Key = tuple[int, int]  # time, row id


def unpacker() -> Callable[[Payload], Payload]:
    """What takes off the compression that a bag may have put on each message; CDR never begins like zstd.

    It raises MessageError where that is damaged. Each has a decompressor, which takes longer to make than to use, and
    serves one thread at a time.
    """
    return partial(_unpacked, zstandard.ZstdDecompressor())


def _unpacked(decompressor: zstandard.ZstdDecompressor, data: Payload) -> Payload:
    if data[:4] != ZSTD_MAGIC:
        return data
    try:
        size = zstandard.frame_content_size(data)
        if size < 0:
            return _unpacked_in_pieces(data)
        if problem := memory.excess(size, len(data)):
            raise MessageError(f"{len(data)} bytes are not decompressed: {problem}")
        return decompressor.decompress(data)
    except (zstandard.ZstdError, MemoryError) as error:
        raise MessageError(f"{len(data)} bytes cannot be decompressed ({error})") from error


def _unpacked_in_pieces(data: bytes | memoryview) -> bytes:
    """A payload that does not say how large it is."""
    stream = zstandard.ZstdDecompressor().decompressobj()
    content, largest = bytearray(), memory.most(len(data))
    for start in range(0, len(data), _PIECE_BYTES):
        if stream.eof:
            break
        content += stream.decompress(data[start : start + _PIECE_BYTES])
        if len(content) > largest:
            raise MessageError(f"{len(data)} bytes unpack to more than {memory.shown(largest)}")
    if not stream.eof:
        raise MessageError(f"{len(data)} bytes cannot be decompressed (they are cut)")
    return bytes(content)


class Db3Log:
    """The log in one file; `definitions` gives the types that the file does not define."""

    def __init__(self, path: Path, definitions: Definitions, origin: Path | None = None) -> None:
        """`origin` is the file that errors name, where `path` is a temporary one."""
        self.losses: list[str] = []
        self.left_out: list[OmittedTopic] = []
        self.account = LossAccount()
        self._path, self._origin = path, origin or path
        self._unpacked = unpacker()
        try:
            with _database(path) as database:
                self._read_topics(database, definitions)
        except (sqlite3.DatabaseError, LookupError, TypeError, ValueError, OverflowError) as error:
            raise RecordingError(
                f"{self._origin} is no ROS 2 bag, or too damaged to read: {error}; copy it again"
            ) from error

    def _read_topics(self, database: sqlite3.Connection, definitions: Definitions) -> None:
        if not {"topics", "messages"} <= columns_of(database, "sqlite_master", "name"):
            raise RecordingError(f"{self._origin} has no tables of topics and messages; it is no ROS 2 bag")
        own, distribution = definitions_in(database), distribution_in(database)
        known = definitions.also(distribution)
        self.about = (self._path.name, about_in(database, distribution))
        self._counts = self._count(database)
        self._topics: dict[int, Db3Topic] = {}
        found = {int(row["id"]): texts_of(row) for row in rows_of(database, "SELECT * FROM topics")}
        rows = {key: row for key, row in found.items() if {"name", "type"} <= row.keys()}
        for key, row in rows.items():
            try:
                self._topics[key] = topic_of(row, own, known)
            except MessageError as error:
                self._leave_out(key, row["name"], row["type"], str(error))
        orphans = sum(count for key, count in self._counts.items() if key not in rows)
        if orphans:
            self.account.add("without_topic", orphans, is_declared=False)
            self._lose(f"{counted(orphans, 'message')} of topics that are nowhere described left out")

    @property
    def channels(self) -> list[ChannelSummary]:
        """See `Log`."""
        return [ChannelSummary(topic.connection, self._counts[key]) for key, topic in self._topics.items()]

    def verify(self, wanted: Callable[[str], bool]) -> None:
        """See `Log`."""
        unsure = {
            key: topic.definitions
            for key, topic in self._topics.items()
            if topic.definitions and wanted(topic.connection.topic)
        }
        for key, found in settled(unsure, self._payloads).items():
            connection = self._topics[key].connection
            if isinstance(found, Definition):
                self._topics[key] = Db3Topic(defined(connection, found))
            else:
                del self._topics[key]
                self._leave_out(key, connection.topic, connection.message_type, found)

    def _payloads(self, keys: Collection[int]) -> Iterator[tuple[int, Payload]]:
        """The messages of some topics as they were sent; what cannot be decompressed is told of when it is read."""
        for _, _, key, data in self._ordered(_FIRST, _LAST):
            if key in keys and isinstance(data, bytes):
                with contextlib.suppress(MessageError):
                    yield key, self._unpacked(data)

    def _leave_out(self, key: int, topic: str, message_type: str, reason: str) -> None:
        if self._counts[key]:
            self.left_out.append(OmittedTopic(topic, message_type, self._counts[key], reason))

    def _count(self, database: sqlite3.Connection) -> Counter[int]:
        counts: Counter[int] = Counter()
        self.start_ns: int | None = None
        self.end_ns: int | None = None
        try:
            counts.update(dict(database.execute("SELECT topic_id, count(*) FROM messages GROUP BY topic_id")))
            if counts:
                self.start_ns = _number(database.execute("SELECT min(timestamp) FROM messages").fetchone()[0])
                self.end_ns = _number(database.execute("SELECT max(timestamp) FROM messages").fetchone()[0])
        except sqlite3.DatabaseError as error:
            self._damaged(error)
            counts.clear()
            times = array("q")
            gaps: list[int | None] = []
            for time_ns, _, topic in salvaged_rows(database, gaps.append):
                counts[topic] += 1
                times.append(time_ns)
            self.account.is_open = None in gaps
            if missing := sum(gap or 0 for gap in gaps):
                if not self.account.is_open:
                    self.account.add("unreadable_rows", missing, is_declared=False)
                self._lose(f"{counted(missing, 'row')} between readable ones cannot be read")
            self.start_ns, self.end_ns = min(times, default=None), max(times, default=None)
        return counts

    def _damaged(self, error: sqlite3.DatabaseError) -> None:
        self.account.add("unreadable_rows", None)
        self._lose(f"it is cut or damaged ({error}); the rows that can be read before and behind the damage were taken")

    def _lose(self, text: str) -> None:
        text = f"{self._path.name}: {text}"
        if text not in self.losses:
            self.losses.append(text)

    def messages(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """See `Log`."""
        wanted = self._wanted(connections)
        first, end = _FIRST if start_ns is None else start_ns, _LAST if end_ns is None else end_ns
        tell, read = progress or (lambda _read: None), 0
        # This loop runs for every message: what it calls has local names, and RawMessage's own constructor, written in
        # Python, is passed over.
        get, new, magic = wanted.get, tuple.__new__, ZSTD_MAGIC
        for time_ns, _, key, data in self._ordered(first, end):
            if type(data) is not bytes or type(time_ns) is not int or time_ns < 0:
                self.account.add("unsound_rows")
                self._lose("rows without a sound time and payload are left out")
                continue
            read += len(data)
            if read >= _REPORT_BYTES:
                tell(read)
                read = 0
            connection = get(key)
            if connection is not None:
                payload = self._payload(connection, data) if data[:4] == magic else data
                if payload is not None:
                    yield new(RawMessage, (connection, time_ns, time_ns, 0, payload))
        tell(read)

    def _wanted(self, connections: Collection[Connection] | None) -> dict[int, Connection]:
        there = {key: topic.connection for key, topic in self._topics.items()}
        return {key: one for key, one in there.items() if connections is None or one in connections}

    def _payload(self, connection: Connection, data: bytes) -> Payload | None:
        try:
            return self._unpacked(data)
        except MessageError as error:
            self.account.add("not_decompressed")
            self._lose(f"{connection.topic}: {error}; such messages are left out")
            return None

    def _ordered(self, first_ns: int, end_ns: int) -> Iterator[_Row]:
        """Rows by time, from the file's index while it lasts, from the rows themselves where that is damaged."""
        last: _Row = (first_ns, _FIRST, 0, b"")
        with _database(self._path) as database:
            try:
                for last in _by_time(database, first_ns, end_ns):
                    yield last
            except sqlite3.DatabaseError as error:
                self._damaged(error)
                yield from _salvaged(database, last[:2], end_ns)


@contextlib.contextmanager
def _database(path: Path) -> Iterator[sqlite3.Connection]:
    """The file, opened so that neither it nor its folder changes; a cut file opens too, as far as it goes."""
    log = path.with_name(f"{path.name}-wal")
    mode = "mode=ro" if log.exists() and log.stat().st_size else "immutable=1"
    database = sqlite3.connect(f"{path.resolve().as_uri()}?{mode}", uri=True)
    database.row_factory = sqlite3.Row
    with contextlib.closing(database):
        try:
            database.execute("SELECT count(*) FROM sqlite_master").fetchone()
        except sqlite3.DatabaseError:
            database.execute("PRAGMA writable_schema=ON")  # SQLite then reads a file that is shorter than it says
        yield database


def _number(value: object) -> int:
    """A time as recordings can hold it, zero for anything else that a damaged row may have there."""
    return value if isinstance(value, int) and value >= 0 else 0


def _by_time(database: sqlite3.Connection, first_ns: int, end_ns: int) -> Iterator[_Row]:
    within, order = "FROM messages WHERE timestamp >= ? AND timestamp < ?", "ORDER BY timestamp, rowid"
    whole = f"SELECT timestamp, rowid, topic_id, data {within} {order}"
    plan = database.execute(f"EXPLAIN QUERY PLAN {whole}", (first_ns, end_ns)).fetchall()
    if not any("TEMP B-TREE" in row[3] for row in plan):
        cursor = database.cursor()
        cursor.row_factory = None  # plain tuples: names for the columns of each row take as long as reading it
        return cursor.execute(whole, (first_ns, end_ns))
    keys = database.execute(f"SELECT timestamp, rowid {within} {order}", (first_ns, end_ns))
    return _fetched(database, ((int(row[0]), int(row[1])) for row in keys))


def _fetched(database: sqlite3.Connection, keys: Iterator[_Key]) -> Iterator[_Row]:
    """Rows one by one: sorting them whole would take their payloads along."""
    for time_ns, row in keys:
        found = database.execute("SELECT topic_id, data FROM messages WHERE rowid = ?", (row,)).fetchone()
        if found is not None:  # an index may name rows that are gone
            yield time_ns, row, found[0], found[1]


def _salvaged(database: sqlite3.Connection, after: _Key, end_ns: int) -> Iterator[_Row]:
    times, rows = array("q"), array("q")
    for time_ns, row, _ in salvaged_rows(database, lambda _count: None):
        if after < (time_ns, row) and time_ns < end_ns:
            times.append(time_ns)
            rows.append(row)
    for i in np.lexsort((rows, times)).tolist():
        with contextlib.suppress(sqlite3.DatabaseError):
            yield from _fetched(database, iter([(times[i], rows[i])]))
