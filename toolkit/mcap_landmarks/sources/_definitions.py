"""Definitions of types that a recording does not define itself: from where they come, and in which order."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from struct import error as struct_error

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.base import TypesysError

from mcap_landmarks.errors import MessageError
from mcap_landmarks.sources._definition_files import DefinitionFiles, message_name, service_event
from mcap_landmarks.sources._ros2_types import fields_in, fields_of_all, having, own_fields
from mcap_landmarks.sources._shape import Definition, Payload
from mcap_landmarks.sources._type_graph import MessageFields, filled, needed_by

_Find = Callable[[str], MessageFields | None]

_GIVEN = "the given"


class Definitions:
    """Where definitions come from: what the user gave, then the distribution the user named, then those that the bag
    names, then what is the same in every distribution, then what this toolkit writes itself.
    """

    def __init__(self, files: DefinitionFiles, distributions: Sequence[str]) -> None:
        self.files, self._distributions = files, tuple(dict.fromkeys(distributions))

    def also(self, distribution: str | None) -> "Definitions":
        """The same, and after them those of a distribution that a bag names."""
        return Definitions(self.files, [*self._distributions, distribution]) if distribution else self

    def of(self, message_type: str) -> tuple[Definition, ...]:
        """The definitions that a type may have, each different; the first that fits all messages counts.

        Raises:
            MessageError: there is none; the message says why, and what would help.
        """
        found: dict[str, Definition] = {}
        problems = []
        for origin, find in self._sources():
            try:
                if find(message_name(message_type)) is not None:
                    one = _definition(message_type, find, origin, self._find)
                    found.setdefault(one.text, one)
            except MessageError as error:
                problems.append(str(error))
        if not found:
            raise MessageError("; ".join(problems) or self._why_not(message_type))
        return tuple(found.values())

    def service_event(self, message_type: str, service: str) -> Definition:
        """The definition of a service's event type, from that of the service.

        Raises:
            MessageError: it cannot be understood, or needs what nothing defines.
        """
        types = service_event(message_name(message_type), service)
        return _definition(message_type, types.get, "the file's", self._find)

    def _sources(self) -> Iterator[tuple[str, _Find]]:
        yield _GIVEN, self.files.fields
        for distribution in self._distributions:
            yield f"{distribution}'s", partial(fields_in, distribution)
        yield "every distribution's", fields_of_all
        yield "this toolkit's", own_fields

    def _find(self, name: str) -> MessageFields | None:
        found = (find(name) for _, find in self._sources())
        return next((fields for fields in found if fields is not None), None)

    def _why_not(self, message_type: str) -> str:
        there, named = having(message_name(message_type)), self._distributions
        text = f"neither the file nor {' or '.join(named)} defines" if named else "the file does not define"
        text, remedy = f"{text} {message_type}", "give its definition with --definitions"
        if there and not named:
            return (
                f"{text}, and distributions differ in it; name the one it was recorded with, such as "
                f"--distro {there[-1]}, or {remedy}"
            )
        if there:
            return f"{text}, which {', '.join(there)} do; name one of them with --distro, or {remedy}"
        return f"{text}, nor does what --definitions names; add it there" if self.files else f"{text}; {remedy}"


def _definition(message_type: str, find: _Find, origin: str, others: _Find) -> Definition:
    """A type of one source, with what it needs from there and else from the others."""
    name = message_name(message_type)
    types = filled(needed_by(name, lambda one: find(one) or others(one)))
    try:
        store = get_typestore(Stores.EMPTY)
        store.register(types)
        text = store.generate_msgdef(name, ros_version=2)[0]
        store.get_msgdef(name)
    except (TypesysError, KeyError, AssertionError, ValueError, SyntaxError, RecursionError) as error:
        raise MessageError(f"{origin} {message_type} cannot be understood: {error}") from error

    def check(data: Payload) -> None:
        try:
            store.deserialize_cdr(data, name)
        except (SerdeError, struct_error, IndexError, ValueError, AssertionError) as error:
            raise MessageError(
                f"{len(data)} bytes are not {origin} {message_type}: {str(error).rstrip('.')}"
            ) from error

    return Definition(text, check, is_given=origin == _GIVEN)
