"""Messages that hold until the next of their kind: where a log is cut, the latest before the cut come along."""

from collections.abc import Iterable, Mapping

from mcap_landmarks.channels import TF_STATIC
from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.messages.qos import KEY, is_latched
from mcap_landmarks.messages.transforms import TFMessage, child_frames_in
from mcap_landmarks.stage import Connection, RawMessage

_LOG_TYPES = frozenset({"rcl_interfaces/msg/Log", "rosgraph_msgs/msg/Log"})
_SERVICE_EVENTS = "/_service_event"


def latched(connections: Iterable[Connection]) -> list[Connection]:
    """The connections whose messages hold until the next one comes.

    These are camera information, static transforms and whatever else was latched, but for logs and service events,
    which are latched so that none is missed: they tell what happened at a time, and not what holds from then on.
    Where a log has no static transforms all of its transforms count, since ROS 1 and some drivers publish those of the
    sensors' mounting among the others.
    """
    every = list(connections)
    found = [connection for connection in every if _is_latched(connection)]
    if not any(connection.read_as == TFMessage.ROS_TYPE for connection in found):
        found += [connection for connection in every if connection.read_as == TFMessage.ROS_TYPE]
    return found


def _is_latched(connection: Connection) -> bool:
    if connection.message_type in _LOG_TYPES or connection.topic.endswith(_SERVICE_EVENTS):
        return False
    is_static = connection.topic.endswith(TF_STATIC.topic) and connection.read_as == TFMessage.ROS_TYPE
    return is_static or is_latched(connection.metadata.get(KEY, "")) or connection.read_as == CameraInfo.ROS_TYPE


def latest(raws: Iterable[RawMessage], start_ns: int) -> list[RawMessage]:
    """Of messages by log time those that hold at a time after all of them, logged then and otherwise as they were.

    That is the last one of each connection, and of transforms each message that is the last with one of its frames.
    """
    holding: dict[tuple[Connection, str], tuple[int, RawMessage]] = {}
    for order, raw in enumerate(raws):
        connection, _, publish_time_ns, sequence, data = raw
        # A copy of the payload: a view would hold its whole chunk.
        kept = RawMessage(connection, start_ns, publish_time_ns, sequence, bytes(data))
        for part in _parts(raw):
            holding[raw.connection, part] = order, kept
    by_order = dict(holding.values())
    return [by_order[order] for order in sorted(by_order)]


def _parts(raw: RawMessage) -> Iterable[str]:
    """What a message says something of: the child frames of transforms, none if they cannot be read."""
    if raw.connection.message_type != TFMessage.ROS_TYPE:
        return ("",)
    if (frames := child_frames_in(raw.data)) is not None:
        return frames
    try:
        return {transform.child_frame_id for transform in decode(TFMessage, raw.data).transforms}
    except MessageError:
        return ()


def carried_note(counts: Mapping[str, int]) -> str:
    """What is told of messages that `latest` gave, of their number by topic."""
    topics = ", ".join(f"{topic} ({count})" if count > 1 else topic for topic, count in sorted(counts.items()))
    return f"the latest from before the start is carried over and logged at it: {topics}"
