"""Logs of any format: bags and data sets through their sources, MCAP files through the recording reader."""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mcap_landmarks.config import Settings, stage_config
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.inspection.mcap_log import McapLog, MountLog
from mcap_landmarks.locations import Location, to_read
from mcap_landmarks.sources import (
    BagDescription,
    Log,
    McapFile,
    OmittedTopic,
    SourceLog,
    source_of,
)
from mcap_landmarks.stage import Config


@dataclass(frozen=True, slots=True)
class OpenLog:
    """One log: where it comes from, its parts, and what is known of them before they are read."""

    path: Path
    name: str
    source: str
    config: Config
    parts: tuple[Log, ...]
    size_bytes: int
    losses: tuple[str, ...]
    notes: tuple[str, ...]
    dropped: Mapping[str, int] = field(default_factory=dict)
    told: tuple[tuple[str, BagDescription], ...] = ()

    def verify(self, wanted: Callable[[str], bool]) -> None:
        """See `Log`, of all parts."""
        for part in self.parts:
            part.verify(wanted)

    @property
    def left_out(self) -> list[OmittedTopic]:
        """The topics of all parts that cannot be carried."""
        return [one for part in self.parts for one in part.left_out]

    def only_file(self) -> "McapLog | None":
        """The MCAP file that the whole log is, None where it is a folder or of another format."""
        found = [part for part in self.parts if not isinstance(part, MountLog)]
        first = found[0] if len(found) == 1 and self.path.is_file() else None
        return first if isinstance(first, McapLog) else None

    def all_notes(self) -> tuple[str, ...]:
        """What is odd about the log or a part of it and costs nothing."""
        return (*self.notes, *(note for part in self.parts for note in notes_of(part)))

    @property
    def start_ns(self) -> int | None:
        """Log time of the first message."""
        return min((part.start_ns for part in self.parts if part.start_ns is not None), default=None)

    @property
    def end_ns(self) -> int | None:
        """Log time of the last message."""
        return max((part.end_ns for part in self.parts if part.end_ns is not None), default=None)


@contextlib.contextmanager
def open_logs(place: Location, settings: Settings) -> Iterator[Sequence[OpenLog]]:
    """The logs at a place, each with all its parts.

    Raises:
        RecordingError: no source knows it, or it cannot be read.
        UsageError: it is not on this machine, or a setting of its source is wrong.
    """
    path = to_read(place)
    source = source_of(path)
    config = stage_config(source.config, source.name, settings.get(source.name, {}))
    with source.open(path, config) as found:
        yield [_opened(path, source.name, config, log) for log in found]


def _opened(path: Path, source: str, config: Config, log: SourceLog) -> OpenLog:
    """A log with all its parts that can be opened.

    Raises:
        RecordingError: there is none.
    """
    parts: list[Log] = []
    problems: list[RecordingError] = []
    for part in log.parts:
        try:
            parts.append(McapLog(part) if isinstance(part, McapFile) else part)
        except RecordingError as error:
            problems.append(error)
    if problems and not parts:
        raise RecordingError("; ".join([*log.losses, *map(str, problems)]))
    recordings = [part for part in parts if isinstance(part, McapLog)]
    losses, held = (*log.losses, *map(str, problems)), sum(map(_messages_in, parts))
    notes = (*log.notes, *_told_counts(path, None if losses else log.messages, held))
    told = (*log.told, *(recording.about for recording in recordings))
    parts += [mount for recording in recordings for mount in recording.mounts()]
    return OpenLog(path, log.name, source, config, tuple(parts), log.size_bytes, losses, notes, log.dropped, told)


def _told_counts(path: Path, told: int | None, held: int) -> Iterator[str]:
    if told not in (None, held):
        yield f"{path}: its metadata count {told} messages, its files hold {held}; these were taken"


def _messages_in(part: Log) -> int:
    if isinstance(part, McapLog):
        return sum(entry.count for entry in part.recorded)
    return sum(entry.count for entry in part.channels) + sum(one.messages for one in part.left_out)


def notes_of(part: Log) -> list[str]:
    """What is odd about a part and costs nothing."""
    return part.notes if isinstance(part, McapLog) else []
