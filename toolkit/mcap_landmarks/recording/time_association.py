"""Time association: messages of several channels to bundles, in one pass over a recording and in bounded memory."""

from collections import Counter, deque
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.recording.odometry_track import WIDEST_GAP_NS, OdometryTrack
from mcap_landmarks.stage import Bundle, Channel

WINDOW_NS = WIDEST_GAP_NS
"""How long a bundle waits for its partners."""

BESIDE_NS = 250_000_000
"""How far from a bundle's stamp a message may be that belongs beside it: half a period at 2 Hz, and who records
fewer images has most bundles without one anyway."""

_NONE: Mapping[Channel[Message], int] = {}


@dataclass(slots=True)
class Association:
    """What became of the messages of one recording.

    `alone` counts bundles without a partner, and `unpaired` messages that are no bundle's partner, by topic.
    """

    bundles: int = 0
    without_odometry: int = 0
    alone: Counter[str] = field(default_factory=Counter)
    unpaired: Counter[str] = field(default_factory=Counter)


def associate(
    messages: Iterable[tuple[Channel[Message], int, Message]],
    primary: Channel[Message],
    counts: Association,
    *,
    odometry: OdometryTrack | None = None,
    held: Collection[Channel[Message]] = (),
    beside: Collection[Channel[Message]] = (),
    by_frame: Mapping[Channel[Message], int] = _NONE,
) -> Iterator[Bundle]:
    """One bundle per message of the channel `primary`, with `odometry` at its stamp if there is any.

    `messages` are (channel, log time, message) by log time. Stamps are the headers', log time where those are zero. Of
    a `held` channel a bundle gets the latest message that came at most `BESIDE_NS` after it, else the first; of
    transforms the latest of every frame so far. Of a channel `beside` it gets the message nearest to its stamp, within
    `BESIDE_NS`, among those that are nearer to no other bundle. Of the channels `by_frame` it gets one such message of
    each frame; there will be as many frames as the number says, or more. A bundle waits for what is still to come, at
    most `WINDOW_NS` of log time; then it goes without. `counts` is kept up to date.
    """
    table = _Table(primary, counts, odometry, (held, beside), by_frame)
    for channel, log_time_ns, message in messages:
        table.take(channel, log_time_ns, message)
        yield from table.ready(log_time_ns)
    yield from table.ready(None)


class _Table:
    """Where messages wait for each other."""

    def __init__(
        self,
        primary: Channel[Message],
        counts: Association,
        odometry: OdometryTrack | None,
        others: tuple[Collection[Channel[Message]], Collection[Channel[Message]]],
        by_frame: Mapping[Channel[Message], int],
    ) -> None:
        self._primary, self._counts, self._by_frame = primary, counts, by_frame
        self._odometry = odometry
        self._held: dict[Channel[Message], dict[str, _Held]] = {channel: {} for channel in others[0]}
        self._beside: dict[Channel[Message], dict[str, _Beside]] = {channel: {} for channel in others[1]}
        self._waiting: deque[Bundle] = deque()
        self._stamps: deque[int] = deque()  # of the bundles of the last moments, those that went included

    def take(self, channel: Channel[Message], log_time_ns: int, message: Message) -> None:
        stamp_ns = getattr(message, "stamp_ns", 0) or log_time_ns
        if channel == self._primary:
            self._waiting.append(Bundle(stamp_ns, log_time_ns, {channel: message}))
            self._stamps.append(stamp_ns)
        elif channel in self._held:
            self._held[channel].setdefault(self._frame(channel, message), _Held()).take(log_time_ns, message)
        elif channel in self._beside:
            partners = self._beside[channel].setdefault(self._frame(channel, message), _Beside())
            partners.messages.append((stamp_ns, message))

    def _frame(self, channel: Channel[Message], message: Message) -> str:
        """The frame of a message whose channel has one for each, else none."""
        return getattr(message, "frame_id", "") if channel in self._by_frame else ""

    def ready(self, log_time_ns: int | None) -> Iterator[Bundle]:
        """The bundles that have nothing more to wait for at a log time; at the end, None, that is all."""
        while self._waiting:
            first = self._waiting[0]
            out_of_time = log_time_ns is None or log_time_ns - first.log_time_ns > WINDOW_NS
            if not (out_of_time or self._is_complete(first)):
                return
            yield self._finish(self._waiting.popleft())
        if log_time_ns is None:
            for channel, frames in self._beside.items():
                self._counts.unpaired[channel.topic] += sum(len(partners.messages) for partners in frames.values())

    def _is_complete(self, bundle: Bundle) -> bool:
        stamp_ns = bundle.stamp_ns
        frames_of = {channel: sum(map(bool, frames.values())) for channel, frames in self._held.items()}
        frames_of |= {channel: len(frames) for channel, frames in self._beside.items()}
        if any(count < self._by_frame.get(channel, 1) for channel, count in frames_of.items()):
            return False
        # A later bundle may be nearer to a message that is near to this one.
        rivals_known = not self._beside or self._stamps[-1] > stamp_ns + 2 * BESIDE_NS
        partners = [one for frames in self._beside.values() for one in frames.values()]
        return rivals_known and all(one.passed(stamp_ns) for one in partners)

    def _duration_ns(self, bundle: Bundle) -> int:
        return getattr(bundle.messages[self._primary], "duration_ns", 0)

    def _finish(self, bundle: Bundle) -> Bundle:
        counts = self._counts
        counts.bundles += 1
        odometry = None
        if self._odometry is not None:
            odometry = self._odometry.at(bundle.stamp_ns)
            counts.without_odometry += odometry is None
            duration_ns = self._duration_ns(bundle)
            if odometry is not None and duration_ns:
                odometry = replace(odometry, samples=self._odometry.around(bundle.stamp_ns, duration_ns))
        found = self._others(bundle)
        firsts = {channel: messages[0] for channel, messages in found.items()}
        several = {channel: messages for channel, messages in found.items() if len(messages) > 1}
        while self._stamps[0] < bundle.stamp_ns - 2 * BESIDE_NS:
            self._stamps.popleft()
        return Bundle(bundle.stamp_ns, bundle.log_time_ns, {**bundle.messages, **firsts}, odometry, several)

    def _others(self, bundle: Bundle) -> dict[Channel[Message], tuple[Message, ...]]:
        """The messages of all channels but the primary one that go with a bundle; no channel without any."""
        found = {channel: self._holding(channel, bundle.log_time_ns) for channel in self._held}
        found |= {channel: self._partners(channel, bundle.stamp_ns) for channel in self._beside}
        self._counts.alone.update(channel.topic for channel in self._beside if not found[channel])
        return {channel: tuple(messages) for channel, messages in found.items() if messages}

    def _holding(self, channel: Channel[Message], log_time_ns: int) -> list[Message]:
        """The message of a held channel that holds at a log time, of each frame where it has several."""
        return [held.at(log_time_ns) for _, held in sorted(self._held[channel].items()) if held]

    def _partners(self, channel: Channel[Message], stamp_ns: int) -> list[Message]:
        """The messages of a channel that belong beside a bundle, one of each frame that has any."""
        found = []
        for _, partners in sorted(self._beside[channel].items()):
            partner = partners.pick(stamp_ns, self._stamps)
            self._counts.unpaired[channel.topic] += partners.forget(stamp_ns - BESIDE_NS)
            if partner is not None:
                found.append(partner)
        return found


class _Held:
    """Messages of a channel that hold from their log times on; of transforms, one with the latest of every frame."""

    def __init__(self) -> None:
        self._messages: deque[tuple[int, Message]] = deque()
        self._transforms: dict[str, Transform] = {}

    def __bool__(self) -> bool:
        return bool(self._messages or self._transforms)

    def take(self, log_time_ns: int, message: Message) -> None:
        if isinstance(message, TFMessage):
            self._transforms.update({step.child_frame_id: step for step in message.transforms})
            self._messages.clear()
        else:
            self._messages.append((log_time_ns, message))

    def at(self, log_time_ns: int) -> Message:
        """The latest message that came not much later than a log time, else the first; times never go back."""
        if not self._messages:
            self._messages.append((log_time_ns, TFMessage(tuple(self._transforms.values()))))
        while len(self._messages) > 1 and self._messages[1][0] <= log_time_ns + BESIDE_NS:
            self._messages.popleft()
        return self._messages[0][1]


class _Beside:
    """Messages of a channel that may still belong beside a bundle, with their stamps."""

    def __init__(self) -> None:
        self.messages: deque[tuple[int, Message]] = deque()

    def passed(self, stamp_ns: int) -> bool:
        """Whether messages have come that are too late for a bundle's stamp."""
        return bool(self.messages) and self.messages[-1][0] > stamp_ns + BESIDE_NS

    def pick(self, stamp_ns: int, rivals_ns: Iterable[int]) -> Message | None:
        """Take out the message nearest to a stamp, of those that no rival is nearer to."""
        mine = [
            (abs(at_ns - stamp_ns), i)
            for i, (at_ns, _) in enumerate(self.messages)
            if abs(at_ns - stamp_ns) <= min(BESIDE_NS, *(abs(at_ns - rival) for rival in rivals_ns))
        ]
        if not mine:
            return None
        _, nearest = min(mine)
        message = self.messages[nearest][1]
        del self.messages[nearest]
        return message

    def forget(self, before_ns: int) -> int:
        """Drop the messages before a time; return their number."""
        kept = [entry for entry in self.messages if entry[0] >= before_ns]
        dropped = len(self.messages) - len(kept)
        self.messages = deque(kept)
        return dropped
