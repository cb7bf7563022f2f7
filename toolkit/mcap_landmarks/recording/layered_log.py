"""What a stage sees of a log: the recording's own messages, and results that lie in it or in other files."""

import heapq
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import STAGE, StageRecord, stage_records
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.chunk_copy import WholeChunk
from mcap_landmarks.recording.declared_channels import Declared
from mcap_landmarks.recording.reader import Recording
from mcap_landmarks.stage import ChannelSummary, Connection, RawMessage


@dataclass(frozen=True, slots=True, eq=False)
class Layer:
    """Some channels of an open recording; with `record` they hold the results of a stage."""

    recording: Recording
    channels: tuple[ChannelSummary, ...]
    record: StageRecord | None = None


class LayeredLog:
    """Layers that are read as one recording. Messages of equal time come in the order of the layers."""

    def __init__(self, path: Location, layers: Sequence[Layer]) -> None:
        self.path, self.layers = path, tuple(layers)
        self.channels = tuple(entry for layer in layers for entry in layer.channels)

    @property
    def losses(self) -> list[str]:
        """What could not be read so far."""
        return list(dict.fromkeys(loss for layer in self.layers for loss in layer.recording.losses))

    def messages(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """See `Recording.messages`."""
        streams = [
            layer.recording.messages(wanted, start_ns, end_ns, progress) for layer, wanted in self._wanted(connections)
        ]
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
            layer.recording.pieces(wanted, kept, declared, start_ns, end_ns, progress)
            for layer, wanted in self._wanted(None)
        ]
        return streams[0] if len(streams) == 1 else heapq.merge(*streams, key=_log_time)

    def size_bytes(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> int:
        """See `Recording.size_bytes`."""
        return sum(layer.recording.size_bytes(wanted, start_ns, end_ns) for layer, wanted in self._wanted(connections))

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
    return Layer(recording, tuple(entry for entry in recording.channels if STAGE not in entry.connection.metadata))


def result_layers(recording: Recording) -> dict[str, Layer]:
    """The results that a recording of ours holds, by stage."""
    if not recording.is_ours:
        return {}
    return {
        name: Layer(
            recording,
            tuple(entry for entry in recording.channels if entry.connection.metadata.get(STAGE) == name),
            record,
        )
        for name, record in stage_records(recording.metadata).items()
    }
