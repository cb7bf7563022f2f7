"""Definitions that the user gives: .msg, .srv, .action and .idl, as they lie in the folders of ROS packages."""

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_idl, get_types_from_msg
from rosbags.typesys.base import TypesysError

from mcap_landmarks.errors import MessageError, UsageError
from mcap_landmarks.messages.definition_extent import FieldType
from mcap_landmarks.sources._definition_text import decoded, parts_of, plain
from mcap_landmarks.sources._type_graph import Fields, MessageFields

_SUFFIXES = (".msg", ".srv", ".action", ".idl")  # where a package has both, the .idl was made from the other
_FOLDERS = {"msg", "srv", "action"}
_DIRECTIVE = re.compile(r"(?m)^[ \t]*#.*$")  # what is included is found by its name
_MADE = ("_Request", "_Response", "_Event", "_Goal", "_Result", "_Feedback", "_FeedbackMessage")
_LONGEST = 1 << 20
"""Bytes of the longest file that is read as a definition; those of ROS have at most some 20 KiB."""
_Types = dict[str, MessageFields]


def message_name(type_: str) -> str:
    """The name of a type as if it were a message's: parsers know no `pkg/srv/Name_Event`."""
    package, _, rest = type_.partition("/")
    return f"{package}/msg/{rest.rpartition('/')[2]}"


class DefinitionFiles:
    """The definitions in some files and folders, found by their names and read when they are asked for."""

    def __init__(self, paths: Sequence[str]) -> None:
        """Raises UsageError: there is no such file, or nothing in such a folder."""
        self._files: dict[str, list[Path]] = {}
        for path in map(Path, paths):
            found = list(definition_files(path))
            if not found:
                raise UsageError(f"--definitions {path}: there is no .msg, .srv, .action or .idl; check the path")
            for file in found:
                self._files.setdefault(_type_of(file), []).append(file)

    def __bool__(self) -> bool:
        return bool(self._files)

    def fields(self, name: str) -> MessageFields | None:
        """The fields of a type by its `message_name`, None if no file defines it.

        Raises:
            MessageError: the file cannot be understood.
            UsageError: files that differ define it.
        """
        files = [file for file in self._files.get(name, ()) if _is_message(file)]
        files = files or [file for file in self._files.get(_service(name), ()) if not _is_message(file)]
        best = min((_SUFFIXES.index(file.suffix) for file in files), default=0)
        found = {_content(file): file for file in files if _SUFFIXES.index(file.suffix) == best}
        if len(found) > 1:
            first, second, *_ = found.values()
            raise UsageError(f"--definitions: {first} and {second} define {name} differently; name one of them")
        return next((_types_in(file, content).get(name) for content, file in found.items()), None)


NO_FILES = DefinitionFiles(())


def _service(name: str) -> str:
    """The name of the service or action that makes a type."""
    for suffix in _MADE:
        if name.endswith(suffix):
            return name.removesuffix(suffix).removesuffix("_SendGoal").removesuffix("_GetResult")
    return name


def _is_message(file: Path) -> bool:
    return file.suffix == ".msg" or (file.suffix == ".idl" and file.parent.name not in {"srv", "action"})


def definition_files(path: Path) -> Iterator[Path]:
    """The files with definitions in a folder, or the one at a path."""
    if path.is_dir():
        yield from sorted(file for file in path.rglob("*") if file.suffix in _SUFFIXES and file.is_file())
    elif path.suffix in _SUFFIXES and path.is_file():
        yield path


def _type_of(file: Path) -> str:
    """share/PKG/msg/X.msg, PKG/msg/X.msg and PKG/X.msg are PKG's."""
    folder = file.resolve().parent
    package = folder.parent if folder.name in _FOLDERS else folder
    return f"{package.name}/msg/{file.stem}"


def _content(file: Path) -> bytes:
    if file.stat().st_size > _LONGEST:
        raise MessageError(f"{file} is too long to be a definition")
    return file.read_bytes()


@cache
def _types_in(file: Path, content: bytes) -> _Types:
    name, text = _type_of(file), decoded(content)
    try:
        if file.suffix == ".idl":
            return idl_types(text)
        if file.suffix == ".msg":
            return dict(get_types_from_msg(plain(text), name))
        return service_types(name, text) if file.suffix == ".srv" else _action_types(name, text)
    except (TypesysError, ValueError, KeyError, AssertionError, RecursionError) as error:
        raise MessageError(f"{file} cannot be understood: {str(error).splitlines()[0]}") from error


def idl_types(text: str) -> _Types:
    """What an IDL text defines.

    Raises:
        TypesysError: it cannot be understood.
    """
    types = get_types_from_idl(_DIRECTIVE.sub("", text))
    return {message_name(one): (made[0], _plainly(made[1])) for one, made in types.items()}


def service_types(name: str, text: str) -> _Types:
    """What a .srv defines: the request, the response, and the event that services tell of both in.

    Raises:
        MessageError, TypesysError: it has not two parts, or they cannot be understood.
    """
    parts = parts_of(text)
    if len(parts) != 2:
        raise MessageError(f"the definition of the service {name} has {len(parts)} parts in place of two")
    request, response = f"{name}_Request", f"{name}_Response"
    # What the types of both need may stand at the end of the text.
    types = {**get_types_from_msg(plain(parts[0]), request), **get_types_from_msg(plain(parts[1]), response)}
    return {**types, f"{name}_Event": ([], _event_fields(request, response))}


def service_event(name: str, text: str) -> Mapping[str, MessageFields]:
    """The types of a service event, by the definition of its service.

    Raises:
        MessageError: it cannot be understood.
    """
    try:
        return service_types(name.removesuffix("_Event"), text)
    except (TypesysError, ValueError, KeyError, AssertionError, RecursionError) as error:
        raise MessageError(f"the service of {name} cannot be understood: {str(error).splitlines()[0]}") from error


def _event_fields(request: str, response: str) -> Fields:
    """As rosidl makes them: who calls, and at most one request and one response."""
    return [
        ("info", _named("service_msgs/msg/ServiceEventInfo")),
        ("request", (Nodetype.SEQUENCE, (_named(request), 1))),
        ("response", (Nodetype.SEQUENCE, (_named(response), 1))),
    ]


def _action_types(name: str, text: str) -> _Types:
    """What a .action defines, as far as topics have it: goals, results, feedback, and the events of its services."""
    parts = parts_of(text)
    if len(parts) != 3:
        raise MessageError(f"the action {name} has {len(parts)} parts in place of three")
    types: _Types = {}
    for part, kind in zip(parts, ("Goal", "Result", "Feedback"), strict=True):
        types.update(get_types_from_msg(plain(part), f"{name}_{kind}"))
    goal_id = ("goal_id", _named("unique_identifier_msgs/msg/UUID"))
    made: dict[str, Fields] = {
        "FeedbackMessage": [goal_id, ("feedback", _named(f"{name}_Feedback"))],
        "SendGoal_Request": [goal_id, ("goal", _named(f"{name}_Goal"))],
        "SendGoal_Response": [
            ("accepted", (Nodetype.BASE, ("bool", 0))),
            ("stamp", _named("builtin_interfaces/msg/Time")),
        ],
        "GetResult_Request": [goal_id],
        "GetResult_Response": [("status", (Nodetype.BASE, ("int8", 0))), ("result", _named(f"{name}_Result"))],
        "SendGoal_Event": _event_fields(f"{name}_SendGoal_Request", f"{name}_SendGoal_Response"),
        "GetResult_Event": _event_fields(f"{name}_GetResult_Request", f"{name}_GetResult_Response"),
    }
    return {**types, **{f"{name}_{kind}": ([], fields) for kind, fields in made.items()}}


def _plainly(fields: Fields) -> Fields:
    """Fields of an .idl, with the names of types that parsers of messages know."""
    return [(name, _renamed(kind)) for name, kind in fields]


def _renamed(kind: FieldType) -> FieldType:
    if kind[0] in {Nodetype.ARRAY, Nodetype.SEQUENCE}:
        return kind[0], (_renamed(kind[1][0]), kind[1][1])
    return _named(kind[1]) if kind[0] == Nodetype.NAME else kind


def _named(name: str) -> FieldType:
    return Nodetype.NAME, message_name(name)
