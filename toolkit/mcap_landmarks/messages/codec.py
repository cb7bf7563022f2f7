"""Message dataclasses to CDR bytes and back."""

from collections.abc import Callable
from struct import error as struct_error
from typing import ClassVar, Protocol, Self, TypeVar

from rosbags.serde import SerdeError
from rosbags.typesys.store import Typestore

from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.typestore import RosObject, typestore, typestore_in


class Message(Protocol):
    """What every message dataclass offers."""

    ROS_TYPE: ClassVar[str]

    def to_ros(self) -> RosObject:
        """Give the same content as an object of the typestore."""

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """Take the content of an object of the typestore."""


M = TypeVar("M", bound=Message)
T = TypeVar("T")


def encode(message: Message) -> bytes:
    """CDR bytes (little endian) of a message."""
    return bytes(typestore().serialize_cdr(message.to_ros(), message.ROS_TYPE))


def decode(message_type: type[M], data: bytes | memoryview, schema: str = "") -> M:
    """Message of the given dataclass from CDR bytes.

    `schema` is the text of the type's definition in the log: one of ours that was written by an earlier version has
    less fields, and the others keep their defaults.

    Raises:
        MessageError: the bytes do not fit the type.
    """
    return read_as(message_type.from_ros, message_type.ROS_TYPE, data, schema)


def read_as(take: Callable[[RosObject], T], ros_type: str, data: bytes | memoryview, schema: str = "") -> T:
    """What `take` makes of a message of a type from CDR bytes; for the rest see `decode`."""
    return read_with(typestore_in(ros_type, schema) if schema else typestore(), take, ros_type, data)


def read_with(store: Typestore, take: Callable[[RosObject], T], ros_type: str, data: bytes | memoryview) -> T:
    """The same by the definitions of a typestore."""
    try:
        return take(store.deserialize_cdr(data, ros_type))
    except (SerdeError, struct_error, IndexError, ValueError, UnicodeDecodeError) as error:
        raise MessageError(f"{len(data)} bytes are not a {ros_type}: {error or type(error).__name__}") from error
