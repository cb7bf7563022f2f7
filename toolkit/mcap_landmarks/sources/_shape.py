"""The shape of a source: how it is recognised and opened, and what the logs that it gives offer."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from mcap_landmarks.locations import Location
from mcap_landmarks.progress import Progress
from mcap_landmarks.stage import ChannelSummary, Config, Connection, RawMessage
from mcap_landmarks.wording import counted

Payload = bytes | memoryview


@dataclass(frozen=True, slots=True)
class OmittedTopic:
    """A topic that cannot be carried: how many messages of it the storage declares, and why it is left out."""

    topic: str
    message_type: str
    messages: int
    reason: str

    @property
    def told(self) -> str:
        """In words."""
        of = f" ({self.message_type})" if self.message_type else ""
        return f"topic {self.topic}{of}, {counted(self.messages, 'message')}: {self.reason}"

    def entries(self) -> dict[str, object]:
        """As --json prints it."""
        return {"topic": self.topic, "type": self.message_type, "messages": self.messages, "reason": self.reason}


def together(topics: Iterable[OmittedTopic]) -> list[OmittedTopic]:
    """Topics that several files leave out for one reason, each once."""
    counts: Counter[tuple[str, str, str]] = Counter()
    for one in topics:
        counts[one.topic, one.message_type, one.reason] += one.messages
    return [OmittedTopic(topic, type_, count, reason) for (topic, type_, reason), count in counts.items()]


class Log(Protocol):
    """Messages that can be read in the order of time.

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

    @property
    def left_out(self) -> Sequence[OmittedTopic]:
        """The topics with messages that are not among `channels`, because nobody could understand them."""

    def verify(self, wanted: Callable[[str], bool]) -> None:
        """Decode the messages of wanted topics whose definition is not the file's own, to their full length.

        What does not fit any definition that is known leaves `channels` for `left_out`; before that, messages are given
        as they are. A topic's connection may become another one.
        """

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
class Definition:
    """A definition (`ros2msg`) that is not the recording's own; `check` decodes a message to its full length.

    `check` raises MessageError for what does not fit. The user gave one that `is_given`.
    """

    text: str
    check: Callable[[Payload], None]
    is_given: bool = False


@dataclass(frozen=True, slots=True)
class Carried:
    """The connection that stands for another one, of ROS 2 where there is one, and what makes its payloads from those.

    `convert` raises MessageError for a payload that cannot be understood. `mount` is there for messages that say
    themselves where their sensor is: of the first of them, it gives the TFMessage that says so, None where none is
    needed, and has to be asked before others are converted.
    `definitions` are those that the messages may
    have where the file has none: the connection has the first of them until they are verified.
    """

    connection: Connection
    convert: Callable[[Payload], Payload]
    mount: Callable[[Payload], bytes | None] | None = None
    definitions: Sequence[Definition] = ()


@dataclass(frozen=True, slots=True)
class McapFile:
    """A part of a log that is an MCAP file, which sources do not open.

    carry: how a connection of the file is carried on, of that and the file's metadata records. It
    raises MessageError if the type cannot be understood.
    """

    path: Location
    carry: Callable[[Connection, Mapping[str, Mapping[str, str]]], Carried]


@dataclass(frozen=True, slots=True)
class BagDescription:
    """What metadata say: storage files, the distribution if it is a known one, types by topic, and all messages.

    `messages` is None where they do not count; `custom_data` is what the one who recorded it wanted to keep.
    """

    files: tuple[str, ...] = ()
    distribution: str | None = None
    types: Mapping[str, str] = field(default_factory=dict)
    messages: int | None = None
    custom_data: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class SourceLog:
    """One recording's worth of a source: what becomes one output.

    parts: files whose messages are merged by time. dropped: what the source's documented rules leave out, count by
    reason. notes: what the user should know. size_bytes: of all parts, for progress. told: what files beside the
    messages say of it, by their names. messages: how many there should be in all, None if nothing says so.
    """

    name: str
    parts: tuple[Log | McapFile, ...]
    size_bytes: int
    losses: tuple[str, ...] = ()
    dropped: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    told: tuple[tuple[str, BagDescription], ...] = ()
    messages: int | None = None


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
