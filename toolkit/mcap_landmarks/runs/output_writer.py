"""The output of a run: a log's own messages with the results of all stages, each stage's in chunks of its own."""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from operator import itemgetter

from mcap_landmarks.channels import SHARED
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import (
    CARRIED,
    CONTENT,
    LOSSES,
    RUN,
    SHARED_CHANNELS,
    STAGE,
    Manifest,
    entry_text,
    is_generated,
    narrowed,
    told_carried,
    told_losses,
)
from mcap_landmarks.progress import Watch
from mcap_landmarks.recording.chunk_copy import WholeChunk
from mcap_landmarks.recording.latched import carried_note, latched, latest
from mcap_landmarks.recording.layered_log import Layer, LayeredLog, own_layer
from mcap_landmarks.recording.reader import Recording
from mcap_landmarks.recording.shared_channels import SharedTransforms, can_share
from mcap_landmarks.recording.summary_index import MetadataRecord
from mcap_landmarks.recording.writer import RecordingWriter, create_recording, profile_of
from mcap_landmarks.runs.bag_record import bag_of
from mcap_landmarks.runs.rosbag2_metadata import RECORD, record_of
from mcap_landmarks.runs.session import Session
from mcap_landmarks.sources import recorded_metadata
from mcap_landmarks.stage import Connection, RawMessage

_OF_THE_CONTENT = frozenset({CONTENT, LOSSES, CARRIED, SHARED_CHANNELS})
"""Entries of the manifest that tell of what was written, not of what was asked for."""


def write_output(
    session: Session, output: Location, verb: str, inputs: Sequence[str], watch: Watch
) -> tuple[list[str], list[str]]:
    """Write the output, unless it is there already; notes on what is in it, and what of the log is unreadable.

    `inputs` are the fingerprints of all recordings that the results were made from.

    Raises:
        ToolkitError: the output cannot be written; nothing is left behind.
    """
    results, notes = session.kept_results()
    request, source = session.request, session.log.recording
    fingerprint = narrowed(session.log.fingerprint, results_only=request.results_only)
    cut = (request.span.start_ns, request.span.end_ns) != (None, None)
    records = tuple(
        replace(layer.record, is_cut=layer.record.is_cut or (cut and layer.record.stage not in session.of_this_run))
        for layer in results
        if layer.record is not None
    )
    manifest = Manifest(
        verb,
        inputs=tuple(inputs),
        options=request.options(),
        fingerprint=fingerprint,
        stages=records,
        generated=is_generated(source.metadata),
    )
    entries = manifest.entries()
    own = _own(session, results)
    earlier = session.earlier
    if not request.force and earlier is not None and _is_there(earlier, entries, own, results, source):
        losses, carried = [*source.losses, *told_losses(earlier.metadata)], told_carried(earlier.metadata)
    else:
        losses, carried = _write(session, output, entries, [own, *_shared_last(results)], watch)
    return [*notes, *([carried_note(carried)] if carried else [])], losses


def _write(
    session: Session, output: Location, entries: Mapping[str, str], layers: Sequence[Layer], watch: Watch
) -> tuple[list[str], dict[str, int]]:
    """Write the output; what of the log is unreadable, and what was carried over from before its start, by topic."""
    span, source, view = session.request.span, session.log.recording, LayeredLog(session.log.path, layers)
    carried = [] if span.start_ns is None else _before(view, span.start_ns)
    counts = dict(Counter(raw.connection.topic for raw in carried))
    size = view.size_bytes(None, span.start_ns, span.end_ns)
    profile = profile_of(entry.connection for entry in view.channels)
    records = source.metadata_records
    with (
        create_recording(output, {RUN: entries}, profile=profile, carried=records) as writer,
        watch(f"write {output.name}", size) as progress,
    ):
        clean, kept = _declare(writer, layers[0], joined := _joined(layers))
        pieces = view.pieces(kept, writer.declared(), span.start_ns, span.end_ns, progress)
        shared = _put(writer, chain(carried, pieces), clean, joined)
        for attachment in () if session.request.results_only else source.attachments():
            writer.attach(attachment)
        _renew(writer, source)
        told = {LOSSES: source.losses, CARRIED: counts, SHARED_CHANNELS: shared}
        writer.metadata[RUN].update({name: entry_text(value) for name, value in told.items() if value})
    return list(source.losses), counts


def _put(
    writer: RecordingWriter,
    pieces: Iterable[RawMessage | WholeChunk],
    clean: Mapping[Connection, Connection],
    joined: Collection[Connection],
) -> dict[str, dict[str, object]]:
    """Write all pieces; for the manifest, the results by stage that went to a channel of the log's own."""
    shared = {result: SharedTransforms(writer.declared().ids[clean[result]]) for result in joined}
    for piece in pieces:
        if isinstance(piece, WholeChunk):
            writer.copy(piece)
            continue
        if piece.connection in shared:
            shared[piece.connection].add(piece)
        connection = clean.get(piece.connection)
        writer.write(piece if connection is None else piece._replace(connection=connection))
    return {result.metadata[STAGE]: one.entry() for result, one in shared.items() if one.count}


def _renew(writer: RecordingWriter, source: Recording) -> None:
    """Have what rosbag2 keeps of a bag as a whole, if the log has that, say what is in the output."""
    if RECORD in source.metadata:
        told, counts = recorded_metadata(source.metadata), {one: writer.count(one) for one in writer.declared().ids}
        writer.metadata[RECORD] = record_of(bag_of([("", told)], counts, writer.times_ns()))


def _before(view: LayeredLog, start_ns: int) -> list[RawMessage]:
    """What holds at the start of an output because of messages before it."""
    return latest(view.messages(latched(entry.connection for entry in view.channels), None, start_ns), start_ns)


def _own(session: Session, results: Sequence[Layer]) -> Layer:
    """What of the log's own messages goes into the output."""
    own = session.own_without({entry.connection.topic for layer in results for entry in layer.channels})
    return replace(own, channels=()) if session.request.results_only else own


def _shared_last(results: Sequence[Layer]) -> list[Layer]:
    """Results with those on shared topics behind all others of equal time, wherever they lie now."""
    shared = [
        replace(layer, channels=tuple(entry for entry in layer.channels if entry.connection.topic in SHARED))
        for layer in results
    ]
    others = [
        replace(layer, channels=tuple(entry for entry in layer.channels if entry.connection.topic not in SHARED))
        for layer in results
    ]
    return [layer for layer in (*others, *shared) if layer.channels]


def _joined(layers: Sequence[Layer]) -> dict[Connection, Connection]:
    """The connections of results that go to a channel of the log's own, with that: a topic has one channel."""
    own, found = layers[0], {}
    for entry in (entry for layer in layers[1:] for entry in layer.channels):
        fitting = (one.connection for one in own.channels if can_share(one.connection, entry.connection))
        first = next(fitting, None)
        if first is not None:
            found[entry.connection] = first
    return found


def _declare(
    writer: RecordingWriter, own: Layer, joined: Mapping[Connection, Connection]
) -> tuple[dict[Connection, Connection], list[Connection]]:
    """Declare a log's own channels with the ids that they have there; the changed ones, and those that have their ids.

    Those that look like results, in a file that was edited, lose that look. Results come after them, in chunks of their
    own, whether they are new or lay in the log: the same results give the same bytes. Those that are `joined` with a
    channel go in between its messages, whose chunks are written anew for that.
    """
    clean, kept, anew = {}, [], {*joined.values(), *own.parts}
    for entry in own.channels:
        connection = entry.connection
        if STAGE in connection.metadata:
            metadata = {name: text for name, text in connection.metadata.items() if name != STAGE}
            clean[connection] = replace(connection, metadata=metadata)
        if not writer.keep(clean.get(connection, connection), *own.recording.ids(connection)):
            writer.declare(clean.get(connection, connection))
        elif connection not in anew:
            kept.append(connection)
    return clean | {result: clean.get(one, one) for result, one in joined.items()}, kept


def _is_there(
    earlier: Recording,
    entries: Mapping[str, str],
    own: Layer,
    results: Sequence[Layer],
    source: Recording,
) -> bool:
    """Whether an earlier output holds all that would be written."""
    own_entries = {k: v for k, v in earlier.metadata.get(RUN, {}).items() if k not in _OF_THE_CONTENT}
    return (
        earlier.is_ours
        and own_entries == entries
        and _others(earlier) == sorted(_others(source), key=itemgetter(0))
        and recorded_metadata(earlier.metadata).custom_data == recorded_metadata(source.metadata).custom_data
        and all(layer.recording is earlier for layer in results)
        and _topics(own_layer(earlier)) == _topics(own)
        and (not own.channels or list(earlier.attachments()) == list(source.attachments()))
    )


def _others(recording: Recording) -> list[MetadataRecord]:
    """The metadata records but for those that depend on the content."""
    return [record for record in recording.metadata_records if record[0] not in {RUN, RECORD}]


def _topics(layer: Layer) -> list[tuple[str, str]]:
    return [(entry.connection.topic, entry.connection.message_type) for entry in layer.channels]
