"""std_msgs/UInt8."""

from dataclasses import dataclass
from typing import Any, ClassVar, Self

from mcap_landmarks.messages.parts import make


@dataclass(frozen=True, slots=True)
class UInt8:
    """A small whole number."""

    ROS_TYPE: ClassVar[str] = "std_msgs/msg/UInt8"

    data: int

    def to_ros(self) -> Any:
        """See `Message`."""
        return make("std_msgs/UInt8", data=self.data)

    @classmethod
    def from_ros(cls, ros: Any) -> Self:
        """See `Message`."""
        return cls(int(ros.data))
