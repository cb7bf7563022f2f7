"""std_msgs/UInt8."""

from dataclasses import dataclass
from typing import ClassVar, Self

from mcap_landmarks.messages.parts import make
from mcap_landmarks.messages.typestore import RosObject


@dataclass(frozen=True, slots=True)
class UInt8:
    """A small whole number."""

    ROS_TYPE: ClassVar[str] = "std_msgs/msg/UInt8"

    data: int

    def to_ros(self) -> RosObject:
        """See `Message`."""
        return make("std_msgs/UInt8", data=self.data)

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        return cls(int(ros.data))
