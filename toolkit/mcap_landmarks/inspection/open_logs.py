"""Logs of any format: bags and data sets through their sources, MCAP files through the recording reader."""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from mcap_landmarks.config import Settings, stage_config
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.inspection.mcap_log import McapLog, MountLog
from mcap_landmarks.locations import Location, Url, is_folder, to_read
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

    path: Location
    is_folder: bool
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
        first = found[0] if len(found) == 1 and not self.is_folder else None
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
        RemoteError: it is elsewhere, and cannot be read. An MCAP file is read there, all else copied first.
        UsageError: a setting of its source is wrong.
    """
    if isinstance(place, Url) and place.suffix == ".mcap" and not is_folder(place):
        yield [_recording_elsewhere(place, settings)]
        return
    path = to_read(place)
    source = source_of(path)
    config = stage_config(source.config, source.name, settings.get(source.name, {}))
    with source.open(path, config) as found:
        yield [_opened(place, source.name, config, log, in_folder=path.is_dir()) for log in found]


def _recording_elsewhere(place: Url, settings: Settings) -> OpenLog:
    from mcap_landmarks.sources import rosbag2  # noqa: PLC0415 # sources are imported when they are needed

    name = rosbag2.SOURCE.name
    config = stage_config(rosbag2.Rosbag2Config, name, settings.get(name, {}))
    return _opened(place, name, config, rosbag2.recording_elsewhere(place, config), in_folder=False)


def _opened(place: Location, source: str, config: Config, log: SourceLog, *, in_folder: bool) -> OpenLog:
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
    notes = (*log.notes, *_told_counts(place, None if losses else log.messages, held))
    told = (*log.told, *(recording.about for recording in recordings))
    parts += [mount for recording in recordings for mount in recording.mounts()]
    return OpenLog(
        place, in_folder, log.name, source, config, tuple(parts), log.size_bytes, losses, notes, log.dropped, told
    )


def _told_counts(path: Location, told: int | None, held: int) -> Iterator[str]:
    if told not in (None, held):
        yield f"{path}: its metadata count {told} messages, its files hold {held}; these were taken"


def _messages_in(part: Log) -> int:
    if isinstance(part, McapLog):
        return sum(entry.count for entry in part.recorded)
    return sum(entry.count for entry in part.channels) + sum(one.messages for one in part.left_out)


def notes_of(part: Log) -> list[str]:
    """What is odd about a part and costs nothing."""
    return part.notes if isinstance(part, McapLog) else []
