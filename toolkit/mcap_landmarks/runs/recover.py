"""Save what is sound of a damaged log into a new recording, with the account of what is lost."""

import dataclasses
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mcap_landmarks.config import Settings
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.locations import Location, size_of, to_read
from mcap_landmarks.manifest import RUN, Manifest, file_hash, is_generated
from mcap_landmarks.progress import Progress, Watch
from mcap_landmarks.recording.chunk_copy import WholeChunk
from mcap_landmarks.recording.damage import Damage
from mcap_landmarks.recording.opening import begins_or_ends
from mcap_landmarks.recording.reader import Recording, open_recording, reading_from_front
from mcap_landmarks.recording.writer import RecordingWriter, create_recording
from mcap_landmarks.runs.convert import convert
from mcap_landmarks.runs.loss_report import REPORT, loss_report, lost_by_cause, report_of
from mcap_landmarks.runs.outputs import output_files
from mcap_landmarks.runs.replacing import check_apart, earlier_recording, output_to
from mcap_landmarks.runs.topic_selection import Selection

_ROSBAG2 = "rosbag2"
"""The metadata record that counts a bag's messages: it stays true only where none is lost."""
_NO_CRC = "the format has no CRC: nothing verifies the messages beyond the definitions that they fit"


@dataclass(frozen=True, slots=True)
class Recovered:
    """The output, its messages by topic, attachments and metadata records that were saved, and the account.

    `lost` are messages by cause, None where nothing tells how many.
    """

    path: Location
    topics: Mapping[str, int]
    damage: Damage
    lost: Mapping[str, int | None]
    attachments: int
    metadata: int
    losses: tuple[str, ...]
    notes: tuple[str, ...]


def recover(
    place: Location, output: Location, watch: Watch, settings: Settings | None = None, *, overwrite: bool = False
) -> Recovered:
    """Save what is sound of an MCAP file on the same channels; a bag is converted, as far as it can be read.

    The settings of its source say where definitions come from that a bag lacks.

    Raises:
        ToolkitError: nothing can be recovered, or the output cannot be written; nothing is left behind.
    """
    path = to_read(place)
    target = next(iter(output_files([place], output).values()))
    check_apart([target], [place])
    if path.is_file() and _is_mcap(path):
        return _recover_mcap(path, target, watch, overwrite=overwrite)
    return _recover_bag(path, target, watch, settings or {}, overwrite=overwrite)


def _is_mcap(path: Path) -> bool:
    try:
        with path.open("rb") as stream:
            return begins_or_ends(stream, path.stat().st_size)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror}); check the path") from error


def _recover_mcap(path: Path, target: Location, watch: Watch, *, overwrite: bool) -> Recovered:
    with watch(f"hash {path.name}", size_of(path)) as advance:
        hash_ = file_hash(path, advance)
    with (
        output_to(target, (), earlier_recording("recover", [hash_]), overwrite=overwrite),
        watch(f"read {path.name}", size_of(path)) as scanned,
        open_recording(path, from_front=True, progress=scanned) as recording,
        watch(f"write {target.name}", recording.size_bytes()) as advance,
    ):
        manifest = Manifest("recover", inputs=(hash_,), generated=is_generated(recording.metadata))
        untrue = {_ROSBAG2} if recording.losses else set()
        carried = [record for record in recording.metadata_records if record[0] not in untrue]
        metadata = {RUN: manifest.entries()}
        with create_recording(target, metadata, profile=recording.profile, carried=carried) as writer:
            _copy(recording, writer, advance)
            attachments = 0
            for attachment in recording.attachments():
                writer.attach(attachment)
                attachments += 1
            topics = Counter(writer.counts)
            losses, notes = tuple(recording.losses), tuple(recording.notes)
            if not topics.total():
                raise RecordingError(f"{path}: {_why_nothing(losses)}")
            damage = dataclasses.replace(recording.damage, recovered=topics.total())
            lost, records = lost_by_cause(damage, {}), len(recording.metadata_records)
            done = Recovered(target, topics, damage, lost, attachments, records, losses, notes)
            writer.metadata[REPORT] = loss_report(report(done))
    return done


def _why_nothing(losses: tuple[str, ...]) -> str:
    if losses:
        return f"no message can be recovered: {losses[0]}; copy it again"
    return "there are no messages in it; choose another log"


def _copy(recording: Recording, writer: RecordingWriter, advance: Progress) -> None:
    """The messages on the same channels, sound chunks as they are."""
    kept = []
    for entry in recording.channels:
        if writer.keep(entry.connection, *recording.ids(entry.connection)):
            kept.append(entry.connection)
        else:
            writer.declare(entry.connection)
    every = [entry.connection for entry in recording.channels]
    for piece in recording.pieces(every, kept, writer.declared(), progress=advance):
        if isinstance(piece, WholeChunk):
            writer.copy(piece)
        else:
            writer.write(piece)


def _recover_bag(path: Path, target: Location, watch: Watch, settings: Settings, *, overwrite: bool) -> Recovered:
    with reading_from_front():
        conversion = convert([path], target, Selection(), settings, watch, overwrite=overwrite, verb="recover")
    (done,) = conversion.outputs
    notes = (*done.notes, *([_NO_CRC] if path.suffix in {".bag", ".db3"} else []))
    losses = tuple(done.told_losses())
    return Recovered(done.path, done.topics, done.damage(), done.lost_by_cause(), 0, 0, losses, notes)


def report(done: Recovered) -> dict[str, object]:
    """The account as JSON values, as it stands in the output's metadata and in the document."""
    return report_of(done.damage, done.lost, done.losses, done.notes)
