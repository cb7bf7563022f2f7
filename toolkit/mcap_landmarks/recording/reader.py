"""Read recordings: by index where there is one, by scanning where there is none, in the order of log time."""

import contextlib
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextvars import ContextVar
from functools import cached_property, partial
from itertools import chain
from typing import BinaryIO, TypeVar

from mcap import records
from mcap.exceptions import McapError

from mcap_landmarks import memory
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import RUN, STAGE, carried_fingerprint
from mcap_landmarks.messages.gathering import empty_table
from mcap_landmarks.messages.layout import Layout
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.blocks import DamagedBlockError, block_content
from mcap_landmarks.recording.channel_columns import ChannelColumns, GatheredBlocks, Wanted, rows_in
from mcap_landmarks.recording.chunk_copy import WholeChunk, read_whole
from mcap_landmarks.recording.chunk_messages import Open, drain, is_alone, push
from mcap_landmarks.recording.container import parse
from mcap_landmarks.recording.content_hash import has_every_crc, hash_of
from mcap_landmarks.recording.damage import SuspectChunk
from mcap_landmarks.recording.declared_channels import Declared
from mcap_landmarks.recording.large_chunks import messages_of
from mcap_landmarks.recording.opening import index_of, open_stream
from mcap_landmarks.recording.overflow import Overflow
from mcap_landmarks.recording.reading_ahead import reading
from mcap_landmarks.recording.record_shapes import check_attachment
from mcap_landmarks.recording.summary_index import Block, Index, indexed_messages, read_record
from mcap_landmarks.stage import ChannelSummary, Connection, RawMessage

T = TypeVar("T")
_from_front: ContextVar[bool] = ContextVar("from_front", default=False)


@contextlib.contextmanager
def reading_from_front() -> Iterator[None]:
    """Open every recording in this block as `--lenient` says: by reading it from the front, whatever its summary says.

    A context variable, as what verbs do with logs is no matter of how these are read; threads begin without it.
    """
    token = _from_front.set(True)
    try:
        yield
    finally:
        _from_front.reset(token)


def reads_from_front() -> bool:
    """Whether `reading_from_front` holds."""
    return _from_front.get()


@contextlib.contextmanager
def open_recording(
    path: Location,
    *,
    verify: bool = True,
    known: Index | None = None,
    from_front: bool = False,
    progress: Progress | None = None,
) -> Iterator["Recording"]:
    """An open recording; `verify` checks the CRC of every chunk that is read.

    `known` is its index from the last time that it was open. With `from_front` all of it is read to find out what it
    holds, and `progress` told the bytes; else its summary is taken at its word, where the records agree with that.

    Raises:
        RecordingError: there is no such file, or it is not an MCAP file.
    """
    memory.keep_room()
    with open_stream(path) as stream:
        index = known or index_of(path, stream, from_front=from_front or _from_front.get(), progress=progress)
        yield Recording(path, stream, index, verify=verify)


class Recording:
    """An open recording; made by `open_recording`.

    `channels` lists every channel with its count, `start_ns` and `end_ns` are the first and last log time.
    `metadata_records` come in the order of the file, `metadata` holds the entries of the last of each name. `damage`
    is the account of what could not be read, so far, and `index` where everything lies.
    """

    def __init__(self, path: Location, stream: BinaryIO, index: Index, *, verify: bool) -> None:
        self.path = path
        self.profile, self.library = index.header.profile, index.header.library
        self.start_ns, self.end_ns = index.start_ns, index.end_ns
        self.metadata_records = tuple(index.metadata_records)
        self.metadata = dict(self.metadata_records)
        self.index, self.damage = index, index.damage
        self._stream, self._verify = stream, verify
        self._lost_attachments: list[str] = []
        self._connections = {key: index.connection(key) for key in sorted(index.channels)}
        self._ids = {connection: key for key, connection in self._connections.items()}
        self.channels = tuple(
            ChannelSummary(connection, index.counts.get(key, 0)) for key, connection in self._connections.items()
        )

    @property
    def losses(self) -> list[str]:
        """What could not be read so far, in words."""
        return [*self.damage.losses, *self._lost_attachments]

    @property
    def notes(self) -> list[str]:
        """What is odd about the file and costs nothing, in words."""
        return self.damage.notes

    def connections(self, topic: str) -> tuple[Connection, ...]:
        """The connections of a topic, most often one."""
        return tuple(entry.connection for entry in self.channels if entry.connection.topic == topic)

    def fingerprint(self) -> str:
        """Identity by content: that of the recording whose results this one carries, else a hash over its blocks."""
        return self._carried or self._hash(is_foreign=True)

    @property
    def is_ours(self) -> bool:
        """Whether the manifest belongs to the content: an output of ours that nobody edited."""
        return self._carried is not None

    @cached_property
    def _carried(self) -> str | None:
        return carried_fingerprint(self.metadata, self._hash(is_foreign=False)) if RUN in self.metadata else None

    def _hash(self, *, is_foreign: bool) -> str:
        """A hash over the blocks, all or those with messages that are no results: an append leaves these alone."""
        results = {key for key, connection in self._connections.items() if STAGE in connection.metadata}
        blocks = [
            block
            for block in self.index.blocks
            if not (is_foreign and block.channel_ids is not None and block.channel_ids <= results)
        ]
        return hash_of(self._stream, blocks)

    def content_hash(self) -> str | None:
        """A hash over all chunks, None if some content has no CRC to stand for it."""
        return self._hash(is_foreign=False) if has_every_crc(self._stream, self.index.blocks) else None

    def attachments(self) -> Iterator[records.Attachment]:
        """The attachments, whole, in the order of the file; those that are damaged are told in `losses`."""
        for offset in self.index.attachments:
            try:
                _, content = read_record(self._stream, offset)
                check_attachment(content)
                attachment = parse(records.Attachment, content)
            except (EOFError, McapError, ValueError):
                loss = f"the attachment at byte {offset} is damaged (its CRC does not match)"
                self._lost_attachments += [loss] if loss not in self._lost_attachments else []
            else:
                yield attachment

    def messages(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """Messages by log time, all or those of some connections, from `start_ns` on and before `end_ns`.

        Holds only the chunks in memory that overlap in time, and of these no more than `Overflow` says. `progress` is
        told the bytes of each chunk that was read.
        """
        wanted, first, last = self._wanted(connections), start_ns or 0, 2**64 if end_ns is None else end_ns
        return chain.from_iterable(self._runs(wanted, (first, last), progress))

    def columns(
        self,
        connection: Connection,
        layout: Layout,
        fields: Collection[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> ChannelColumns:
        """Some fields of a connection's messages, by default all; which, and in what order, as `messages` gives them.

        `layout` is that of their type. One chunk is held in memory, and the columns.

        Raises:
            MessageError: the type has no such field.
        """
        within, key = (start_ns or 0, 2**64 if end_ns is None else end_ns), self._ids[connection]
        empty = empty_table(layout, fields)
        found = GatheredBlocks(empty, self.index.counts.get(key, 0))
        wanted = Wanted(key, layout, empty.columns, within, [])
        with reading(self._stream, self._blocks({key: connection}, *within), self.index.blocks) as blocks:
            for block in blocks:
                rows = self._take(block, partial(rows_in, self._stream, block, wanted), progress)
                if rows is not None:
                    found.add(rows)
        return found.columns()

    def pieces(
        self,
        connections: Collection[Connection],
        kept: Collection[Connection],
        declared: Declared,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage | WholeChunk]:
        """What `messages` gives, for a copy: whole chunks come as they are, in place of their messages, where they may.

        `kept` are the connections that are declared in the copy with the ids that they have here.
        """
        wanted, first, last = self._wanted(connections), start_ns or 0, 2**64 if end_ns is None else end_ns
        ids = frozenset(self._wanted(kept)) & wanted.keys()
        active: Open = []
        meant = self._blocks(wanted, first, last)
        with reading(self._stream, meant, self.index.blocks) as blocks, Overflow(self.path) as overflow:
            for number, block in enumerate(blocks):
                yield from chain.from_iterable(drain(active, block.start_ns))
                chunk = None
                if first <= block.start_ns and block.end_ns < last:
                    chunk = read_whole(self._stream, block, ids, declared, verify=self._verify)
                if chunk is not None:
                    yield from chain.from_iterable(drain(active, block.start_ns + 1))
                    if progress:
                        progress(block.length)
                    yield chunk
                else:
                    found, size = self._load(block, wanted, progress)
                    push(active, number, overflow.kept(active, number, found, size), first, last)
            yield from chain.from_iterable(drain(active, 2**64))

    def blocks(self, connections: Collection[Connection]) -> list[Block] | None:
        """The blocks with messages of some connections, by their start; None if some hold messages of others, too."""
        wanted = self._wanted(connections)
        blocks = self._blocks(wanted, 0, 2**64)
        is_known = all(block.channel_ids is not None and block.channel_ids <= wanted.keys() for block in blocks)
        return blocks if is_known else None

    def ids(self, connection: Connection) -> tuple[int, int]:
        """The ids of a connection's channel and schema."""
        channel_id = self._ids[connection]
        return channel_id, self.index.channels[channel_id].schema_id

    def size_bytes(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> int:
        """The bytes that `messages` reads for the same arguments: chunks without a wanted channel are passed over."""
        blocks = self._blocks(self._wanted(connections), start_ns or 0, 2**64 if end_ns is None else end_ns)
        return sum(block.length for block in blocks)

    def _wanted(self, connections: Collection[Connection] | None) -> dict[int, Connection]:
        return {key: c for key, c in self._connections.items() if connections is None or c in connections}

    def _blocks(self, wanted: dict[int, Connection], first_ns: int, last_ns: int) -> list[Block]:
        """The blocks that may hold wanted messages of those times, by their start."""
        within = (block for block in self.index.blocks if block.end_ns >= first_ns and block.start_ns < last_ns)
        blocks = (block for block in within if not (block.channel_ids and block.channel_ids.isdisjoint(wanted)))
        return sorted(blocks, key=lambda block: (block.start_ns, block.offset))

    def _load(
        self, block: Block, wanted: dict[int, Connection], progress: Progress | None
    ) -> tuple[Sequence[RawMessage], int]:
        """The wanted messages of a block, and how many bytes they keep in memory."""
        return self._take(block, partial(messages_of, wanted), progress) or ([], 0)

    def _take(self, block: Block, take: Callable[[memoryview], T], progress: Progress | None) -> T | None:
        """What is made of a block's content; None if it is damaged, which the account then says."""
        found = None
        try:
            found = take(block_content(self._stream, block, verify=self._verify))
        except DamagedBlockError as error:
            self.damage = self.damage.with_suspect(
                SuspectChunk(block.offset, indexed_messages(self._stream, block), str(error))
            )
        if progress:
            progress(block.length)
        return found

    def _runs(
        self, wanted: dict[int, Connection], within_ns: tuple[int, int], progress: Progress | None
    ) -> Iterator[Iterable[RawMessage]]:
        """Messages in the order of time, in runs of one block; blocks may overlap."""
        active: Open = []
        meant = self._blocks(wanted, *within_ns)
        nexts_ns = [*(block.start_ns for block in meant[1:]), 2**64]
        with reading(self._stream, meant) as blocks, Overflow(self.path) as overflow:
            for number, block in enumerate(blocks):
                if active:
                    yield from drain(active, block.start_ns)
                found, size = self._load(block, wanted, progress)
                if not active and is_alone(found, *within_ns, nexts_ns[number]):
                    yield found
                else:
                    push(active, number, overflow.kept(active, number, found, size), *within_ns)
            yield from drain(active, 2**64)
