"""How many fields a message type has with those of all types in it: what is made of a definition grows with that."""

from collections.abc import Mapping
from typing import Any

from rosbags.interfaces import Nodetype

from mcap_landmarks.errors import MessageError

FieldType = Any  # of rosbags: (kind, content), nested
MOST_FIELDS = 20_000
"""Of the 177 types of ROS 2 that rosbags knows the largest expands to some hundred fields, MoveIt's to a few thousand;
a definition of a kilobyte can expand to 2**30."""
_DEEPEST = 64
"""Levels of nesting; those of real messages are below ten."""


def check_extent(types: Mapping[str, list[tuple[str, FieldType]]], name: str) -> None:
    """Refuse a type that expands to too much, by the fields of all types that it needs.

    Raises:
        MessageError: it has too many fields, or holds itself.
    """
    known: dict[str, int] = {}

    def extent(of: str, depth: int) -> int:
        if depth > _DEEPEST:
            raise MessageError(f"{of} holds itself, or is nested too deeply")
        if of not in known:
            fields = types.get(of, ())  # of what is missing the registry tells
            known[of] = sum(extent(inner, depth + 1) if (inner := _nested(kind)) else 1 for _, kind in fields)
        if known[of] > MOST_FIELDS:
            raise MessageError(f"{of} has more than {MOST_FIELDS} fields with those of all types in it")
        return known[of]

    extent(name, 0)


def _nested(kind: FieldType) -> str | None:
    inner = kind[1][0] if kind[0] in {Nodetype.ARRAY, Nodetype.SEQUENCE} else kind
    return str(inner[1]) if inner[0] == Nodetype.NAME else None
