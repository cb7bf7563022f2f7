"""ROS 1 messages to ROS 2's CDR: humble's type where the bag's fits into it, else the bag's own definition."""

import hashlib
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from struct import error as struct_error

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.base import TypesysError
from rosbags.typesys.store import Typestore

from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.definition_extent import FieldType
from mcap_landmarks.messages.typestore import definition, full_name, typestore
from mcap_landmarks.sources._definition_files import NO_FILES, DefinitionFiles
from mcap_landmarks.sources._definition_text import is_empty, plain
from mcap_landmarks.sources._ros1_copy import copier
from mcap_landmarks.sources._shape import Payload
from mcap_landmarks.sources._type_graph import FILLER, MessageFields, Types, needed_by, nested_in

Convert = Callable[[Payload], Payload]

_MD5 = re.compile(r"[0-9a-f]{32}")  # publishers that do not know their type write *
_MD5_OF_NOTHING = hashlib.md5(b"", usedforsecurity=False).hexdigest()
_MOST_WORDS = 16
"""Of what is wrong with a definition: rosbags tells where it stands in the text, and repeats that."""
_RENAMED = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}
_HEADER = "std_msgs/msg/Header"
_ONE_BYTE = {"byte", "char", "uint8"}
_NUMPY = {"bool": "bool_", "char": "uint8", "byte": "uint8"}


@dataclass(frozen=True, slots=True)
class ConvertedType:
    """A ROS 1 type in ROS 2: its name, the text of its definition, and how its messages are converted.

    `convert` raises MessageError for bytes that do not fit the bag's definition. `is_sure` is false where that lacked
    something that the standard types of ROS 1 had to fill in, and its checksum does not say that they are right.
    """

    message_type: str
    definition: str
    convert: Convert
    is_sure: bool = True

    def check(self, data: Payload) -> None:
        """Convert for nothing but the MessageError."""
        self.convert(data)


@cache
def converted(ros_type: str, text: str, md5sum: str = "", files: DefinitionFiles = NO_FILES) -> ConvertedType:
    """How a type of a bag is carried in ROS 2, from its ROS 1 name (`nav_msgs/Odometry`), definition and checksum.

    What the definition lacks is taken from `files`, else from the standard types of ROS 1. A humble type takes over if
    it has every field of the bag's; fields that are new in humble get zeros.

    Raises:
        MessageError: the definition cannot be understood.
    """
    source_name = full_name(ros_type)
    try:
        source, is_sure = _source(source_name, text, md5sum, files)
        target_name, target = _target(source.fielddefs, source_name)
    except (MessageError, TypesysError, KeyError, ValueError, AssertionError, RecursionError, SyntaxError) as error:
        why = " ".join(str(error).split()[:_MOST_WORDS]) or type(error).__name__
        raise MessageError(f"the definition of {ros_type} cannot be understood: {why}") from error
    humble = typestore().fielddefs
    own = target_name not in humble or target.fielddefs[target_name][1] != humble[target_name][1]
    schema = target.generate_msgdef(target_name, ros_version=2)[0] if own else definition(target_name)
    if same_bytes(source.fielddefs, source_name, target.fielddefs, target_name):
        return ConvertedType(target_name, schema, _guarded(_copying(target, target_name), ros_type), is_sure)
    migrate = migration(source.fielddefs, source_name, target, target_name)

    def rewrite(data: Payload) -> Payload:
        return target.serialize_cdr(migrate(source.deserialize_ros1(data, source_name)), target_name)

    return ConvertedType(target_name, schema, _guarded(rewrite, ros_type), is_sure)


def _source(name: str, text: str, md5sum: str, files: DefinitionFiles) -> tuple[Typestore, bool]:
    """The types of a definition with all that they need, and whether nothing is doubtful in it.

    Raises:
        MessageError: it lacks what nobody defines, or is empty and was another one than that which is known.
    """
    source = get_typestore(Stores.EMPTY)  # it has times and durations, which every ROS has

    def known(one: str) -> MessageFields | None:
        return files.fields(one) or source.fielddefs.get(one) or standard_ros1().fielddefs.get(one)

    empty = is_empty(text) and md5sum != _MD5_OF_NOTHING and (known(name) is not None or bool(md5sum))
    given = {} if empty else get_types_from_msg(plain(text), name)
    types = needed_by(name, lambda one: given.get(one) or known(one))
    source.register(types)
    is_sure = types.keys() <= given.keys() or source.generate_msgdef(name, ros_version=1)[1] == md5sum
    if empty and not is_sure and _MD5.fullmatch(md5sum):
        raise MessageError("it is empty, and its checksum is another than that of the type of this name")
    return source, is_sure


@cache
def standard_ros1() -> Typestore:
    """ROS 1's own types; to load them takes as long as to convert 10 MB, and bags seldom need them."""
    return get_typestore(Stores.ROS1_NOETIC)


def _copying(target: Typestore, name: str) -> Convert:
    """What copies bytes where that is all it takes; rosbags says what is wrong with those that do not fit."""
    copy = copier(target.fielddefs, name)
    if copy is None:
        return lambda data: target.ros1_to_cdr(data, name)

    def copied(data: Payload) -> Payload:
        found = copy(data)
        return target.ros1_to_cdr(data, name) if found is None else found

    return copied


def _guarded(convert: Convert, ros_type: str) -> Convert:
    def guarded(data: Payload) -> Payload:
        try:
            return convert(data)
        except (SerdeError, struct_error, IndexError, ValueError, AssertionError) as error:
            raise MessageError(f"{len(data)} bytes are not a {ros_type}: {error or type(error).__name__}") from error

    return guarded


def _target(source: Types, source_name: str) -> tuple[str, Typestore]:
    """Name of the type in ROS 2, and a store with it and all that it needs."""
    humble = typestore().fielddefs
    needed: dict[str, MessageFields] = {}

    def take(name: str) -> str:
        new = _RENAMED.get(name, name)
        if new in humble and fits(source, name, humble, new):
            _copy(humble, new, needed)
        elif name not in needed:
            needed[name] = source[name]
            fields = [(field, _renamed(kind, take)) for field, kind in source[name][1]]
            needed[name] = source[name][0], fields or [(FILLER, (Nodetype.BASE, ("uint8", 0)))]
            return name
        return new

    target_name = take(source_name)
    target = get_typestore(Stores.EMPTY)
    target.register(needed)
    return target_name, target


def _copy(types: Types, name: str, into: dict[str, MessageFields]) -> None:
    if name not in into:
        into[name] = types[name]
        for _, kind in types[name][1]:
            if nested := nested_in(kind):
                _copy(types, nested, into)


def _renamed(kind: FieldType, take: Callable[[str], str]) -> FieldType:
    if kind[0] in {Nodetype.ARRAY, Nodetype.SEQUENCE}:
        return kind[0], (_renamed(kind[1][0], take), kind[1][1])
    return (kind[0], take(kind[1])) if kind[0] == Nodetype.NAME else kind


def fits(source: Types, source_name: str, target: Types, target_name: str) -> bool:
    """Whether every field of the source type finds its place in the target type."""
    places = {name.lower(): kind for name, kind in target[target_name][1]}
    return all(
        name.lower() in places and _kind_fits(source, kind, target, places[name.lower()])
        for name, kind in source[source_name][1]
        if (source_name, name) != (_HEADER, "seq")
    )


def _kind_fits(source: Types, kind: FieldType, target: Types, place: FieldType) -> bool:
    if kind[0] != place[0]:
        return False
    if kind[0] in {Nodetype.ARRAY, Nodetype.SEQUENCE}:
        return bool(kind[1][1] == place[1][1]) and _kind_fits(source, kind[1][0], target, place[1][0])
    if kind[0] == Nodetype.NAME:
        same = bool(_RENAMED.get(kind[1], kind[1]) == place[1])
        return same and fits(source, kind[1], target, place[1])
    return bool(kind[1] == place[1]) or {kind[1][0], place[1][0]} <= _ONE_BYTE


def same_bytes(source: Types, source_name: str, target: Types, target_name: str) -> bool:
    """Whether the fields follow each other equally, the header's `seq` apart, which CDR leaves out."""
    have = [(name, kind) for name, kind in source[source_name][1] if (source_name, name) != (_HEADER, "seq")]
    want = [(name, kind) for name, kind in target[target_name][1] if name != FILLER]
    if [name.lower() for name, _ in have] != [name.lower() for name, _ in want]:
        return False
    pairs = [(nested_in(kind), nested_in(place)) for (_, kind), (_, place) in zip(have, want, strict=True)]
    return all(same_bytes(source, a, target, b) for a, b in pairs if a and b)


def migration(source: Types, source_name: str, target: Typestore, target_name: str) -> Callable[[object], object]:
    """What makes an object of the target type from one of the source type."""
    names = {name.lower(): (name, kind) for name, kind in source[source_name][1]}
    steps: list[Callable[[object], object]] = []
    for name, place in target.fielddefs[target_name][1]:
        if name.lower() in names:
            steps.append(_field_migration(source, names[name.lower()], target, place))
        else:
            steps.append(partial(_default, target, place))
    make: Callable[..., object] = target.types[target_name]
    return lambda message: make(*[step(message) for step in steps])


def _field_migration(
    source: Types, field: tuple[str, FieldType], target: Typestore, place: FieldType
) -> Callable[[object], object]:
    name, kind = field
    nested, wanted = nested_in(kind), nested_in(place)
    if nested is None or wanted is None:
        return lambda message: getattr(message, name)
    migrate = migration(source, nested, target, wanted)
    if kind[0] == Nodetype.NAME:
        return lambda message: migrate(getattr(message, name))
    return lambda message: [migrate(item) for item in getattr(message, name)]


def _default(target: Typestore, place: FieldType, _message: object = None) -> object:
    kind, content = place
    if kind == Nodetype.BASE:
        return "" if content[0] == "string" else 0
    if kind == Nodetype.NAME:
        return target.types[content](*[_default(target, inner) for _, inner in target.fielddefs[content][1]])  # type: ignore[arg-type]
    inner, size = content[0], content[1] if kind == Nodetype.ARRAY else 0
    if inner[0] == Nodetype.BASE and inner[1][0] != "string":
        return np.zeros(size, dtype=_NUMPY.get(inner[1][0], inner[1][0]))
    return [_default(target, inner) for _ in range(size)]
