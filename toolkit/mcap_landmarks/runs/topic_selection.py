"""What a conversion takes of the logs: topics, types and times, under which names."""

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from mcap_landmarks.errors import UsageError
from mcap_landmarks.stage import Connection


@dataclass(frozen=True)
class Selection:
    """What of the logs is wanted: topics and types (full-match regular expressions, none for all) and log times.

    Topics that `exclude` matches are not; `remap` gives topics other names.

    Raises:
        UsageError: an expression is none.
    """

    topics: tuple[str, ...] = ()
    start_ns: int | None = None
    end_ns: int | None = None
    exclude: tuple[str, ...] = ()
    types: tuple[str, ...] = ()
    remap: tuple[tuple[str, str], ...] = ()

    def options(self) -> dict[str, object]:
        """For the manifest: what was asked for."""
        given = {
            "topics": list(self.topics),
            "exclude": list(self.exclude),
            "types": list(self.types),
            "remap": dict(self.remap),
            "start_ns": self.start_ns,
            "end_ns": self.end_ns,
        }
        return {key: value for key, value in given.items() if value not in (None, [], {})}

    def wants(self, topic: str, message_type: str) -> bool:
        """Whether the messages of a topic are wanted."""
        types = self._patterns[2]
        return self.may_want(topic) and (not types or _matches(types, message_type))

    def may_want(self, topic: str) -> bool:
        """Whether the messages of a topic are wanted, if their type is."""
        topics, exclude, _ = self._patterns
        return (not topics or _matches(topics, topic)) and not _matches(exclude, topic)

    @property
    def span(self) -> tuple[int | None, int | None]:
        """The log times that were chosen."""
        return self.start_ns, self.end_ns

    @property
    def is_cut(self) -> bool:
        """Whether log times are chosen."""
        return self.span != (None, None)

    def check(self, channels: Iterable[Connection], where: object) -> None:
        """Refuse what matches nothing, and topics that would become one although their messages are of two types.

        Raises:
            UsageError: as it says.
        """
        there = sorted({(one.topic, one.message_type) for one in channels})
        wanted = [(topic, message_type) for topic, message_type in there if self.wants(topic, message_type)]
        if there and not wanted:
            given = " with ".join(f"--{name}" for name in ("topics", "exclude", "types") if getattr(self, name))
            known = ", ".join(f"{topic} ({type_})" if self.types else topic for topic, type_ in there)
            raise UsageError(f"{where}: {given} {'leaves' if self.exclude else 'matches'} none of {known}")
        self._check_names(dict(wanted), where)
        self._check_types(wanted, where)

    def _check_names(self, wanted: Collection[str], where: object) -> None:
        for name, _ in self.remap:
            if name not in wanted:
                known = ", ".join(wanted)
                raise UsageError(f"{where}: --remap {name}: there is no such topic; there are {known}")

    def _check_types(self, wanted: Iterable[tuple[str, str]], where: object) -> None:
        names, first = dict(self.remap), dict[str, tuple[str, str]]()
        for topic, message_type in wanted:
            other, other_type = first.setdefault(names.get(topic, topic), (topic, message_type))
            if other_type != message_type and {topic, other} & names.keys():
                raise UsageError(
                    f"{where}: --remap makes {topic} ({message_type}) and {other} ({other_type}) one topic; "
                    "messages of one topic are of one type: give it another name"
                )

    def renamed(self, connection: Connection) -> Connection:
        """The connection that messages of another one go to."""
        name = dict(self.remap).get(connection.topic)
        return connection if name is None else replace(connection, topic=name)

    @cached_property
    def _patterns(self) -> Sequence[Sequence[re.Pattern[str]]]:
        return [_compiled(name, getattr(self, name)) for name in ("topics", "exclude", "types")]


def _compiled(name: str, texts: Iterable[str]) -> list[re.Pattern[str]]:
    try:
        return [re.compile(text) for text in texts]
    except re.error as error:
        raise UsageError(f"--{name} {error.pattern!r} is not a regular expression: {error}") from error


def _matches(patterns: Iterable[re.Pattern[str]], text: str) -> bool:
    return any(pattern.fullmatch(text) for pattern in patterns)
