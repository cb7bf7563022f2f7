"""The shape of a source: how it is recognised and opened, and what the logs that it gives offer."""

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from mcap_landmarks.progress import Progress
from mcap_landmarks.stage import ChannelSummary, Config, Connection, RawMessage

Payload = bytes | memoryview


class Log(Protocol):
    """Messages that can be read in the order of time; an open recording is one too.

    `channels` has the counts that the storage itself declares. `losses` grows while messages are read.
    """

    @property
    def channels(self) -> Sequence[ChannelSummary]:
        """Every connection with its count."""

    @property
    def start_ns(self) -> int | None:
        """Log time of the first message."""

    @property
    def end_ns(self) -> int | None:
        """Log time of the last message."""

    @property
    def losses(self) -> Sequence[str]:
        """What could not be read."""

    def messages(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """Messages by log time, all or those of some connections, from `start_ns` on and before `end_ns`.

        Memory is bounded however long the log is. `progress` is told the bytes that were read.
        """


@dataclass(frozen=True, slots=True)
class Carried:
    """The connection that stands for another one, of ROS 2 where there is one, and what makes its payloads from those.

    `convert` raises MessageError for a payload that cannot be understood. `mount` is there for messages that say
    themselves where their sensor is: of the first of them, it gives the TFMessage that says so, None where none is
    needed, and has to be asked before others are converted.
    """

    connection: Connection
    convert: Callable[[Payload], Payload]
    mount: Callable[[Payload], bytes | None] | None = None


@dataclass(frozen=True, slots=True)
class McapFile:
    """A part of a log that is an MCAP file, which sources do not open.

    carry: how a connection of the file is carried on.
    """

    path: Path
    carry: Callable[[Connection], Carried]


@dataclass(frozen=True, slots=True)
class SourceLog:
    """One recording's worth of a source: what becomes one output.

    parts: files whose messages are merged by time. dropped: what the source's documented rules leave out, count by
    reason. notes: what the user should know. size_bytes: of all parts, for progress.
    """

    name: str
    parts: tuple[Log | McapFile, ...]
    size_bytes: int
    losses: tuple[str, ...] = ()
    dropped: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Source:
    """A foreign format: its name, what it reads in words, and its code.

    `config` is a dataclass with a default for every field. `open` gives the logs, usable until the block ends.
    """

    name: str
    reads: str
    config: type[Config]
    recognises: Callable[[Path], bool]
    open: Callable[[Path, Any], AbstractContextManager[Sequence[SourceLog]]]


@dataclass(frozen=True, slots=True)
class NoConfig:
    """The configuration of a source that has none."""
