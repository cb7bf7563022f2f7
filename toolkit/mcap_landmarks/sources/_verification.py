"""Which of the definitions that a type may have its messages really have: each one is decoded to its full length."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from mcap_landmarks.errors import MessageError
from mcap_landmarks.sources._shape import Definition, Payload
from mcap_landmarks.stage import Connection

_K = TypeVar("_K")


def defined(connection: Connection, definition: Definition) -> Connection:
    """A connection with a definition in place of its own."""
    return replace(connection, schema=definition.text.encode(), schema_encoding="ros2msg")


def _remedy(candidates: Sequence[Definition]) -> str:
    """What to do where no definition fits: not again what was just tried."""
    if any(one.is_given for one in candidates):
        return "--definitions names another version of it than the one it was recorded with"
    return "give its definition with --definitions"


def settled(
    candidates: Mapping[_K, Sequence[Definition]], read: Callable[[Collection[_K]], Iterable[tuple[_K, Payload]]]
) -> dict[_K, Definition | str]:
    """For each key the first of its definitions that every message fits, or why none does.

    `read` gives the messages of some keys: all of them are decoded, as often as definitions have to be tried.
    """
    decided: dict[_K, Definition | str] = {}
    trying = dict.fromkeys(candidates, 0)
    problems: dict[_K, list[str]] = {key: [] for key in candidates}
    while trying:
        checks = {key: candidates[key][i].check for key, i in trying.items()}
        misfits: dict[_K, str] = {}
        for key, data in read(list(checks)):
            if key not in misfits:
                try:
                    checks[key](data)
                except MessageError as error:
                    misfits[key] = str(error)
        for key, i in list(trying.items()):
            if key not in misfits:
                decided[key] = candidates[key][i]
                del trying[key]
                continue
            problems[key].append(misfits[key])
            trying[key] = i + 1
            if i + 1 == len(candidates[key]):
                decided[key] = f"{'; '.join(problems[key])}; {_remedy(candidates[key])}"
                del trying[key]
    return decided
