"""Which topics of a recording play which role: found by message type, or chosen by the user."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from toolkit import channels
from toolkit.errors import UsageError
from toolkit.recording.reader import Recording
from toolkit.stage import Channel, Connection

OWN_OBJECTS = frozenset({"/landmarks/scan_objects", channels.MAP.topic, channels.TRUTH_OBJECTS.topic})


@dataclass(frozen=True, slots=True)
class Role:
    """What a channel is to the stages, the option that chooses its topic, and the message types that fit."""

    name: str
    option: str
    types: tuple[str, ...]


ROLES: Mapping[Channel[Any], Role] = {
    channels.CAMERA_IMAGE: Role("image", "--image", ("sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image")),
    channels.CAMERA_INFO: Role("camera_info", "--remap", ("sensor_msgs/msg/CameraInfo",)),
    channels.SCAN: Role("scan", "--scan", ("sensor_msgs/msg/LaserScan",)),
    channels.ODOMETRY: Role("odometry", "--odom", ("nav_msgs/msg/Odometry",)),
    channels.SCENE_OBJECTS: Role("scene_objects", "--remap", ("vision_msgs/msg/Detection3DArray",)),
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
    fitting = sorted({topic for topic, message_type in present if message_type in role.types})
    if role.name == "scene_objects":
        if channels.SCENE_OBJECTS.topic in fitting:
            return [channels.SCENE_OBJECTS.topic]
        return [topic for topic in fitting if topic not in OWN_OBJECTS]
    return [topic for topic in fitting if not topic.startswith("/landmarks/")]


def choose(recording: Recording, channel: Channel[Any], choice: Choice) -> tuple[Connection, ...]:
    """The connections that a role is read from, none if the recording has no such topic.

    Raises:
        UsageError: the chosen topic is missing or of another type, or several topics fit and none was chosen.
    """
    named = [
        (choice.remaps.get(entry.connection.topic, entry.connection.topic), entry.connection)
        for entry in recording.channels
    ]
    role = ROLES.get(channel)
    if role is None:
        return tuple(connection for topic, connection in named if topic == channel.topic)
    present = [(topic, connection.message_type) for topic, connection in named]
    asked = choice.topics.get(role.name)
    fitting = topics_for(role, present)
    if asked is None and len(fitting) > 1:
        how = f"{role.option} TOPIC" if role.option != "--remap" else f"--remap TOPIC={channel.topic}"
        raise UsageError(f"{recording.path}: {' and '.join(fitting)} could be the {role.name}; choose with {how}")
    topic = asked or (fitting[0] if fitting else None)
    found = tuple(connection for name, connection in named if name == topic)
    if asked and not found:
        raise UsageError(
            f"{recording.path}: there is no topic {asked} for {role.option}; mcap-landmarks info lists them"
        )
    for connection in found:
        if connection.message_type not in role.types:
            raise UsageError(
                f"{recording.path}: {connection.topic} is {connection.message_type}, but {role.option} needs "
                f"{' or '.join(role.types)}"
            )
    return found
