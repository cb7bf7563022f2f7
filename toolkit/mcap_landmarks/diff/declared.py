"""What two recordings say about themselves: how they were made, and what they hold."""

import hashlib
import json
import re
from collections import Counter
from collections.abc import Mapping

from mcap_landmarks.diff.document import ManifestRow, StructureRow
from mcap_landmarks.diff.logs import Connections, shared_layout
from mcap_landmarks.manifest import RUN
from mcap_landmarks.recording.reader import Recording

_FOLLOWS = re.compile(
    r"content|(carried|shared)(\..*)?|options\.logs|stages\.[^.]*\.(key|outcome|inputs|resources|code)(\..*)?"
)


def manifest_rows(baseline: Mapping[str, str], candidate: Mapping[str, str]) -> list[ManifestRow]:
    """What was meant to differ: each entry of the manifests that does, but for those that follow from others."""
    rows = rows_of(_entries(baseline), _entries(candidate))
    return [row for row in rows if not _FOLLOWS.fullmatch(row["key"])]


def _code(stages: object) -> str | None:
    """The version or versions of the program that the stages of a manifest ran with."""
    if not isinstance(stages, dict):
        return None
    return (
        " and ".join(sorted({str(entry.get("code")) for entry in stages.values() if isinstance(entry, dict)})) or None
    )


def rows_of(baseline: Mapping[str, object], candidate: Mapping[str, object]) -> list[ManifestRow]:
    """One row per key whose values differ; a key that a side lacks has None there."""
    keys = sorted({*baseline, *candidate})
    return [
        {"key": key, "baseline": baseline.get(key), "candidate": candidate.get(key)}
        for key in keys
        if baseline.get(key) != candidate.get(key)
    ]


def structure_rows(baseline: Recording, candidate: Recording) -> list[StructureRow]:
    """Channels that only one has, whose type, definition or number of messages differs; metadata and attachments."""
    mine, theirs = by_topic(baseline), by_topic(candidate)
    counts = message_counts(baseline), message_counts(candidate)
    rows = []
    for topic in sorted({*mine, *theirs}):
        rows += _description_rows(topic, mine.get(topic, ()), theirs.get(topic, ()))
        number = counts[0].get(topic), counts[1].get(topic)
        if topic in mine and topic in theirs and number[0] != number[1]:
            rows.append(_row("messages", topic, *number))
    beside = {
        "metadata": rows_of(_other_metadata(baseline), _other_metadata(candidate)),
        "attachment": rows_of(_attachments(baseline), _attachments(candidate)),
    }
    rows += [_row(what, row["key"], row["baseline"], row["candidate"]) for what in beside for row in beside[what]]
    return rows


def _description_rows(topic: str, baseline: Connections, candidate: Connections) -> list[StructureRow]:
    """How a topic's connections differ, before any of its messages is read."""
    types = [sorted({connection.message_type for connection in side}) for side in (baseline, candidate)]
    names = [" and ".join(side) or None for side in types]
    if not all(types):
        return [_row("channel", topic, *names)]
    if types[0] != types[1]:
        return [_row("type", topic, *names)]
    if _undecided((*baseline, *candidate)):
        return [_row("definition", topic, _digest(baseline), _digest(candidate))]
    return []


def by_topic(recording: Recording) -> dict[str, Connections]:
    """The connections of each topic."""
    return {topic: recording.connections(topic) for topic in {entry.connection.topic for entry in recording.channels}}


def _row(what: str, name: str, baseline: object, candidate: object) -> StructureRow:
    return {"what": what, "name": name, "baseline": baseline, "candidate": candidate}


def _entries(record: Mapping[str, str]) -> dict[str, object]:
    found: dict[str, object] = {}
    for key, text in record.items():
        try:
            value = json.loads(text)
            _flatten(key, value, found)
        except (ValueError, RecursionError):
            found[key] = value = text  # somebody else's manifest
        if key == "stages" and (code := _code(value)):
            found["code"] = code
    return found


def _flatten(key: str, value: object, into: dict[str, object]) -> None:
    if isinstance(value, dict):
        for name, inner in value.items():
            _flatten(f"{key}.{name}", inner, into)
    else:
        into[key] = value


def _undecided(connections: Connections) -> bool:
    """Whether connections of one type describe it in different words, and not even with the same meaning."""
    texts = {(connection.schema, connection.schema_encoding, connection.message_encoding) for connection in connections}
    return len(texts) > 1 and shared_layout(connections) is None


def _digest(connections: Connections) -> str:
    texts = sorted(connection.schema for connection in connections)
    return hashlib.sha256(b"".join(texts)).hexdigest()[:16]


def message_counts(recording: Recording) -> dict[str, int]:
    """The number of messages of each topic."""
    counts: dict[str, int] = {}
    for entry in recording.channels:
        counts[entry.connection.topic] = counts.get(entry.connection.topic, 0) + entry.count
    return counts


def _other_metadata(recording: Recording) -> dict[str, object]:
    found: dict[str, object] = {}
    names: Counter[str] = Counter()
    for name, entries in recording.metadata_records:
        names[name] += 1
        number = f" ({names[name]})" if names[name] > 1 else ""
        if name != RUN:
            found |= {f"{name}{number}.{key}": value for key, value in entries.items()}
    return found


def _attachments(recording: Recording) -> dict[str, object]:
    found: dict[str, object] = {}
    for attachment in recording.attachments():
        digest = hashlib.sha256(attachment.data).hexdigest()[:16]
        found[attachment.name] = f"{len(attachment.data)} bytes, {digest}"
    return found
