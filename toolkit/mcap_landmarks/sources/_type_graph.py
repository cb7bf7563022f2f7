"""Message types by name, and what they need: the tables that definitions are made of and compared by."""

from collections.abc import Callable, Mapping

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import Constdefs

from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.definition_extent import FieldType, check_extent

Fields = list[tuple[str, FieldType]]
MessageFields = tuple[Constdefs, Fields]
Types = Mapping[str, MessageFields]
FILLER = "structure_needs_at_least_one_member"
"""The field of a byte that ROS 2 puts into messages without any."""
_REMEDY = "; give it with --definitions"
_DEEPEST = 64
"""Levels of nesting; those of real messages are below ten, and deeper ones are taken for damage."""


def nested_in(kind: FieldType) -> str | None:
    """Name of the message type in a field, None if it holds numbers or text."""
    inner = kind[1][0] if kind[0] in {Nodetype.ARRAY, Nodetype.SEQUENCE} else kind
    return str(inner[1]) if inner[0] == Nodetype.NAME else None


def needed_by(name: str, find: Callable[[str], MessageFields | None]) -> dict[str, MessageFields]:
    """A type with all that it needs, itself first; `find` knows each of them.

    Raises:
        MessageError: something is missing, a type holds itself, or it expands to too much.
    """
    found: dict[str, MessageFields] = {}

    def take(one: str, within: tuple[str, ...]) -> None:
        if one in within or len(within) > _DEEPEST:
            raise MessageError(f"{one} holds itself")
        if one in found:
            return
        fields = find(one)
        if fields is None:
            raise MessageError(f"nothing defines {one}" + (f", which {within[-1]} needs" if within else "") + _REMEDY)
        found[one] = fields
        for _, kind in fields[1]:
            if nested := nested_in(kind):
                take(nested, (*within, one))

    take(name, ())
    check_extent({one: fields for one, (_, fields) in found.items()}, name)
    return found


def filled(types: Types) -> dict[str, MessageFields]:
    """Types as ROS 2 serializes them: none without a field."""
    filler: Fields = [(FILLER, (Nodetype.BASE, ("uint8", 0)))]
    return {name: (constants, fields or filler) for name, (constants, fields) in types.items()}


def alike(one: Types, other: Types) -> bool:
    """Whether messages of two sets of types have the same bytes; constants and the case of names do not matter."""
    return one.keys() == other.keys() and all(
        [(name.lower(), kind) for name, kind in fields] == [(name.lower(), kind) for name, kind in other[type_][1]]
        for type_, (_, fields) in one.items()
    )
