"""Which topics of a recording play which role: found by message type, or chosen by the user."""

import contextlib
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from mcap_landmarks import channels
from mcap_landmarks.errors import UsageError
from mcap_landmarks.inspection.cameras import ALL, NO_CAMERAS, Camera, Cameras, Named, cameras
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.images import CameraInfo, CompressedImage, Image
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import Odometry, PoseStamped
from mcap_landmarks.messages.scan import LaserScan, MultiEchoLaserScan
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.messages.video import CompressedVideo, TheoraPacket
from mcap_landmarks.stage import Channel, Connection, Readable


@dataclass(frozen=True, slots=True)
class Role:
    """What a channel is to the stages, the option that chooses its topic, and the messages that fit.

    `others` are messages that do as well, of a topic that the user chooses or that has the name `usual`; `instead` are
    those of them that are taken by themselves where there are none of `messages`.
    """

    name: str
    option: str
    messages: tuple[type[Message], ...]
    others: tuple[type[Message], ...] = ()
    usual: str = ""
    instead: tuple[type[Message], ...] = ()

    @property
    def types(self) -> tuple[str, ...]:
        """The message types that can be chosen."""
        return tuple(message.ROS_TYPE for message in (*self.messages, *self.others))


_VIDEOS = (CompressedVideo, TheoraPacket)
_OF_CAMERAS = (channels.CAMERA_IMAGE, channels.CAMERA_INFO)
ROLES: Mapping[Channel[Message], Role] = {
    channels.CAMERA_IMAGE: Role("image", "--image", (CompressedImage, Image), _VIDEOS, instead=_VIDEOS),
    channels.CAMERA_INFO: Role("camera_info", "--remap", (CameraInfo,)),
    channels.SCAN: Role(
        "scan", "--scan", (LaserScan,), (PointCloud2, MultiEchoLaserScan), instead=(MultiEchoLaserScan,)
    ),
    channels.SECOND_SCAN: Role("second_scan", "--scan", (), (LaserScan, PointCloud2, MultiEchoLaserScan)),
    channels.ODOMETRY: Role("odometry", "--odom", (Odometry,), (TFMessage, PoseStamped), channels.TF.topic),
    channels.SCENE_OBJECTS: Role("scene_objects", "--remap", (SceneObjects,)),
}


NO_TOPIC = "none"
"""In place of the topic of odometry: go on without it."""


@dataclass(frozen=True, slots=True)
class Choice:
    """What the user said about topics: role name to topic, FROM to TO of remapped ones, and images of several cameras.

    `images` has two or more topics or the word `all`; it is empty where there is one camera. `offsets_ns` are added to
    the stamps of a role's messages.
    """

    topics: Mapping[str, str] = field(default_factory=dict)
    remaps: Mapping[str, str] = field(default_factory=dict)
    images: tuple[str, ...] = ()
    offsets_ns: Mapping[str, int] = field(default_factory=dict)


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
    fitting = fitting or _of_types(present, [message.ROS_TYPE for message in role.instead])
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
    """Topics, of (topic, message type), that a user could choose as a channel that none is by itself; empty if none.

    Where scans are missing, topics of other types that sound like scans are named, too.
    """
    role, present = ROLES.get(channel), list(present)
    if role is None:
        return ""
    others = {message.ROS_TYPE for message in role.others}
    topics = [topic for topic, ros_type in present if ros_type in others]
    recorded = {topic for topic in topics if not topic.startswith((channels.RESULTS, channels.TRUTH))}
    fitting = sorted(topic for topic in recorded if not topic.endswith("_static"))
    how = "--scan-from TOPIC" if channel == channels.SCAN else f"{role.option} TOPIC"
    hints = [f"{' or '.join(fitting)} could be it, choose with {how}"] if fitting else []
    return "; ".join([*hints, *(_no_scans(present) if channel == channels.SCAN else [])])


_LIKE_SCANS = re.compile("scan|laser|lidar|echo|sonar|range|points|cloud|packets", re.IGNORECASE)
"""What topics and types are called that carry what a LiDAR or the like measures."""
_FOXGLOVE = ("foxglove.", "foxglove_msgs/")
_SINGLE_RANGE = "sensor_msgs/msg/Range"


def _no_scans(present: Iterable[tuple[str, str]]) -> list[str]:
    """Topics that sound like scans and cannot be read as such, with their types."""
    role = ROLES[channels.SCAN]
    said = []
    for topic, ros_type in sorted(set(present)):
        if ros_type in role.types or topic.startswith((channels.RESULTS, channels.TRUTH)):
            continue
        if ros_type == _SINGLE_RANGE:
            said.append(f"{topic} is {ros_type}: single ranges are not used")
        elif ros_type.startswith(_FOXGLOVE):
            if ros_type.endswith(("LaserScan", "PointCloud")):
                said.append(f"{topic} is {ros_type}, which convert makes a message of ROS 2")
        elif _LIKE_SCANS.search(f"{topic} {ros_type.rpartition('/')[2]}"):
            said.append(
                f"{topic} is {ros_type}, which is read as no scan; have its driver record LaserScan or PointCloud2"
            )
    return said


def choose(recording: Readable, channel: Channel[Message], choice: Choice) -> tuple[Connection, ...]:
    """The connections that a role is read from, none if the recording has no such topic.

    Raises:
        UsageError: the chosen topic is missing or of another type, or several topics fit and none was chosen.
    """
    named = _named(recording, choice)
    role = ROLES.get(channel)
    if role is None:  # transforms that never change come on /tf as well, from ROS 1 and some drivers
        topics = {channel.topic, channels.TF.topic} if channel == channels.TF_STATIC else {channel.topic}
        return tuple(connection for topic, connection in named if topic in topics)
    if choice.images and channel in _OF_CAMERAS:
        return _of_cameras(channel, cameras_of(recording, choice).used, named)
    chosen = _chosen(recording, channel, named, choice)
    found = tuple(connection for topic, connection in named if topic in chosen)
    if chosen and not any(connection.read_as in role.types for connection in found):
        _check_chosen(recording, role, chosen[0], found)
    return _of_role(role, found)


def _of_role(role: Role, connections: Iterable[Connection]) -> tuple[Connection, ...]:
    """The connections that fit a role: two programs may share a topic, with a type each."""
    return tuple(connection for connection in connections if connection.read_as in role.types)


def _chosen(recording: Readable, channel: Channel[Message], named: Named, choice: Choice) -> list[str]:
    """The topics of a role: the one that the user chose, else what fits."""
    role = ROLES[channel]
    if channel == channels.ODOMETRY and choice.topics.get(role.name) == NO_TOPIC:
        return []
    if role.name in choice.topics:
        return [choice.topics[role.name]]
    fitting = topics_for(role, [(topic, connection.read_as) for topic, connection in named])
    return _only(recording, channel, fitting, choice)


def cameras_of(recording: Readable, choice: Choice) -> Cameras:
    """The cameras that the user chose, none where it is not several.

    Raises:
        UsageError: see `cameras`.
    """
    return cameras(recording, _named(recording, choice), choice.images) if choice.images else NO_CAMERAS


def chosen_before(recording: Readable, options: Iterable[Mapping[str, object]]) -> Choice:
    """The images in a recording that results in it were made of, as the options of their stages tell."""
    for told in options:
        topics, images = told.get("topics"), told.get("images")
        choice = Choice(images=tuple(map(str, images)) if isinstance(images, list) else ())
        if isinstance(topics, Mapping) and "image" in topics:
            choice = Choice({"image": str(topics["image"])})
        with contextlib.suppress(UsageError):
            if (choice.images or choice.topics) and choose(recording, channels.CAMERA_IMAGE, choice):
                return choice
    return Choice()


def _named(recording: Readable, choice: Choice) -> list[tuple[str, Connection]]:
    connections = [entry.connection for entry in recording.channels]
    return [(choice.remaps.get(connection.topic, connection.topic), connection) for connection in connections]


def _of_cameras(channel: Channel[Message], used: Sequence[Camera], named: Named) -> tuple[Connection, ...]:
    topics = {one.image if channel == channels.CAMERA_IMAGE else one.info for one in used}
    return tuple(connection for topic, connection in named if topic in topics)


def _only(recording: Readable, channel: Channel[Message], fitting: list[str], choice: Choice) -> list[str]:
    """The one topic that fits, none if none does; every CameraInfo where there is none or more than one camera's image.

    Raises:
        UsageError: several fit.
    """
    role, images = ROLES[channel], []
    if channel == channels.CAMERA_INFO and len(fitting) > 1:
        images = _images(recording, choice)
        if len(images) != 1:  # boxes say by their frame whose they are
            return fitting
        fitting = _of_the_image(images[0], fitting)
        if len(fitting) > 1:
            info = cameras(recording, _named(recording, choice), images).used[0].info
            fitting = fitting if info is None else [info]
    if len(fitting) > 1:
        how = f"{role.option} TOPIC" if role.option != "--remap" else f"--remap TOPIC={channel.topic}"
        how += ", twice to merge two" if channel == channels.SCAN else ""
        how += f", several times or --image {ALL} for several cameras" if channel == channels.CAMERA_IMAGE else ""
        raise UsageError(f"{recording.path}: {' and '.join(fitting)} could be the {role.name}; choose with {how}")
    return fitting


def _check_chosen(recording: Readable, role: Role, topic: str, found: Collection[Connection]) -> None:
    if not found:
        raise UsageError(
            f"{recording.path}: there is no topic {topic} to read as the {role.name}; mcap-landmarks info lists them"
        )
    for connection in found:
        if connection.read_as not in role.types:
            raise UsageError(
                f"{recording.path}: {connection.topic} is {connection.message_type}{_encoding(connection)}, but "
                f"{role.option} needs {' or '.join(role.types)}"
            )


def _encoding(connection: Connection) -> str:
    """The encoding of messages that are not of CDR, in words."""
    return "" if connection.read_as else f" in {connection.message_encoding or 'an unknown encoding'}"


def _images(recording: Readable, choice: Choice) -> list[str]:
    """The topics that could be the image, or the one that was chosen."""
    role, named = ROLES[channels.CAMERA_IMAGE], _named(recording, choice)
    chosen = choice.topics.get(role.name)
    return [chosen] if chosen else topics_for(role, [(topic, entry.read_as) for topic, entry in named])


def _of_the_image(image: str, infos: list[str]) -> list[str]:
    """The topics of CameraInfo that share most namespaces with the image; all where that does not tell them apart."""
    shared = {topic: channels.shared_namespaces(image, topic) for topic in infos}
    return [topic for topic in infos if shared[topic] == max(shared.values())]


def message_type(channel: Channel[Message], connection: Connection) -> type[Message]:
    """The dataclass of a connection's messages, where it is read as a channel: an image has two, odometry three."""
    role = ROLES.get(channel)
    known = (*role.messages, *role.others) if role else ()
    fitting = (message for message in known if connection.message_type == message.ROS_TYPE)
    return next(iter(fitting), channel.message)
