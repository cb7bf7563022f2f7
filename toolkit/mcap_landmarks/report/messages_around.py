"""The messages of a log around a moment, of which a bundle takes its own and what its sensors saw beside it."""

from dataclasses import dataclass

from mcap_landmarks.channels import CAMERA_INFO, DETECTIONS
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.messages.codec import M, Message
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.stage import Channel

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
