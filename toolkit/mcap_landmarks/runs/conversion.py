"""One output of a conversion, or its parts: what is written, and the account of all messages."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path

from mcap_landmarks.config import effective
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.inspection.mcap_log import McapLog
from mcap_landmarks.inspection.open_logs import OpenLog, notes_of
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import CARRIED, RUN, Manifest, entry_text, file_hash, is_generated
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.chunk_copy import WholeChunk
from mcap_landmarks.recording.chunk_form import ChunkForm
from mcap_landmarks.recording.damage import Damage
from mcap_landmarks.recording.latched import carried_note
from mcap_landmarks.recording.summary_index import MetadataRecord
from mcap_landmarks.recording.writer import ROS2, RecordingWriter, create_recording, profile_of
from mcap_landmarks.runs.bag_record import Told, bag_of, bag_record, custom_data_of
from mcap_landmarks.runs.conversion_inputs import ConversionInputs
from mcap_landmarks.runs.input_hashes import HashOf
from mcap_landmarks.runs.loss_report import REPORT, account_of, damage_of, loss_report, lost_by_cause, report_of
from mcap_landmarks.runs.output_formats import OutputFormat
from mcap_landmarks.runs.rosbag2_metadata import RECORD, BagFile, BagMetadata, record_of
from mcap_landmarks.sources import LossAccount, OmittedTopic, definition_files
from mcap_landmarks.stage import Connection, RawMessage

_LOST_WITH = frozenset({RUN, RECORD})  # metadata records that would no longer be true


@dataclass(slots=True)
class Converted:
    """One output: messages by topic, how many the storage declared and how many of these could not be read.

    Those of topics that are `left_out`, since nobody could understand them, are among the lost ones.
    """

    path: Location
    format: OutputFormat = OutputFormat.MCAP
    topics: Counter[str] = field(default_factory=Counter)
    declared: int = 0
    lost: int = 0
    dropped: Counter[str] = field(default_factory=Counter)
    losses: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    left_out: list[OmittedTopic] = field(default_factory=list)
    account: LossAccount = field(default_factory=LossAccount)

    def damage(self) -> Damage:
        """The account in the terms of a recording's; what is damaged may not say how many messages it should hold."""
        losses = self.told_losses()
        is_counted = not self.account.is_open and bool(self.lost or self.account.undeclared)
        expected = self.declared + self.account.undeclared if is_counted or not losses else None
        return damage_of(self.account, expected, self.topics.total(), losses)

    def lost_by_cause(self) -> dict[str, int | None]:
        """How many messages are lost for each cause, None where nothing tells."""
        left_out = sum(one.messages for one in self.left_out)
        omitted = {"not_understood": left_out} if left_out else {}
        return lost_by_cause(self.damage(), {**self.account.messages, **omitted})

    def told_losses(self) -> list[str]:
        """All that is lost, in words."""
        lost = [*self.losses, *(one.told for one in self.left_out)]
        if self.lost and not lost:
            lost.append(f"{self.lost} of {self.declared} declared messages could not be read")
        return lost


class NoMessagesError(RecordingError):
    """There is no message to write to an output."""


class Job:
    """What is written of some logs, and the account of all their messages.

    With `form` all messages are written into such chunks; else whole chunks are copied where that changes nothing.
    """

    def __init__(
        self, inputs: ConversionInputs, hash_of: HashOf, form: ChunkForm | None = None, verb: str = "convert"
    ) -> None:
        self.inputs, self._hash_of, self._form, self._verb = inputs, hash_of, form, verb
        self._read: Counter[Connection] = Counter()
        self._written: Counter[Connection] = Counter()
        self._files: list[BagFile] = []
        self._has_attached = False

    def run(self, target: Location, advance: Progress) -> Converted:
        """Write the one output.

        Raises:
            NoMessagesError: there is no message in it.
            RecordingError: the output cannot be written.
        """
        return self.write(target, self.inputs.selection.span, advance, is_last=True)

    def write(
        self, target: Location, span: tuple[int | None, int | None], advance: Progress, *, is_last: bool
    ) -> Converted:
        """Write the messages of some time, with what holds at its start because of messages before it.

        What `is_last` tells what was lost, of all that was written.

        Raises:
            NoMessagesError, RecordingError: see `run`.
        """
        done, (start_ns, _) = Converted(target), span
        is_first = start_ns == self.inputs.selection.start_ns
        carried = self.holding(start_ns)
        profile = profile_of(self.inputs.connections)
        if profile != ROS2:
            done.notes.append(_told_others(self.inputs.connections))
        records = self._metadata_records()
        with create_recording(target, profile=profile, form=self._form, carried=records) as writer:
            kept = self.inputs.declare(writer, by_chunk=self._form is None)
            _put(writer, chain(carried, self.inputs.pieces(writer, kept, span, advance)))
            counts = {connection: writer.count(connection) for connection in self.inputs.connections}
            self.tally(done, counts, carried)
            writer.metadata[RUN] = self._manifest().entries()
            if carried:
                writer.metadata[RUN][CARRIED] = entry_text(Counter(raw.connection.topic for raw in carried))
            self._carry_over(writer, done, counts)
            self._files.append(BagFile(target.name, done.topics.total(), *writer.times_ns()))
            self._written.update(counts)
            if not is_first:  # an earlier part has them, too
                self._read.subtract(raw.connection for raw in carried)
            if is_last:
                self.account(done)
            if lost := done.told_losses():
                writer.metadata[REPORT] = loss_report(report_of(done.damage(), done.lost_by_cause(), lost, done.notes))
        return done

    def tally(self, done: Converted, counts: Mapping[Connection, int], carried: Sequence[RawMessage]) -> None:
        """Count what was written to an output, `carried` messages among it.

        Raises:
            NoMessagesError: there is nothing else.
        """
        for connection, count in counts.items():
            done.topics[connection.topic] += count
        done.declared = done.topics.total()
        if done.declared == len(carried):
            raise NoMessagesError(f"{self.inputs.where}: {self._why_nothing()}")
        if carried:
            done.notes.append(carried_note(Counter(raw.connection.topic for raw in carried)))
        self._read.update(counts)

    def holding(self, start_ns: int | None) -> list[RawMessage]:
        """What holds at a start; a part of a bag is not read alone, so that only the first one needs it."""
        is_read_alone = start_ns == self.inputs.selection.start_ns or self.inputs.to is OutputFormat.MCAP
        return self.inputs.before(start_ns) if start_ns is not None and is_read_alone else []

    def _carry_over(self, writer: RecordingWriter, done: Converted, counts: Mapping[Connection, int]) -> None:
        """Attachments, which the first of several parts has, and what rosbag2 keeps of a bag as a whole."""
        done.notes += custom_data_of(self._told)[1]
        if self.inputs.to is OutputFormat.ROSBAG2:
            writer.metadata[RECORD] = record_of(bag_of(self._told, counts, writer.times_ns()))
        elif record := bag_record(self._told, counts, writer.times_ns()):
            writer.metadata[RECORD] = record
        for part in () if self._has_attached else self.inputs.parts:
            if isinstance(part, McapLog):
                part.copy_attachments(writer)
        self._has_attached = True

    @property
    def _told(self) -> Told:
        return [one for log in self.inputs.logs for one in log.told]

    def bag(self) -> BagMetadata:
        """What was written, as the files of one bag."""
        times = [time for file in self._files for time in (file.start_ns, file.end_ns) if time is not None]
        bag = bag_of(self._told, self._written, (min(times), max(times)) if times else ())
        return replace(bag, files=tuple(self._files))

    def pass_over(self, counts: Mapping[Connection, int]) -> None:
        """Count messages as read that an output cannot take, and who writes it tells of."""
        self._read.update(counts)

    def account(self, done: Converted) -> None:
        """Compare what was read for all outputs with what the storage declares, and say it with this one."""
        missing = sum(max(count - self._read[connection], 0) for connection, count in self.inputs.declared.items())
        for log in self.inputs.logs:
            done.dropped.update(log.dropped)
            done.notes += log.notes
        done.notes += [note for part in self.inputs.parts for note in notes_of(part)]
        done.account = account_of(self.inputs.parts, lacks_files=any(log.losses for log in self.inputs.logs))
        done.losses, done.left_out = self.inputs.losses, self.inputs.left_out
        if self.inputs.selection.is_cut:
            if missing:
                done.dropped["messages outside the time range"] += missing
        else:
            done.lost = missing + sum(one.messages for one in self.inputs.left_out)
        done.declared += done.lost

    def _why_nothing(self) -> str:
        declared, left_out, is_cut = self.inputs.declared.total(), self.inputs.left_out, self.inputs.selection.is_cut
        if left_out and not declared:
            return "; ".join(one.told for one in left_out)
        if self.inputs.losses:
            return f"no message can be read: {self.inputs.losses[0]}; copy it again"
        if declared and not is_cut:
            return f"none of {declared} declared messages can be read; copy it again"
        if declared:
            return f"no message lies in the time range; the log lasts {self.inputs.lasts}"
        dropped = [f"{reason} ({count})" for log in self.inputs.logs for reason, count in log.dropped.items()]
        return "; ".join(dropped) or "there are no messages in it; choose another log, or other --topics"

    def _metadata_records(self) -> list[MetadataRecord]:
        """The inputs' metadata records, where these stay true; those that several inputs have come once."""
        carried: list[MetadataRecord] = []
        for part in self.inputs.parts:
            if isinstance(part, McapLog):
                known = list(carried)
                carried += [one for one in part.metadata_records if one[0] not in _LOST_WITH and one not in known]
        return carried

    def _manifest(self) -> Manifest:
        return Manifest(
            verb=self._verb,
            config={log.source: _set(log) for log in self.inputs.logs},
            inputs=tuple(self._hash_of(log.path) for log in self.inputs.logs),
            options=self.inputs.selection.options(),
            generated=all(isinstance(part, McapLog) and is_generated(part.metadata) for part in self.inputs.parts),
        )


def _put(writer: RecordingWriter, pieces: Iterable[RawMessage | WholeChunk]) -> None:
    for piece in pieces:
        if isinstance(piece, WholeChunk):
            writer.copy(piece)
        else:
            writer.write(piece)


def _set(log: OpenLog) -> dict[str, object]:
    """What is set of a log's source; of files with definitions what is in them, since no path gets into a manifest."""
    entries = effective(log.config)
    given = entries.pop("definitions", ())
    paths = [Path(path) for path in given if isinstance(path, str)] if isinstance(given, tuple) else []
    files = [file for path in paths for file in definition_files(path)]
    return {**entries, "definitions": sorted({file_hash(file) for file in files})} if files else entries


def _told_others(connections: Iterable[Connection]) -> str:
    """That messages which ROS 2 does not read are carried along, of which topics."""
    others = {one.topic: one.message_encoding or "unknown" for one in connections if profile_of([one]) != ROS2}
    named = ", ".join(f"{topic} ({encoding})" for topic, encoding in sorted(others.items()))
    return f"its profile is no longer ros2, since messages are carried as they are: {named}; --topics leaves them out"
