"""Channels that results share with a log's own messages, such as /tf: which messages are results there.

A topic that many write to has one channel in an output, as viewers expect, and its messages lie in the order of time.
A result is known there by the child frame of its transforms: it is written only where no other transform has that frame
as child, since a frame has one parent.
"""

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, field

from mcap_landmarks.channels import SHARED
from mcap_landmarks.errors import MessageError
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.manifest import RUN, SHARED_CHANNELS, STAGE, told
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.qos import KEY, qos_profile
from mcap_landmarks.messages.transforms import TFMessage, frames_in
from mcap_landmarks.messages.typestore import definition
from mcap_landmarks.stage import Connection, RawMessage


def result_connection(topic: str, ros_type: str, stage: str, *, latched: bool = False) -> Connection:
    """The connection that results of a stage go to, or with no stage any messages of ours."""
    metadata = {KEY: qos_profile(latched=latched)} | ({STAGE: stage} if stage else {})
    return Connection(topic, ros_type, definition(ros_type).encode(), metadata=metadata)


@dataclass(slots=True)
class SharedTransforms:
    """The results of a stage among the transforms of a channel: the child frames that tell them, and their number."""

    channel_id: int
    children: set[str] = field(default_factory=set)
    count: int = 0

    def add(self, raw: RawMessage) -> None:
        """Take one more result."""
        self.children |= _children(raw)
        self.count += 1

    def has(self, raw: RawMessage) -> bool:
        """Whether a message of the channel is a result."""
        return not self.children.isdisjoint(_children(raw))

    def has_not(self, raw: RawMessage) -> bool:
        """Whether a message of the channel is the log's own."""
        return not self.has(raw)

    def entry(self) -> dict[str, object]:
        """What a manifest says of them."""
        return {"channel": self.channel_id, "children": sorted(self.children), "count": self.count}


def can_share(own: Connection, result: Connection) -> bool:
    """Whether results may go to a channel of the log's own: same topic, and messages that are read alike."""
    return own.topic in SHARED and own.topic == result.topic and own.read_as == result.read_as == TFMessage.ROS_TYPE


def shared_in(metadata: Mapping[str, Mapping[str, str]]) -> dict[str, SharedTransforms]:
    """The results on channels of the log's own, by stage, as the manifest of an output of ours tells."""
    stages: dict[str, object] = told(metadata.get(RUN, {}).get(SHARED_CHANNELS), {})
    found = {}
    for stage, entry in stages.items():
        if isinstance(entry, dict):
            with contextlib.suppress(KeyError, TypeError, ValueError):  # of another version, or edited
                names = {str(name) for name in entry["children"]}
                found[stage] = SharedTransforms(int(entry["channel"]), names, int(entry["count"]))
    return found


def _children(raw: RawMessage) -> set[str]:
    """The child frames of a message's transforms; none where it cannot be read."""
    single = frames_in(raw.data)
    if single is not None:
        return {plain(single[1])}
    try:
        return {plain(step.child_frame_id) for step in decode(TFMessage, raw.data).transforms}
    except MessageError:
        return set()
