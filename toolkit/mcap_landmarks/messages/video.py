"""CompressedVideo and theora's Packet: pieces of videos, which are images only after those before them."""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from mcap_landmarks.messages.parts import header_to_ros, make, stamp_from_ros, stamp_to_ros
from mcap_landmarks.messages.typestore import RosObject

_CODECS = {"h264": "h264", "h265": "hevc", "hevc": "hevc", "vp9": "vp9", "av1": "libdav1d", "theora": "theora"}
"""FFmpeg's decoders, by what messages call the codecs."""


def codec_of(form: str) -> str | None:
    """FFmpeg's decoder for the format that a message names, None where that is no video."""
    return _CODECS.get(form.partition(";")[0].strip().lower())


@dataclass(frozen=True, slots=True, eq=False)
class CompressedVideo:
    """One image of a video in Foxglove's message; `format` is the codec, such as `h264`."""

    ROS_TYPE: ClassVar[str] = "foxglove_msgs/msg/CompressedVideo"

    stamp_ns: int
    frame_id: str
    format: str
    data: bytes

    def to_ros(self) -> RosObject:
        """See `Message`."""
        return make(
            "foxglove_msgs/CompressedVideo",
            timestamp=stamp_to_ros(self.stamp_ns),
            frame_id=self.frame_id,
            data=np.frombuffer(self.data, dtype=np.uint8),
            format=self.format,
        )

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        return cls(stamp_from_ros(ros.timestamp), ros.frame_id, ros.format, ros.data.tobytes())


@dataclass(frozen=True, slots=True, eq=False)
class TheoraPacket:
    """One packet of Ogg Theora as theora_image_transport sends it: the first three, its headers, are no images.

    `number` rises by one with each: where it does not, packets are missing.
    """

    ROS_TYPE: ClassVar[str] = "theora_image_transport/msg/Packet"

    stamp_ns: int
    frame_id: str
    number: int
    data: bytes

    format: ClassVar[str] = "theora"

    @property
    def is_header(self) -> bool:
        """Whether it begins as headers do (Theora specification, section 6.1)."""
        return self.data[1:7] == b"theora" and self.data[0] >= 0x80

    def to_ros(self) -> RosObject:
        """See `Message`."""
        return make(
            "theora_image_transport/Packet",
            header=header_to_ros(self.stamp_ns, self.frame_id),
            data=np.frombuffer(self.data, dtype=np.uint8),
            b_o_s=int(self.number == 0),
            e_o_s=0,
            granulepos=0,
            packetno=self.number,
        )

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        return cls(stamp_from_ros(ros.header.stamp), ros.header.frame_id, int(ros.packetno), ros.data.tobytes())
