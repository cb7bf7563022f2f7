"""What a stage sees of a log: the recording's own messages, and results that lie in it or in other files."""

import heapq
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import STAGE, StageRecord, stage_records
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.chunk_copy import WholeChunk
from mcap_landmarks.recording.declared_channels import Declared
from mcap_landmarks.recording.reader import Recording
from mcap_landmarks.recording.shared_channels import SharedTransforms, result_connection, shared_in
from mcap_landmarks.stage import ChannelSummary, Connection, RawMessage

_Piece = TypeVar("_Piece", bound=RawMessage | WholeChunk)


class Part(NamedTuple):
    """Some messages of a recording's connection: those for which `is_meant` holds."""

    connection: Connection
    is_meant: Callable[[RawMessage], bool]


@dataclass(frozen=True, slots=True, eq=False)
class Layer:
    """Some channels of an open recording; with `record` they hold the results of a stage.

    Those in `parts` stand for a part of a connection's messages: results on a channel of the log's own, or the rest.
    """

    recording: Recording
    channels: tuple[ChannelSummary, ...]
    record: StageRecord | None = None
    parts: Mapping[Connection, Part] = field(default_factory=dict)

    def messages(
        self,
        wanted: Collection[Connection],
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """See `Recording.messages`."""
        found = self.recording.messages(self._recorded(wanted), start_ns, end_ns, progress)
        return self._meant(found, wanted)

    def pieces(
        self,
        wanted: Collection[Connection],
        kept: Collection[Connection],
        declared: Declared,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage | WholeChunk]:
        """See `Recording.pieces`."""
        shared = {part.connection for part in self.parts.values()}
        whole = [connection for connection in kept if connection not in shared]
        found = self.recording.pieces(self._recorded(wanted), whole, declared, start_ns, end_ns, progress)
        return self._meant(found, wanted)

    def size_bytes(self, wanted: Collection[Connection], start_ns: int | None, end_ns: int | None) -> int:
        """See `Recording.size_bytes`."""
        return self.recording.size_bytes(self._recorded(wanted), start_ns, end_ns)

    def _recorded(self, wanted: Collection[Connection]) -> set[Connection]:
        return {self.parts[one].connection if one in self.parts else one for one in wanted}

    def _meant(self, pieces: Iterator[_Piece], wanted: Collection[Connection]) -> Iterator[_Piece]:
        """The pieces that are meant, under the connections that stand for them."""
        seen_as = {part.connection: (seen, part) for seen, part in self.parts.items() if seen in wanted}
        return _only_meant(pieces, seen_as) if seen_as else pieces


def _only_meant(pieces: Iterator[_Piece], seen_as: Mapping[Connection, tuple[Connection, Part]]) -> Iterator[_Piece]:
    for piece in pieces:
        if isinstance(piece, RawMessage) and piece.connection in seen_as:
            seen, part = seen_as[piece.connection]
            if part.is_meant(piece):
                yield piece._replace(connection=seen)
        else:
            yield piece


class LayeredLog:
    """Layers that are read as one recording. Messages of equal time come in the order of the layers."""

    def __init__(self, path: Location, layers: Sequence[Layer]) -> None:
        self.path, self.layers = path, tuple(layers)
        self.channels = tuple(entry for layer in layers for entry in layer.channels)

    @property
    def losses(self) -> list[str]:
        """What could not be read so far."""
        return list(dict.fromkeys(loss for layer in self.layers for loss in layer.recording.losses))

    def told_damage(self) -> str:
        """Why something may be missing in it, and what to do; empty where all could be read so far."""
        if not self.losses:
            return ""
        return (
            f"not all of the file could be read ({self.losses[0]}), so copy it again, or save what is sound: "
            f"mcap-landmarks recover {self.path} -o OUT.mcap"
        )

    def times_ns(self) -> tuple[int | None, int | None]:
        """The first and the last log time of all layers' recordings, None where they hold no messages."""
        firsts = [layer.recording.start_ns for layer in self.layers if layer.recording.start_ns is not None]
        lasts = [layer.recording.end_ns for layer in self.layers if layer.recording.end_ns is not None]
        return min(firsts, default=None), max(lasts, default=None)

    def messages(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """See `Recording.messages`."""
        streams = [layer.messages(wanted, start_ns, end_ns, progress) for layer, wanted in self._wanted(connections)]
        return streams[0] if len(streams) == 1 else heapq.merge(*streams, key=_log_time)

    def pieces(
        self,
        kept: Collection[Connection],
        declared: Declared,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage | WholeChunk]:
        """All messages, for a copy; see `Recording.pieces`."""
        streams = [
            layer.pieces(wanted, kept, declared, start_ns, end_ns, progress) for layer, wanted in self._wanted(None)
        ]
        return streams[0] if len(streams) == 1 else heapq.merge(*streams, key=_log_time)

    def size_bytes(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> int:
        """See `Recording.size_bytes`."""
        return sum(layer.size_bytes(wanted, start_ns, end_ns) for layer, wanted in self._wanted(connections))

    def count(self, connections: Collection[Connection], start_ns: int | None, end_ns: int | None) -> int:
        """About how many messages there are, as if they came evenly."""
        total = 0.0
        for layer in self.layers:
            first, last = layer.recording.start_ns or 0, layer.recording.end_ns or 0
            share = (min(end_ns or last, last) - max(start_ns or first, first)) / max(last - first, 1)
            count = sum(entry.count for entry in layer.channels if entry.connection in connections)
            total += count * (share if (start_ns, end_ns) != (None, None) else 1.0)
        return max(round(total), 0)

    def _wanted(self, connections: Collection[Connection] | None) -> list[tuple[Layer, list[Connection]]]:
        found = []
        for layer in self.layers:
            own = [entry.connection for entry in layer.channels]
            wanted = own if connections is None else [connection for connection in own if connection in connections]
            if wanted:
                found.append((layer, wanted))
        return found


def _log_time(piece: RawMessage | WholeChunk) -> int:
    return piece.log_time_ns


def own_layer(recording: Recording) -> Layer:
    """What a recording holds beside the results of stages; all of it, if it was edited since we wrote it."""
    if not recording.is_ours:
        return Layer(recording, recording.channels)
    shared = {one.connection: transforms for _, one, transforms in _shared(recording)}
    channels = tuple(
        ChannelSummary(entry.connection, entry.count - shared[entry.connection].count)
        if entry.connection in shared
        else entry
        for entry in recording.channels
        if STAGE not in entry.connection.metadata
    )
    return Layer(recording, channels, parts={one: Part(one, found.has_not) for one, found in shared.items()})


def result_layers(recording: Recording) -> dict[str, Layer]:
    """The results that a recording of ours holds, by stage."""
    if not recording.is_ours:
        return {}
    shared = _shared(recording)
    found = {}
    for name, record in stage_records(recording.metadata).items():
        own = [entry for entry in recording.channels if entry.connection.metadata.get(STAGE) == name]
        parts = dict[Connection, Part]()
        for stage, entry, transforms in shared:
            if stage == name:
                one = result_connection(entry.connection.topic, entry.connection.message_type, stage)
                parts[one] = Part(entry.connection, transforms.has)
                own.append(ChannelSummary(one, transforms.count))
        found[name] = Layer(recording, tuple(own), record, parts)
    return found


def _shared(recording: Recording) -> list[tuple[str, ChannelSummary, SharedTransforms]]:
    """The stages with results on a channel of the log's own, with that and with what tells them."""
    by_id = {recording.ids(entry.connection)[0]: entry for entry in recording.channels}
    found = shared_in(recording.metadata).items()
    return [(stage, by_id[one.channel_id], one) for stage, one in found if one.channel_id in by_id]
