"""Which topics of a recording play which role: found by message type, or chosen by the user."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from mcap_landmarks import channels
from mcap_landmarks.errors import UsageError
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.images import CameraInfo, CompressedImage, Image
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import Odometry, PoseStamped
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.stage import Channel, Connection, Readable


@dataclass(frozen=True, slots=True)
class Role:
    """What a channel is to the stages, the option that chooses its topic, and the messages that fit.

    `others` are messages that do as well, of a topic that the user chooses or that has the name `usual`.
    """

    name: str
    option: str
    messages: tuple[type[Message], ...]
    others: tuple[type[Message], ...] = ()
    usual: str = ""

    @property
    def types(self) -> tuple[str, ...]:
        """The message types that can be chosen."""
        return tuple(message.ROS_TYPE for message in (*self.messages, *self.others))


ROLES: Mapping[Channel[Message], Role] = {
    channels.CAMERA_IMAGE: Role("image", "--image", (CompressedImage, Image)),
    channels.CAMERA_INFO: Role("camera_info", "--remap", (CameraInfo,)),
    channels.SCAN: Role("scan", "--scan", (LaserScan,), (PointCloud2,)),
    channels.SECOND_SCAN: Role("second_scan", "--scan", (), (LaserScan, PointCloud2)),
    channels.ODOMETRY: Role("odometry", "--odom", (Odometry,), (TFMessage, PoseStamped), channels.TF.topic),
    channels.SCENE_OBJECTS: Role("scene_objects", "--remap", (SceneObjects,)),
}


@dataclass(frozen=True, slots=True)
class Choice:
    """What the user said about topics: role name to topic, and FROM to TO of remapped topics."""

    topics: Mapping[str, str] = field(default_factory=dict)
    remaps: Mapping[str, str] = field(default_factory=dict)


def parse_remaps(texts: Sequence[str]) -> dict[str, str]:
    """FROM to TO of texts `FROM=TO`.

    Raises:
        UsageError: a text without both.
    """
    remaps = {}
    for text in texts:
        source, _, target = text.partition("=")
        if not (source and target):
            raise UsageError(f"--remap {text}: write FROM=TO, such as /robot1/odom=/odom")
        remaps[source] = target
    return remaps


def topics_for(role: Role, present: Collection[tuple[str, str]]) -> list[str]:
    """Topics that fit a role, of (topic, message type); scene objects on our own topic leave the others out."""
    fitting = _of_types(present, [message.ROS_TYPE for message in role.messages])
    if not fitting and role.usual in _of_types(present, role.types):
        fitting = [role.usual]
    if role.name == "scene_objects":
        if channels.SCENE_OBJECTS.topic in fitting:
            return [channels.SCENE_OBJECTS.topic]
        return [topic for topic in fitting if topic not in channels.NO_SCENES]
    return [topic for topic in fitting if not topic.startswith(channels.RESULTS)]


def _of_types(present: Collection[tuple[str, str]], types: Collection[str]) -> list[str]:
    return sorted({topic for topic, ros_type in present if ros_type in types})


def could_be(present: Iterable[tuple[str, str]], channel: Channel[Message]) -> str:
    """Topics, of (topic, message type), that a user could choose as a channel that none is by itself; empty if none."""
    role = ROLES.get(channel)
    if role is None:
        return ""
    others = {message.ROS_TYPE for message in role.others}
    topics = [topic for topic, ros_type in present if ros_type in others]
    recorded = {topic for topic in topics if not topic.startswith((channels.RESULTS, channels.TRUTH))}
    fitting = sorted(topic for topic in recorded if not topic.endswith("_static"))
    how = "--scan-from TOPIC" if channel == channels.SCAN else f"{role.option} TOPIC"
    return f"{' or '.join(fitting)} could be it, choose with {how}" if fitting else ""


def choose(recording: Readable, channel: Channel[Message], choice: Choice) -> tuple[Connection, ...]:
    """The connections that a role is read from, none if the recording has no such topic.

    Raises:
        UsageError: the chosen topic is missing or of another type, or several topics fit and none was chosen.
    """
    named = [
        (choice.remaps.get(entry.connection.topic, entry.connection.topic), entry.connection)
        for entry in recording.channels
    ]
    role = ROLES.get(channel)
    if role is None:  # transforms that never change come on /tf as well, from ROS 1 and some drivers
        topics = {channel.topic, channels.TF.topic} if channel == channels.TF_STATIC else {channel.topic}
        return tuple(connection for topic, connection in named if topic in topics)
    chosen = choice.topics.get(role.name)
    if chosen is None:
        fitting = topics_for(role, [(topic, connection.message_type) for topic, connection in named])
        chosen = _only(recording, channel, fitting, choice)
    if chosen is None:
        return ()
    found = tuple(connection for topic, connection in named if topic == chosen)
    _check_chosen(recording, role, chosen, found)
    return found


def _only(recording: Readable, channel: Channel[Message], fitting: list[str], choice: Choice) -> str | None:
    """The one topic that fits, None if none does.

    Raises:
        UsageError: several fit.
    """
    if channel == channels.CAMERA_INFO and len(fitting) > 1:
        fitting = _of_the_image(recording, fitting, choice)
    if len(fitting) > 1:
        role = ROLES[channel]
        how = f"{role.option} TOPIC" if role.option != "--remap" else f"--remap TOPIC={channel.topic}"
        how += ", twice to merge two" if channel == channels.SCAN else ""
        raise UsageError(f"{recording.path}: {' and '.join(fitting)} could be the {role.name}; choose with {how}")
    return fitting[0] if fitting else None


def _check_chosen(recording: Readable, role: Role, topic: str, found: Collection[Connection]) -> None:
    if not found:
        raise UsageError(
            f"{recording.path}: there is no topic {topic} for {role.option}; mcap-landmarks info lists them"
        )
    for connection in found:
        if connection.message_type not in role.types:
            raise UsageError(
                f"{recording.path}: {connection.topic} is {connection.message_type}, but {role.option} needs "
                f"{' or '.join(role.types)}"
            )


def _of_the_image(recording: Readable, infos: list[str], choice: Choice) -> list[str]:
    """The topics of CameraInfo that share most namespaces with the image; all where that does not tell them apart."""
    images = choose(recording, channels.CAMERA_IMAGE, choice)
    if not images:
        return infos
    shared = {topic: channels.shared_namespaces(images[0].topic, topic) for topic in infos}
    return [topic for topic in infos if shared[topic] == max(shared.values())]


def message_type(channel: Channel[Message], connection: Connection) -> type[Message]:
    """The dataclass of a connection's messages, where it is read as a channel: an image has two, odometry three."""
    role = ROLES.get(channel)
    known = (*role.messages, *role.others) if role else ()
    fitting = (message for message in known if connection.message_type == message.ROS_TYPE)
    return next(iter(fitting), channel.message)
