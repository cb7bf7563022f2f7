"""The output of a run: a log's own messages with the results of all stages, each stage's in chunks of its own."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from operator import itemgetter
from pathlib import Path

from mcap_landmarks.manifest import (
    CARRIED,
    CONTENT,
    LOSSES,
    RUN,
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
from mcap_landmarks.recording.summary_index import MetadataRecord
from mcap_landmarks.recording.writer import RecordingWriter, create_recording, profile_of
from mcap_landmarks.runs.bag_record import bag_of
from mcap_landmarks.runs.rosbag2_metadata import RECORD, record_of
from mcap_landmarks.runs.session import Session
from mcap_landmarks.sources import recorded_metadata
from mcap_landmarks.stage import Connection, RawMessage


def write_output(
    session: Session, output: Path, verb: str, inputs: Sequence[str], watch: Watch
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
        losses, carried = _write(session, output, entries, [own, *results], watch)
    return [*notes, *([carried_note(carried)] if carried else [])], losses


def _write(
    session: Session, output: Path, entries: Mapping[str, str], layers: Sequence[Layer], watch: Watch
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
        clean, kept = _declare(writer, layers[0])
        pieces = view.pieces(kept, writer.declared(), span.start_ns, span.end_ns, progress)
        for piece in chain(carried, pieces):
            if isinstance(piece, WholeChunk):
                writer.copy(piece)
            else:
                connection = clean.get(piece.connection)
                writer.write(piece if connection is None else piece._replace(connection=connection))
        for attachment in () if session.request.results_only else source.attachments():
            writer.attach(attachment)
        _renew(writer, source)
        told = {LOSSES: source.losses, CARRIED: counts}
        writer.metadata[RUN].update({name: entry_text(value) for name, value in told.items() if value})
    return list(source.losses), counts


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


def _declare(writer: RecordingWriter, own: Layer) -> tuple[dict[Connection, Connection], list[Connection]]:
    """Declare a log's own channels with the ids that they have there; the changed ones, and those that have their ids.

    Those that look like results, in a file that was edited, lose that look. Results come after them, in chunks of their
    own, whether they are new or lay in the log: the same results give the same bytes.
    """
    clean, kept = {}, []
    for entry in own.channels:
        connection = entry.connection
        if STAGE in connection.metadata:
            metadata = {name: text for name, text in connection.metadata.items() if name != STAGE}
            clean[connection] = replace(connection, metadata=metadata)
        if writer.keep(clean.get(connection, connection), *own.recording.ids(connection)):
            kept.append(connection)
        else:
            writer.declare(clean.get(connection, connection))
    return clean, kept


def _is_there(
    earlier: Recording,
    entries: Mapping[str, str],
    own: Layer,
    results: Sequence[Layer],
    source: Recording,
) -> bool:
    """Whether an earlier output holds all that would be written."""
    own_entries = {k: v for k, v in earlier.metadata.get(RUN, {}).items() if k not in {CONTENT, LOSSES, CARRIED}}
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
