"""How far fields may differ: what the stages declare of their channels, and what the user says over it."""

import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches

from mcap_landmarks.diff.maps import FIELDS as MAP_FIELDS
from mcap_landmarks.errors import UsageError
from mcap_landmarks.stage import Reduction, Tolerance
from mcap_landmarks.stages import usable_stages

_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_VALUE = re.compile(rf"(?P<absolute>{_NUMBER})?(?:(?(absolute)\+)(?P<percent>{_NUMBER})%)?")
FieldNames = Mapping[str, Sequence[str]]
Declared = Mapping[str, Mapping[str, Tolerance]]


def declared() -> Declared:
    """Tolerances by topic and field, as the stages that write the topics or the database declare them.

    Of two stages that write a topic the wider one counts.
    """
    found: dict[str, dict[str, Tolerance]] = {}
    for stage in usable_stages():
        fields = {
            name: value if isinstance(value, Tolerance) else Tolerance(float(value))
            for name, value in stage.tolerance.items()
        }
        parts = MAP_FIELDS if isinstance(stage, Reduction) else ()  # it makes the database
        for name in (*parts, *(channel.topic for channel in stage.writes)):
            known = found.setdefault(name, {})
            for field, limit in fields.items():
                other = known.get(field, limit)
                known[field] = Tolerance(*map(max, limit, other))
    return found


def asked(texts: Sequence[str], fields: FieldNames) -> Declared:
    """Tolerances by topic and field of texts `channel.field=VALUE`; VALUE is `0.01`, `1%` or `0.01+1%`.

    `fields` gives the names of the fields that are compared in each channel.

    Raises:
        UsageError: a text cannot be read, or names a channel or field that is not compared.
    """
    found: dict[str, dict[str, Tolerance]] = {}
    for text in texts:
        where, _, value = text.rpartition("=")
        parts = _VALUE.fullmatch(value.strip()) if value.strip() else None
        if not where or parts is None:
            raise UsageError(f"--tolerance {text}: write CHANNEL.FIELD=VALUE, VALUE as 0.01, 1% or 0.01+1%")
        topic, name = _split(text, where.strip(), fields)
        relative = float(parts["percent"] or 0) / 100
        found.setdefault(topic, {})[name] = Tolerance(float(parts["absolute"] or 0), relative)
    return found


def _split(text: str, where: str, fields: FieldNames) -> tuple[str, str]:
    fitting = [topic for topic in fields if where.startswith(f"{topic}.")]
    if not fitting:
        like = nearest(where.split(".", maxsplit=1)[0], fields)
        raise UsageError(f"--tolerance {text}: neither has such a channel{like}")
    topic = max(fitting, key=len)
    name, known = where[len(topic) + 1 :], fields[topic]
    if name not in known:
        raise UsageError(f"--tolerance {text}: {topic} has no field {name}{nearest(name, known)}")
    return topic, name


def nearest(name: str, known: Sequence[str] | Mapping[str, object]) -> str:
    """Words that propose the known name most like a wrong one, or list them all where none is."""
    close = get_close_matches(name, list(known), n=1, cutoff=0.5)
    if close:
        return f"; did you mean {close[0]}?"
    return f"; there are: {', '.join(sorted(known)[:20])}" if known else ""
