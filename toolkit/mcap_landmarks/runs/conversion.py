"""One output of a conversion: the logs that are merged into it, and the account of all their messages."""

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from pathlib import Path

from mcap_landmarks.config import effective
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.inspection.open_logs import McapLog, OpenLog, notes_of
from mcap_landmarks.manifest import CARRIED, RUN, Manifest, entry_text, file_hash, is_generated
from mcap_landmarks.messages.qos import KEY
from mcap_landmarks.moments import moment
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.latched import carried_note, latched, latest
from mcap_landmarks.recording.writer import ROS2, RecordingWriter, create_recording, profile_of
from mcap_landmarks.runs.bag_record import bag_record, custom_data_of
from mcap_landmarks.runs.loss_report import REPORT, loss_report
from mcap_landmarks.runs.rosbag2_metadata import RECORD
from mcap_landmarks.sources import OmittedTopic, Piece, definition_files, merge, together
from mcap_landmarks.stage import Connection, RawMessage

_LOST_WITH = frozenset({RUN, RECORD})  # metadata records that would no longer be true
_COMMENT = re.compile(rb"#[^\n]*")


@dataclass(frozen=True, slots=True)
class Selection:
    """What of the logs is wanted: topics (full-match regular expressions, none for all) and log times."""

    topics: tuple[str, ...] = ()
    start_ns: int | None = None
    end_ns: int | None = None

    def options(self) -> dict[str, object]:
        """For the manifest: what was asked for."""
        given = {"topics": list(self.topics), "start_ns": self.start_ns, "end_ns": self.end_ns}
        return {key: value for key, value in given.items() if value not in (None, [])}


@dataclass(slots=True)
class Converted:
    """One output: messages by topic, how many the storage declared and how many of these could not be read.

    Those of topics that are `left_out`, since nobody could understand them, are among the lost ones.
    """

    path: Path
    topics: Counter[str] = field(default_factory=Counter)
    declared: int = 0
    lost: int = 0
    dropped: Counter[str] = field(default_factory=Counter)
    losses: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    left_out: list[OmittedTopic] = field(default_factory=list)

    def told_losses(self) -> list[str]:
        """All that is lost, in words."""
        lost = [*self.losses, *(one.told for one in self.left_out)]
        if self.lost and not lost:
            lost.append(f"{self.lost} of {self.declared} declared messages could not be read")
        return lost


class Job:
    """One output on its way: the logs that are merged into it."""

    def __init__(
        self,
        target: Path,
        logs: Sequence[OpenLog],
        selection: Selection,
        patterns: Sequence[re.Pattern[str]],
        *,
        strict: bool = False,
        verb: str = "convert",
    ) -> None:
        """Raises RecordingError: no topic can be carried, or with `strict` one cannot."""
        self._target, self._logs, self._selection, self._verb = target, logs, selection, verb
        self._parts = [part for log in logs for part in log.parts]
        self._declared: Counter[Connection] = Counter()

        def wanted(topic: str) -> bool:
            return not patterns or any(pattern.fullmatch(topic) for pattern in patterns)

        for log in logs:
            log.verify(wanted)
        self._left_out = together(one for log in logs for one in log.left_out if wanted(one.topic))
        self._unified = self._unify(wanted)
        if self._left_out and (strict or not self._unified):
            reasons = "; ".join(one.told for one in self._left_out)
            raise RecordingError(f"{self._where()}: {reasons}")

    def _unify(self, wanted: Callable[[str], bool]) -> dict[Connection, Connection]:
        """The connection that stands in the output for each wanted one: equal ones share theirs."""
        unified: dict[Connection, Connection] = {}
        known: dict[tuple[object, ...], Connection] = {}
        topics = set()
        for entry in (entry for part in self._parts for entry in part.channels):
            connection = entry.connection
            topics.add(connection.topic)
            if wanted(connection.topic):
                unified[connection] = known.setdefault(_identity(connection), connection)
                self._declared[unified[connection]] += entry.count
        if topics and not unified and not self._left_out:
            raise UsageError(f"{self._logs[0].path}: --topics matches none of {', '.join(sorted(topics))}")
        return unified

    def run(self, hashes: Mapping[Path, str], advance: Progress) -> Converted:
        """Write the output.

        Raises:
            RecordingError: no message can be read, or the output cannot be written.
        """
        notes = [note for part in self._parts for note in notes_of(part)]
        done = Converted(self._target, notes=notes, left_out=self._left_out)
        for log in self._logs:
            done.dropped.update(log.dropped)
            done.notes.extend(log.notes)
        carried = self._before_start()
        profile = profile_of(self._unified.values())
        if profile != ROS2:
            done.notes.append(_told_others(self._unified.values()))
        with create_recording(self._target, self._metadata(hashes), profile=profile) as writer:
            for connection in self._unified.values():
                writer.declare(connection)
                done.topics[connection.topic] += 0
            within = self._messages(self._unified, self._selection.start_ns, self._selection.end_ns, advance)
            counts, span_ns = _write(writer, chain(carried, within))
            self._carry_over(writer, done, counts, span_ns)
            for connection, count in counts.items():
                done.topics[connection.topic] += count
            if carried:
                on_topics = Counter(raw.connection.topic for raw in carried)
                done.notes.append(carried_note(on_topics))
                writer.metadata[RUN][CARRIED] = entry_text(on_topics)
            self._account(done, counts, len(carried))
            if lost := done.told_losses():
                writer.metadata[REPORT] = loss_report(done.declared, done.topics.total(), lost)
        return done

    def _carry_over(
        self, writer: RecordingWriter, done: Converted, counts: Counter[Connection], span_ns: Sequence[int]
    ) -> None:
        """Attachments, and what rosbag2 keeps of a bag as a whole where the inputs have that."""
        told = [one for log in self._logs for one in log.told]
        done.notes += custom_data_of(told)[1]
        every = {connection: counts[connection] for connection in self._unified.values()}
        if record := bag_record(told, every, span_ns):
            writer.metadata[RECORD] = record
        for part in self._parts:
            if isinstance(part, McapLog):
                part.copy_attachments(writer)

    def _messages(
        self,
        connections: Collection[Connection],
        start_ns: int | None,
        end_ns: int | None,
        advance: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """The messages of some connections, of all parts by time, on the connections of the output."""
        unified = self._unified
        pieces: list[Piece] = [
            (part.start_ns, partial(part.messages, set(connections), start_ns, end_ns, advance))
            for part in self._parts
            if part.start_ns is not None
        ]
        if all(connection is own for connection, own in unified.items()):
            yield from merge(pieces)
            return
        for connection, log_time_ns, publish_time_ns, sequence, data in merge(pieces):
            yield RawMessage(unified[connection], log_time_ns, publish_time_ns, sequence, data)

    def _before_start(self) -> list[RawMessage]:
        """What holds at the start that was chosen because of messages before it."""
        start_ns = self._selection.start_ns
        return [] if start_ns is None else latest(self._messages(latched(self._unified), None, start_ns), start_ns)

    def _account(self, done: Converted, counts: Counter[Connection], carried: int) -> None:
        """Compare what was read with what the storage declares; with no message but carried ones there is no output."""
        declared = sum(self._declared.values())
        missing = sum(max(count - counts[connection], 0) for connection, count in self._declared.items())
        read = counts.total()
        done.losses = [loss for log in self._logs for loss in log.losses]
        done.losses += [loss for part in self._parts for loss in part.losses]
        if self._selection.start_ns is not None or self._selection.end_ns is not None:
            if missing:
                done.dropped["messages outside the time range"] += missing
        else:
            done.lost = missing + sum(one.messages for one in self._left_out)
        done.declared = read + done.lost
        if read == carried:
            raise RecordingError(f"{self._where()}: {self._why_nothing(declared, done)}")

    def _where(self) -> str:
        return ", ".join(dict.fromkeys(str(log.path) for log in self._logs))

    def _why_nothing(self, declared: int, done: Converted) -> str:
        if self._left_out and not declared:
            return "; ".join(one.told for one in self._left_out)
        if done.losses:
            return f"no message can be read: {done.losses[0]}"
        if done.lost:
            return f"none of {done.lost} declared messages can be read; copy it again"
        if declared:
            return f"no message lies in the time range; the log lasts {self._lasts()}"
        if done.dropped:
            return "; ".join(f"{reason} ({count})" for reason, count in done.dropped.items())
        return "there are no messages in it; choose another log, or other --topics"

    def _lasts(self) -> str:
        starts = [log.start_ns for log in self._logs if log.start_ns is not None]
        ends = [log.end_ns for log in self._logs if log.end_ns is not None]
        return f"from {moment(min(starts))} to {moment(max(ends))}" if starts and ends else "no time at all"

    def _metadata(self, hashes: Mapping[Path, str]) -> Mapping[str, Mapping[str, str]]:
        """The inputs' metadata records, where these stay true, and the manifest."""
        carried: dict[str, Mapping[str, str]] = {}
        for part in self._parts:
            if isinstance(part, McapLog):
                carried.update({name: entries for name, entries in part.metadata.items() if name not in _LOST_WITH})
        manifest = Manifest(
            verb=self._verb,
            config={log.source: _set(log) for log in self._logs},
            inputs=tuple(hashes[log.path] for log in self._logs),
            options=self._selection.options(),
            generated=all(isinstance(part, McapLog) and is_generated(part.metadata) for part in self._parts),
        )
        return {**carried, RUN: manifest.entries()}


def _write(writer: RecordingWriter, messages: Iterator[RawMessage]) -> tuple[Counter[Connection], Sequence[int]]:
    """Write messages: how many of each connection, and the first and last log time if there are any."""
    counts: Counter[Connection] = Counter()
    raw = first = next(messages, None)
    if first is None or raw is None:
        return counts, ()
    for raw in chain([first], messages):
        writer.write(raw)
        counts[raw.connection] += 1
    return counts, (first.log_time_ns, raw.log_time_ns)


def _set(log: OpenLog) -> dict[str, object]:
    """What is set of a log's source; of files with definitions what is in them, since no path gets into a manifest."""
    entries = effective(log.config)
    given = entries.pop("definitions", ())
    paths = [Path(path) for path in given if isinstance(path, str)] if isinstance(given, tuple) else []
    files = [file for path in paths for file in definition_files(path)]
    return {**entries, "definitions": sorted({file_hash(file) for file in files})} if files else entries


def _identity(connection: Connection) -> tuple[object, ...]:
    """What makes connections one channel: topic, type and quality of service, where the definitions agree."""
    definition = tuple(_COMMENT.sub(b"", connection.schema).split())
    quality = connection.metadata.get(KEY)
    encodings = connection.message_encoding, connection.schema_encoding
    return connection.topic, connection.message_type, encodings, definition, quality


def _told_others(connections: Iterable[Connection]) -> str:
    """That messages which ROS 2 does not read are carried along, of which topics."""
    others = {one.topic: one.message_encoding or "unknown" for one in connections if profile_of([one]) != ROS2}
    named = ", ".join(f"{topic} ({encoding})" for topic, encoding in sorted(others.items()))
    return f"its profile is no longer ros2, since messages are carried as they are: {named}; --topics leaves them out"
