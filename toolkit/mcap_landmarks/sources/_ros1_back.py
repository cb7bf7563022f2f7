"""ROS 2 messages to ROS 1: its own type of that name where the message fits into it, else a definition made for it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from struct import error as struct_error

from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.base import TypesysError
from rosbags.typesys.store import Typestore

from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.definition_extent import FieldType
from mcap_landmarks.messages.typestore import typestore
from mcap_landmarks.sources._definition_files import idl_types, service_event
from mcap_landmarks.sources._definition_text import decoded, parts_of, plain
from mcap_landmarks.sources._ros1_types import fits, migration, same_bytes, standard_ros1
from mcap_landmarks.sources._ros2_types import fields_of_all
from mcap_landmarks.sources._shape import Payload
from mcap_landmarks.sources._type_graph import MessageFields, Types, filled, needed_by, nested_in

_HEADER = "std_msgs/msg/Header"
_TIMES = frozenset({"builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"})
_BIG_ENDIAN = b"\x00\x00"
_RENAMED = {"octet": "byte"}
_UNKNOWN = {"wstring": "wide text (wstring)", "wchar": "wide characters", "float128": "long double"}
"""What ROS 1 has no field for, in words."""


@dataclass(frozen=True, slots=True)
class Ros1Type:
    """A ROS 2 type in ROS 1: its name, the text and checksum of its definition, and how its messages are converted.

    `convert` gives the message and whether it lost something: values of fields that ROS 1's type of that name lacks. It
    raises MessageError for bytes that do not fit the definition.
    """

    message_type: str
    definition: str
    md5sum: str
    convert: Callable[[Payload], tuple[Payload, bool]]


@lru_cache(maxsize=1024)
def ros1_type(message_type: str, schema: bytes, encoding: str) -> Ros1Type:
    """What stands for a ROS 2 type in ROS 1, of its name, its definition and the encoding of that.

    Raises:
        MessageError: the definition cannot be understood, or has a field of which ROS 1 knows nothing.
    """
    name = _plain_name(message_type)
    try:
        have = filled(_fields(name, schema, encoding))
        want = get_typestore(Stores.EMPTY)
        want.register(_wanted(name, have))
        source = get_typestore(Stores.EMPTY)
        source.register(have)
        text, md5sum = want.generate_msgdef(name, ros_version=1)
        is_same = same_bytes(want.fielddefs, name, source.fielddefs, name)
        convert = _copying(source, name) if is_same else _migrating(source, want, name)
    except (TypesysError, KeyError, AssertionError, ValueError, SyntaxError, RecursionError) as error:
        why = (str(error).splitlines() or [type(error).__name__])[0]
        raise MessageError(f"its definition cannot be understood: {why}") from error
    return Ros1Type(name, text, md5sum, _guarded(convert, message_type))


def _plain_name(name: str) -> str:
    """A name as messages have it: ROS 1 has no types within services and actions."""
    package, *_, last = name.split("/")
    return f"{package}/msg/{last}"


def _fields(name: str, schema: bytes, encoding: str) -> dict[str, MessageFields]:
    """The types of a definition, without the bounds of texts and sequences, which ROS 1 does not know.

    Raises:
        MessageError: ROS 1 has no such field, or something is missing.
    """
    text = decoded(schema)
    if name.endswith("_Event") and len(parts_of(text)) == 2:  # as rosbag2 defines it: by the text of its service
        given = dict(service_event(name, text))
    else:
        given = idl_types(text) if encoding == "ros2idl" else dict(get_types_from_msg(plain(text), name))
    types = {_plain_name(one): fields for one, fields in given.items()}
    known = typestore().fielddefs

    def find(one: str) -> MessageFields | None:
        constants, fields = types.get(one) or known.get(one) or fields_of_all(one) or (None, None)
        if constants is None or fields is None:
            return None
        return constants, [(field, _unbounded(one, kind)) for field, kind in fields]

    return needed_by(name, find)


def _unbounded(name: str, kind: FieldType) -> FieldType:
    if kind[0] == Nodetype.ARRAY:
        return kind[0], (_unbounded(name, kind[1][0]), kind[1][1])
    if kind[0] == Nodetype.SEQUENCE:
        return kind[0], (_unbounded(name, kind[1][0]), 0)
    word = kind[1].rpartition("/")[2] if kind[0] == Nodetype.NAME else kind[1][0]  # the parser takes these for types
    if word in _UNKNOWN:
        raise MessageError(f"ROS 1 has no {_UNKNOWN[word]}, as {name} has")
    if kind[0] == Nodetype.NAME:
        return kind[0], _plain_name(kind[1])
    return kind[0], (_RENAMED.get(word, word), 0)


def _wanted(name: str, have: Types) -> dict[str, MessageFields]:
    """A type with all that it needs, as ROS 1 has it: ROS 1's own where all of its fields are there."""
    standard, wanted = standard_ros1().fielddefs, dict[str, MessageFields]()

    def take(one: str, types: Types) -> None:
        if one not in wanted:
            wanted[one] = types[one]
            for _, kind in types[one][1]:
                if nested := nested_in(kind):
                    take(nested, standard if types is standard or _is_standard(nested, have) else have)

    take(name, standard if _is_standard(name, have) else have)
    return wanted


def _is_standard(name: str, have: Types) -> bool:
    standard = standard_ros1().fielddefs
    return name in standard and (name in _TIMES or fits(standard, name, have, name))


def _copying(source: Typestore, name: str) -> Callable[[Payload], tuple[Payload, bool]]:
    source.get_msgdef(name)  # here, so that what is wrong with it is known before there is a message

    def copied(data: Payload) -> tuple[Payload, bool]:
        if bytes(data[:2]) == _BIG_ENDIAN:
            data = source.serialize_cdr(source.deserialize_cdr(data, name), name, little_endian=True)
        return source.cdr_to_ros1(data, name), False

    return copied


def _migrating(source: Typestore, want: Typestore, name: str) -> Callable[[Payload], tuple[Payload, bool]]:
    """What leaves out the fields that ROS 1 lacks, and tells whether there is something in them."""
    source.get_msgdef(name), want.get_msgdef(name)
    there = migration(source.fielddefs, name, want, name)
    back = migration(want.fielddefs, name, source, name)

    def migrated(data: Payload) -> tuple[Payload, bool]:
        message = source.deserialize_cdr(data, name)
        new = there(message)
        is_whole = source.serialize_cdr(back(new), name) == source.serialize_cdr(message, name)
        return want.serialize_ros1(new, name), not is_whole

    return migrated


def _guarded(
    convert: Callable[[Payload], tuple[Payload, bool]], message_type: str
) -> Callable[[Payload], tuple[Payload, bool]]:
    def guarded(data: Payload) -> tuple[Payload, bool]:
        try:
            return convert(data)
        except (SerdeError, struct_error, IndexError, ValueError, AssertionError) as error:
            why = error or type(error).__name__
            raise MessageError(f"{len(data)} bytes are not a {message_type}: {why}") from error

    return guarded
