"""The messages of a log around a moment, of which a bundle takes its own and what its sensors saw beside it."""

import contextlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from mcap_landmarks.channels import CAMERA_INFO, DETECTIONS
from mcap_landmarks.errors import MessageError
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.messages.codec import M, Message
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.header import frame_in, stamp_in
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.stage import Channel, Connection, RawMessage

BESIDE_NS = 10**9
"""How far from a bundle what its sensors saw may be: the slowest cameras of robots give an image a second."""


@dataclass(frozen=True, slots=True, eq=False)
class MessagesAround:
    """The messages around a moment, by channel, time and camera, which is empty where it does not matter."""

    messages: dict[Channel[Message], dict[tuple[int, str], Message]]

    def at(self, channel: Channel[M], time_ns: int) -> M | None:
        """The message of a time."""
        message = self.messages[channel].get((time_ns, ""))
        return message if isinstance(message, channel.message) else None

    def nearest(self, channel: Channel[Message], time_ns: int, camera: str) -> Message | None:
        """The message of a camera that is nearest to a time, None if it is too far away."""
        messages = self.messages[channel]
        times = [key for key in messages if key[1] == camera]
        nearest = min(times, key=lambda key: abs(key[0] - time_ns), default=None)
        return None if nearest is None or abs(nearest[0] - time_ns) > BESIDE_NS else messages[nearest]

    def camera_info(self, detections: Detections) -> CameraInfo | None:
        """The CameraInfo of the frame of some detections that is nearest to them; the only frame's may have another."""
        infos, frame = self.messages[CAMERA_INFO], plain(detections.frame_id)
        keys = [key for key in infos if key[1] == frame]
        if not keys and len({camera for _, camera in infos}) == 1:
            keys = [*infos]
        nearest = min(keys, key=lambda key: abs(key[0] - detections.stamp_ns), default=None)
        found = None if nearest is None else infos[nearest]
        return found if isinstance(found, CameraInfo) else None

    def detections(self, time_ns: int) -> dict[str, Detections]:
        """The detections nearest to a time, by camera."""
        cameras = sorted({camera for _, camera in self.messages[DETECTIONS]})
        found = {camera: self.nearest(DETECTIONS, time_ns, camera) for camera in cameras}
        return {camera: message for camera, message in found.items() if isinstance(message, Detections)}


def stamp_of(raw: RawMessage) -> int:
    """The stamp of a message that is not decoded; its log time where that is zero, or there is none."""
    with contextlib.suppress(MessageError):
        return stamp_in(raw.data) or raw.log_time_ns
    return raw.log_time_ns


def nearest_of(raws: Sequence[RawMessage], moments_ns: Iterable[int]) -> list[RawMessage]:
    """Of each connection and frame the message that is nearest to each moment, the earlier one of two."""
    groups: dict[tuple[Connection, str], list[tuple[int, RawMessage]]] = {}
    for raw in raws:
        groups.setdefault((raw.connection, frame_in(raw.data)), []).append((stamp_of(raw), raw))
    return [
        group[row][1]
        for group in groups.values()
        for row in {_nearest([stamp_ns for stamp_ns, _ in group], moment_ns): None for moment_ns in moments_ns}
    ]


def _nearest(stamps_ns: Sequence[int], moment_ns: int) -> int:
    return min(range(len(stamps_ns)), key=lambda row: abs(stamps_ns[row] - moment_ns))
