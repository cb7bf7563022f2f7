"""The logs that are merged into one output: their channels as one set, and their messages by time."""

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.inspection.mcap_log import McapLog
from mcap_landmarks.inspection.open_logs import OpenLog
from mcap_landmarks.messages.qos import KEY, numbered
from mcap_landmarks.moments import moment
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.chunk_copy import WholeChunk
from mcap_landmarks.recording.latched import latched, latest
from mcap_landmarks.recording.summary_index import Block
from mcap_landmarks.recording.writer import RecordingWriter
from mcap_landmarks.runs.output_formats import OutputFormat, refusal
from mcap_landmarks.runs.rosbag2_metadata import joined_profiles
from mcap_landmarks.runs.splitting import TimedBytes
from mcap_landmarks.runs.topic_selection import Selection
from mcap_landmarks.sources import OmittedTopic, Piece, merge, together
from mcap_landmarks.stage import Connection, RawMessage

_TWO_TYPES = "other messages of the topic have another type or definition, and a bag's topic has one; --types chooses"
_COMMENT = re.compile(rb"#[^\n]*")


class ConversionInputs:
    """Logs, and the connection that stands in the output for each wanted one of theirs: equal ones share theirs.

    `declared` are the messages by connection of the output that the storage declares. `left_out` are wanted topics that
    nobody can understand, or that the format `to` cannot hold.

    Raises:
        RecordingError: no topic can be carried, or with `strict` one cannot.
        UsageError: the selection does not fit the logs.
    """

    def __init__(
        self, logs: Sequence[OpenLog], selection: Selection, *, strict: bool, to: OutputFormat = OutputFormat.MCAP
    ) -> None:
        self.logs, self.selection, self.to = logs, selection, to
        self.parts = [part for log in logs for part in log.parts]
        for log in logs:
            log.verify(selection.may_want)
        left_out = (one for log in logs for one in log.left_out)
        self.left_out = together(one for one in left_out if selection.wants(one.topic, one.message_type))
        self.declared: Counter[Connection] = Counter()
        self._held: tuple[int | None, list[RawMessage]] = (None, [])
        self._unified = self._unify()
        if self.left_out and (strict or not self._unified):
            raise RecordingError(f"{self.where}: {'; '.join(one.told for one in self.left_out)}")

    def _unify(self) -> dict[Connection, Connection]:
        unified: dict[Connection, Connection] = {}
        known: dict[tuple[object, ...], Connection] = {}
        entries = [entry for part in self.parts for entry in part.channels]
        if not self.left_out:
            self.selection.check((entry.connection for entry in entries), self.where)
        for entry in entries:
            connection = entry.connection
            if not self.selection.wants(connection.topic, connection.message_type):
                continue
            if reason := refusal(self.to, connection):
                if entry.count:
                    omitted = OmittedTopic(connection.topic, connection.message_type, entry.count, reason)
                    self.left_out = together([*self.left_out, omitted])
                continue
            renamed = self.selection.renamed(connection)
            unified[connection] = known.setdefault(_identity(renamed), renamed)
        if self.to is not OutputFormat.MCAP:
            unified = self._by_topic(unified)
        for entry in entries:
            if entry.connection in unified:
                self.declared[unified[entry.connection]] += entry.count
        return unified

    def _by_topic(self, unified: Mapping[Connection, Connection]) -> dict[Connection, Connection]:
        """Connections as bags have them: one of each topic, with the profiles of all, as every version reads them."""
        several: dict[str, list[Connection]] = {}
        for own in dict.fromkeys(unified.values()):
            several.setdefault(own.topic, []).append(own)
        stands = {one: first for ones in several.values() for one, first in _as_one(ones).items()}
        counts = {entry.connection: entry.count for part in self.parts for entry in part.channels}
        others = [one for one, own in unified.items() if own not in stands]
        omitted = (OmittedTopic(one.topic, one.message_type, counts[one], _TWO_TYPES) for one in others if counts[one])
        self.left_out = together([*self.left_out, *omitted])
        return {one: stands[own] for one, own in unified.items() if own in stands}

    @property
    def connections(self) -> list[Connection]:
        """The connections of the output."""
        return list(dict.fromkeys(self._unified.values()))

    @property
    def where(self) -> str:
        """The paths of the logs."""
        return ", ".join(dict.fromkeys(str(log.path) for log in self.logs))

    @property
    def lasts(self) -> str:
        """Their time, in words."""
        starts = [log.start_ns for log in self.logs if log.start_ns is not None]
        ends = [log.end_ns for log in self.logs if log.end_ns is not None]
        return f"from {moment(min(starts))} to {moment(max(ends))}" if starts and ends else "no time at all"

    @property
    def losses(self) -> list[str]:
        """What could not be read so far."""
        losses = [loss for log in self.logs for loss in log.losses]
        return losses + [loss for part in self.parts for loss in part.losses]

    def declare(self, writer: RecordingWriter, *, by_chunk: bool) -> list[Connection]:
        """Declare the connections of the output; those of the logs that have the same ids there, if these matter."""
        kept = []
        for part in self.parts:
            known = part.ids() if isinstance(part, McapLog) and by_chunk else {}
            for connection in (entry.connection for entry in part.channels if entry.connection in self._unified):
                own, ids = self._unified[connection], known.get(connection)
                if ids is not None:
                    writer.keep(own, *ids)
                writer.declare(own)
                if ids is not None and writer.declared().ids[own] == ids[0]:
                    kept.append(connection)
        return kept

    def pieces(
        self,
        writer: RecordingWriter,
        kept: Collection[Connection],
        span: tuple[int | None, int | None],
        advance: Progress,
    ) -> Iterator[RawMessage | WholeChunk]:
        """The messages of all parts by time, on the connections of the output, and whole chunks of them."""
        wanted, declared = set(self._unified), writer.declared()
        pieces: list[Piece[RawMessage | WholeChunk]] = []
        for part in self.parts:
            if part.start_ns is not None and isinstance(part, McapLog):
                pieces.append((part.start_ns, partial(part.pieces, wanted, kept, declared, *span, advance)))
            elif part.start_ns is not None:
                pieces.append((part.start_ns, partial(part.messages, wanted, *span, advance)))
        for piece in merge(pieces):
            if isinstance(piece, WholeChunk) or (own := self._unified[piece.connection]) is piece.connection:
                yield piece
            else:
                yield piece._replace(connection=own)

    def messages(self, span: tuple[int | None, int | None], advance: Progress) -> Iterator[RawMessage]:
        """The messages of all parts by time, on the connections of the output."""
        for raw in self._messages(self._unified, *span, advance):
            yield raw._replace(connection=self._unified[raw.connection])

    def before(self, start_ns: int) -> list[RawMessage]:
        """What holds at a start because of messages before it; of those before an earlier start, what held at that."""
        holding = set(latched(self._unified.values()))
        held = [connection for connection, own in self._unified.items() if own in holding]
        since_ns, known = self._held if self._held[0] is None or self._held[0] <= start_ns else (None, [])
        raws = self._messages(held, since_ns, start_ns)
        later = (raw._replace(connection=self._unified[raw.connection]) for raw in raws)
        self._held = start_ns, latest(chain(known, later), start_ns)
        return self._held[1]

    def stretches(self, *, by_message: bool) -> Iterator[TimedBytes]:
        """The bytes of the messages in the time range, by time; of whole chunks, unless each message is asked for."""
        blocks = None if by_message else self._blocks()
        if blocks is None:
            for raw in self._messages(self._unified, *self.selection.span):
                yield TimedBytes(raw.log_time_ns, raw.log_time_ns, len(raw.data))
            return
        first, end = self.selection.start_ns or 0, self.selection.end_ns or 2**64
        for block in blocks:
            if block.end_ns >= first and block.start_ns < end:
                yield TimedBytes(max(block.start_ns, first), min(block.end_ns, end - 1), block.length)

    def _blocks(self) -> list[Block] | None:
        """The blocks of all parts by their start; None where there are none, or some hold other messages, too."""
        blocks: list[Block] = []
        for part in self.parts:
            found = part.blocks(self._unified) if isinstance(part, McapLog) else None
            if found is None:
                return None
            blocks += found
        return sorted(blocks, key=lambda block: block.start_ns)

    def _messages(
        self,
        connections: Collection[Connection],
        start_ns: int | None,
        end_ns: int | None,
        advance: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """The messages of some connections, of all parts by time."""
        pieces: list[Piece[RawMessage]] = [
            (part.start_ns, partial(part.messages, set(connections), start_ns, end_ns, advance))
            for part in self.parts
            if part.start_ns is not None
        ]
        return merge(pieces)


def _identity(connection: Connection) -> tuple[object, ...]:
    """What makes connections one channel: topic, type and quality of service, where the definitions agree."""
    definition = tuple(_COMMENT.sub(b"", connection.schema).split())
    quality = connection.metadata.get(KEY)
    encodings = connection.message_encoding, connection.schema_encoding
    return connection.topic, connection.message_type, encodings, definition, quality


def _as_one(connections: Sequence[Connection]) -> dict[Connection, Connection]:
    """What stands for those of a topic that have the type of the first one: that, with the profiles of all."""
    first = connections[0]
    alike = [one for one in connections if _identity(one)[:-1] == _identity(first)[:-1]]
    profiles = joined_profiles(one.metadata.get(KEY, "") for one in alike)
    return dict.fromkeys(alike, replace(first, metadata={**first.metadata, KEY: numbered(profiles)}))
