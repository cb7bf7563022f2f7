"""Definitions of ROS 2 types that a recording does not carry itself, by distribution."""

from functools import cache

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from mcap_landmarks.errors import MessageError, UsageError

_STORES = {store.value.removeprefix("ros2_"): store for store in Stores if store.value.startswith("ros2_")}


def known_distribution(name: str) -> bool:
    """Whether the definitions of a distribution are known."""
    return name in _STORES


def check_distribution(name: str) -> None:
    """Refuse a name that the user gave.

    Raises:
        UsageError: no such distribution is known.
    """
    if name not in _STORES:
        raise UsageError(f"--distro {name} is unknown; known are {', '.join(sorted(_STORES))}")


@cache
def _store(distribution: str) -> Typestore:
    return get_typestore(_STORES[distribution])


def definition_in(distribution: str, message_type: str) -> str | None:
    """The `ros2msg` definition of a type, None if the distribution has none."""
    store = _store(distribution)
    return store.generate_msgdef(message_type, ros_version=2)[0] if message_type in store.fielddefs else None


def check_fits(distribution: str, message_type: str, data: bytes | memoryview) -> None:
    """Decode a message to its full length.

    Raises:
        MessageError: the bytes are not the distribution's version of the type.
    """
    try:
        _store(distribution).deserialize_cdr(data, message_type)
    except (SerdeError, IndexError, ValueError) as error:
        raise MessageError(f"{len(data)} bytes are not {distribution}'s {message_type}: {error}") from error
