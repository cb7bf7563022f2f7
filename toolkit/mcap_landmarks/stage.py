"""The words that runs, stages and sources share: raw messages, channels, bundles, stages."""

import contextlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array, between, exp, interpolate
from mcap_landmarks.messages.codec import M, Message

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


@dataclass(frozen=True, slots=True)
class ChannelSummary:
    """A connection and the number of its messages that the storage declares."""

    connection: Connection
    count: int


Progress = Callable[[int], None]
"""Is told how much was done since the last time: bytes, where nothing else is said."""


class Watch(Protocol):
    """Shows the progress of work, such as `mcap_landmarks.cli.console.progress`."""

    def __call__(self, label: str, total: int | None, unit: str = ..., /) -> AbstractContextManager[Progress]:
        """What is done, how much there is to do, if that is known, and what is counted: bytes, if nothing is said."""


@contextlib.contextmanager
def unwatched(_label: str, _total: int | None, _unit: str = "bytes") -> Iterator[Progress]:
    """Shows nothing."""
    yield lambda _advance: None


class RawMessage(NamedTuple):
    """One message as it lies in a recording; a tuple, since hot loops make millions."""

    connection: Connection
    log_time_ns: int
    publish_time_ns: int
    sequence: int
    data: bytes | memoryview


@dataclass(frozen=True, slots=True)
class Channel(Generic[M_co]):
    """A topic and the dataclass of its messages."""

    topic: str
    message: type[M_co]


@dataclass(frozen=True, slots=True, eq=False)
class Stamped:
    """A message on its way into a recording."""

    channel: Channel[Message]
    log_time_ns: int
    message: Message


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """Odometry messages around a moment: stamps_ns (K,), rising, and odom_from_base (K, 3)."""

    stamps_ns: NDArray[np.int64]
    odom_from_base: Array


@dataclass(frozen=True, slots=True, eq=False)
class OdometryAt:
    """Odometry at one moment: odom_from_base (3,) x, y, heading in `frame_id`, and the (3, 3) covariance it came with.

    The covariance is that of the message before; all zero where the log leaves it unknown. `way_m` and `turned_rad` are
    the length of the path and the sum of all turning since the log began, so that a loop back to the start counts.
    `velocity` (3,) is the base's own: forward and left in m/s and turning in rad/s, over the two messages around.
    `steps` are there where the bundle's message took a while to measure, and span that while if the log does.
    """

    frame_id: str
    odom_from_base: Array
    covariance: Array
    way_m: float
    turned_rad: float
    velocity: Array = field(default_factory=lambda: np.zeros(3))
    steps: Steps | None = None

    def base_from_then(self, stamp_ns: int, times_ns: NDArray[np.int64]) -> Array:
        """Where the base was at some times (N,), as poses (N, 3) in the base frame at `stamp_ns`.

        Beyond what the log tells the base keeps its velocity, or stays where it was last.
        """
        steps = self.steps
        if steps is None or not (len(steps.stamps_ns) > 1 and steps.stamps_ns[0] <= times_ns.min()):
            return exp((times_ns - stamp_ns)[:, None] / 1e9 * self.velocity)
        # What the log does not tell any more is little: a bundle waits until odometry has passed its last beam.
        known = np.minimum(times_ns, steps.stamps_ns[-1])
        return between(self.odom_from_base, interpolate(steps.stamps_ns, steps.odom_from_base, known))


@dataclass(frozen=True, slots=True, eq=False)
class Bundle:
    """What belongs to one moment: the messages associated with it, by channel, and the odometry at its stamp."""

    stamp_ns: int
    log_time_ns: int
    messages: Mapping[Channel[Message], Message]
    odometry: OdometryAt | None = None

    def get(self, channel: Channel[M]) -> M | None:
        """The bundle's message of a channel, None if it has none."""
        message = self.messages.get(channel)
        return message if isinstance(message, channel.message) else None


@dataclass(frozen=True, slots=True)
class Omission:
    """Something that a stage left out: `lost` where the source data are unreadable, else by a rule of its own."""

    log_time_ns: int
    reason: str
    lost: bool = False


class Tolerance(NamedTuple):
    """How far two values may be apart: absolute, in the field's unit, plus relative to the larger of them."""

    absolute: float = 0.0
    relative: float = 0.0


Process = Callable[[Iterable[Bundle], Any, Mapping[str, Path]], Iterator[Stamped | Omission]]


@dataclass(frozen=True, slots=True)
class Stage:
    """One step of the pipeline: what it reads and writes, its configuration and its code.

    The first channel of `reads` is the primary one: each of its messages makes a bundle. `config` is a dataclass type;
    `resources` are files that the runner opens, hashes and passes in, `options` files that may be missing; `tolerance`
    says how far each field, by the name that `diff` gives it, may differ between two machines; a number is absolute.
    """

    name: str
    reads: tuple[Channel[Message], ...]
    writes: tuple[Channel[Message], ...]
    config: type[Any]
    process: Process
    resources: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    tolerance: Mapping[str, float | Tolerance] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Reduction:
    """The step that makes one result of many logs: `collect` per log, then `solve` over what was collected.

    `collect(bundles, config)` gives one log's observations, `solve(observations, prior, config)` the map and one
    trajectory per log.
    """

    name: str
    reads: tuple[Channel[Message], ...]
    writes: tuple[Channel[Message], ...]
    config: type[Any]
    collect: Callable[[Iterable[Bundle], Any], Any]
    solve: Callable[..., Any]
    tolerance: Mapping[str, float | Tolerance] = field(default_factory=dict)
