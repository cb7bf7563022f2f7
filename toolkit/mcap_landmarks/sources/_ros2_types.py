"""What the distributions of ROS 2 call their types, as far as they are known."""

from functools import cache

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from mcap_landmarks.errors import MessageError, UsageError
from mcap_landmarks.messages.typestore import OWN_PACKAGES, typestore
from mcap_landmarks.sources._type_graph import MessageFields, alike, needed_by

_STORES = {store.value.removeprefix("ros2_"): store for store in Stores if store.value.startswith("ros2_")}
_SPOKEN = "humble"
"""The distribution whose text a type gets that is the same in all: as converted ROS 1 types do."""


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


def fields_in(distribution: str, message_type: str) -> MessageFields | None:
    """The fields of a type in a distribution, None if it has none of that name."""
    return _store(distribution).fielddefs.get(message_type)


def fields_of_all(message_type: str) -> MessageFields | None:
    """The fields of a type that is the same, with all it needs, in every distribution that has it; else None."""
    there = having(message_type)
    if not there:
        return None
    try:
        first, *others = [needed_by(message_type, _store(name).fielddefs.get) for name in there]
    except MessageError:
        return None
    if not all(alike(first, other) for other in others):
        return None
    return fields_in(_SPOKEN if _SPOKEN in there else there[-1], message_type)


def having(message_type: str) -> list[str]:
    """The distributions that have a type, in the order of their age."""
    return [name for name in _STORES if message_type in _store(name).fielddefs]


def own_fields(message_type: str) -> MessageFields | None:
    """The fields of a type of the packages that this toolkit defines itself, None for others."""
    return typestore().fielddefs.get(message_type) if message_type.partition("/")[0] in OWN_PACKAGES else None
