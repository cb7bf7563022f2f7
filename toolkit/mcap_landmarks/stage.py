"""The words that runs, stages and sources share: raw messages, channels, bundles, stages.

A stage is one file in `stages/`, or of another package, with a `Stage` named STAGE; no other file knows it by name.
`--set fuse.bearing_gate=4` sets the field `bearing_gate` of its `config`, a dataclass, which its `process` gets second.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import Field, dataclass, field
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.extensions import Registry
from mcap_landmarks.geometry.se2 import Array, between, exp, interpolate
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.codec import M, Message
from mcap_landmarks.progress import Progress

M_co = TypeVar("M_co", bound=Message, covariant=True)
"""A `Channel[Message]` is a channel of any messages, since a channel only says which its are."""


@dataclass(frozen=True, slots=True, eq=False)
class Connection:
    """Where raw messages come from or go to: one channel of a recording, with the schema of its messages.

    `message_type` is the ROS 2 name (`nav_msgs/msg/Odometry`), `schema` the text of its definition. Two connections
    are equal only if they are the same object: a recording may have several with the same topic.
    """

    topic: str
    message_type: str
    schema: bytes
    schema_encoding: str = "ros2msg"
    message_encoding: str = "cdr"
    metadata: Mapping[str, str] = field(default_factory=dict)

    @property
    def read_as(self) -> str:
        """The type that its messages are read as: none where they are not of CDR, however the type is called."""
        return self.message_type if self.message_encoding == "cdr" else ""


@dataclass(frozen=True, slots=True)
class ChannelSummary:
    """A connection and the number of its messages that the storage declares."""

    connection: Connection
    count: int


class RawMessage(NamedTuple):
    """One message as it lies in a recording; a tuple, since hot loops make millions."""

    connection: Connection
    log_time_ns: int
    publish_time_ns: int
    sequence: int
    data: bytes | memoryview


class Readable(Protocol):
    """Channels whose messages can be read in the order of time: an open recording is one, and a layered log."""

    @property
    def path(self) -> Location:
        """Where the log lies, for messages to the user."""

    @property
    def channels(self) -> Sequence[ChannelSummary]:
        """Every connection with its count."""

    def messages(
        self,
        connections: Collection[Connection] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        progress: Progress | None = None,
    ) -> Iterator[RawMessage]:
        """See `Recording.messages`."""


@dataclass(frozen=True, slots=True)
class Channel(Generic[M_co]):
    """A topic and the dataclass of its messages."""

    topic: str
    message: type[M_co]


@dataclass(frozen=True, slots=True, eq=False)
class Stamped:
    """A message on its way into a recording; `frame_id` tells which of several sensors it was made from."""

    channel: Channel[Message]
    log_time_ns: int
    message: Message
    frame_id: str = ""

    def get(self, channel: Channel[M]) -> M | None:
        """The message, None if it is not one of a channel."""
        return self.message if self.channel == channel and isinstance(self.message, channel.message) else None


@dataclass(frozen=True, slots=True, eq=False)
class OdometrySamples:
    """Odometry messages around a moment: stamps_ns (K,), rising, and odom_from_base (K, 3)."""

    stamps_ns: NDArray[np.int64]
    odom_from_base: Array


@dataclass(frozen=True, slots=True, eq=False)
class OdometryAt:
    """Odometry at one moment: odom_from_base (3,) x, y, heading in `frame_id`, and the (3, 3) covariance it came with.

    The covariance is that of the message before; all zero where the log leaves it unknown. `way_m` and `turned_rad` are
    the length of the path and the sum of all turning since the log began, so that a loop back to the start counts.
    `velocity` (3,) is the base's own: forward and left in m/s and turning in rad/s, over the two messages around.
    `samples` are there where the bundle's message took a while to measure, and span that while if the log does.
    Between poses of another `piece` nothing is known.
    """

    frame_id: str
    odom_from_base: Array
    covariance: Array
    way_m: float
    turned_rad: float
    velocity: Array = field(default_factory=lambda: np.zeros(3))
    samples: OdometrySamples | None = None
    piece: int = 0

    def base_from_then(self, stamp_ns: int, times_ns: NDArray[np.int64]) -> Array:
        """Where the base was at some times (N,), as poses (N, 3) in the base frame at `stamp_ns`.

        Beyond what the log tells the base keeps its velocity, or stays where it was last.
        """
        samples = self.samples
        if samples is None or not (len(samples.stamps_ns) > 1 and samples.stamps_ns[0] <= times_ns.min()):
            return exp((times_ns - stamp_ns)[:, None] / 1e9 * self.velocity)
        # What the log does not tell any more is little: a bundle waits until odometry has passed its last beam.
        known = np.minimum(times_ns, samples.stamps_ns[-1])
        return between(self.odom_from_base, interpolate(samples.stamps_ns, samples.odom_from_base, known))


@dataclass(frozen=True, slots=True, eq=False)
class Bundle:
    """What belongs to one moment: the messages associated with it, by channel, and the odometry at its stamp.

    `several` has all messages of the channels that have more than one, of several cameras.
    """

    stamp_ns: int
    log_time_ns: int
    messages: Mapping[Channel[Message], Message]
    odometry: OdometryAt | None = None
    several: Mapping[Channel[Message], tuple[Message, ...]] = field(default_factory=dict)

    def get(self, channel: Channel[M]) -> M | None:
        """The bundle's message of a channel, None if it has none."""
        message = self.messages.get(channel)
        return message if isinstance(message, channel.message) else None

    def each(self, channel: Channel[M]) -> list[M]:
        """The bundle's messages of a channel, one for each camera that has any, in the order of their frames."""
        found = self.several.get(channel) or (self.messages.get(channel),)
        return [message for message in found if isinstance(message, channel.message)]


@dataclass(frozen=True, slots=True)
class Omission:
    """Something that a stage left out: `lost` where the source data are unreadable, else by a rule of its own.

    `frame_id` is that of what is lost, where it may be one of several cameras'.
    """

    log_time_ns: int
    reason: str
    lost: bool = False
    frame_id: str = ""


class Tolerance(NamedTuple):
    """How far two values may be apart: absolute, in the field's unit, plus relative to the larger of them."""

    absolute: float = 0.0
    relative: float = 0.0


class Config(Protocol):
    """The configuration of a stage or source: a frozen dataclass whose fields all have defaults."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]


class InputLog(Readable, Protocol):
    """A log as a stage will read it, for what has to be known before its first bundle."""

    @property
    def primary(self) -> Connection:
        """The connection whose messages make the bundles."""

    def first(self, channel: Channel[M]) -> M | None:
        """The first message of a channel that the stage reads; None if there is none, or none that can be read."""


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Why a stage does not write a channel to a log, in words for the user."""

    reason: str


Process = Callable[[Iterable[Bundle], Any, Mapping[str, Location]], Iterator[Stamped | Omission]]
"""Results of bundles, of the stage's configuration (an object of its own dataclass) and of its files by name."""

Place = Callable[[InputLog, Any], str | LeftOut]
"""Of a log and the stage's configuration, the topic that a channel gets there; asked for each of several cameras."""


@dataclass(frozen=True, slots=True)
class Chosen:
    """The file of a resource, and for the manifest where it comes from, in words without a path."""

    path: Location
    origin: str


Choose = Callable[[Location | None, bool], Chosen]
"""Of what the user gave for a resource, if anything, and whether the generator made the log, the file to take."""


@dataclass(frozen=True, slots=True)
class Stage:
    """One step of the pipeline: what it reads and writes, its configuration and its code.

    The first channel of `reads` is the primary one: each of its messages makes a bundle, and a log must have it;
    `thinned` lets --image-rate and --every leave out some. Where a bundle's results are those that it would have alone,
    `in_segments` gives the configuration for workers on some of them. Channels of `reads` that are `optional`, too, are
    read where they are, and no other stage is run to make them. A channel of `writes` gets its own topic, or the one
    that its function in `places` gives. `settle` leaves nothing of a configuration to the machine. `resources` are
    files that the runner hashes and passes in, `options` may be missing; what a function in `choices` makes of them
    counts. `tolerance` says how far each field of `diff` may be off elsewhere. `extensible` take part in the results.
    """

    name: str
    reads: tuple[Channel[Message], ...]
    writes: tuple[Channel[Message], ...]
    config: type[Config]
    process: Process
    optional: tuple[Channel[Message], ...] = ()
    thinned: bool = False
    places: Mapping[Channel[Message], Place] = field(default_factory=dict)
    resources: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    choices: Mapping[str, Choose] = field(default_factory=dict)
    settle: Callable[[Any], Any] | None = None
    in_segments: Callable[[Any], Any] | None = None
    tolerance: Mapping[str, float | Tolerance] = field(default_factory=dict)
    extensible: tuple[Registry[object], ...] = ()

    @property
    def required(self) -> tuple[Channel[Message], ...]:
        """The channels of `reads` that a log must have: nothing can be done without the primary one."""
        return self.reads[:1]

    @property
    def files(self) -> tuple[str, ...]:
        """The names of all files that can be given."""
        return *self.resources, *self.options


@dataclass(frozen=True, slots=True)
class Reduction:
    """The step that makes one result of many logs: `collect` per log, then `solve` over what was collected.

    `collect(bundles, config)` gives one log's observations, `alone(observations, config)` what of the map needs no
    other, `solve(observations, prior, config, alone)` the rest. A log has every channel that is not `optional`.
    """

    name: str
    reads: tuple[Channel[Message], ...]
    writes: tuple[Channel[Message], ...]
    config: type[Config]
    collect: Callable[[Iterable[Bundle], Any], Any]
    alone: Callable[[Any, Any], Any]
    solve: Callable[..., Any]
    optional: tuple[Channel[Message], ...] = ()
    tolerance: Mapping[str, float | Tolerance] = field(default_factory=dict)

    @property
    def required(self) -> tuple[Channel[Message], ...]:
        """The channels of `reads` that a log must have."""
        return tuple(channel for channel in self.reads if channel not in self.optional)

    @property
    def files(self) -> tuple[str, ...]:
        """The names of the files that can be given in a configuration: there are none."""
        return ()
