"""The account of what is lost of an input, as recover prints it and outputs carry it in a metadata record."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence

from mcap_landmarks.manifest import entry_text
from mcap_landmarks.recording.damage import Damage, Stretch, SuspectChunk
from mcap_landmarks.sources import Accounted, LossAccount

REPORT = "mcap-landmarks.recover"
"""Its name; its entries are JSON texts."""
_WORDS = {
    "damaged_chunks": "in damaged chunks",
    "passed_over": "in bytes that were passed over",
    "cut": "behind a cut",
    "missing": "declared, and nowhere found",
    "not_understood": "of topics that nobody can understand",
    "not_fitting": "that do not fit their definition",
    "not_decompressed": "that cannot be decompressed",
    "without_topic": "of topics that are nowhere described",
    "unreadable_rows": "in rows that cannot be read",
    "unsound_rows": "in rows without a sound time and payload",
}
"""The causes of losses, and what they say of messages."""


def loss_report(report: Mapping[str, object]) -> dict[str, str]:
    """The entries of the record."""
    return {name: entry_text(value) for name, value in report.items()}


def account_of(parts: Iterable[object], *, lacks_files: bool = False) -> LossAccount:
    """What the parts of a log that count their losses lost together: of several files without the places in them.

    `lacks_files`: files of the log are not among the parts.
    """
    accounts = [part.account for part in parts if isinstance(part, Accounted)]
    if len(accounts) == 1 and not lacks_files:
        return accounts[0]
    found = LossAccount(is_open=lacks_files or any(one.is_open for one in accounts))
    if lacks_files:
        found.add("missing", None)
    for one in accounts:
        for cause, messages in one.messages.items():
            found.add(cause, messages)
        for messages, _ in one.chunks.values():
            found.add("damaged_chunks", messages)
        if one.passed_over:
            found.add("passed_over", None)
        found.undeclared += one.undeclared
    return found


def damage_of(account: LossAccount, expected: int | None, recovered: int, losses: Sequence[str]) -> Damage:
    """The account of a bag in the terms of a recording's."""
    return Damage(
        expected=expected,
        recovered=recovered,
        suspect_chunks=tuple(SuspectChunk(place, *found) for place, found in sorted(account.chunks.items())),
        resyncs=tuple(Stretch(*stretch) for stretch in account.passed_over),
        records=tuple(losses),
    )


def lost_by_cause(damage: Damage, counted: Mapping[str, int | None]) -> dict[str, int | None]:
    """How many messages are lost for each cause, None where nothing tells; `counted` are those of other causes.

    What else is missing of those that are expected goes to the one cause that says no number, if it is one.
    """
    found = {**counted, **_seen(damage)}
    rest = (damage.expected or 0) - damage.recovered - sum(filter(None, found.values()))
    if rest > 0:
        unknown = [cause for cause, messages in found.items() if messages is None]
        found[unknown[0] if len(unknown) == 1 else "missing"] = rest
    return {cause: found[cause] for cause in _WORDS if cause in found}


def _seen(damage: Damage) -> dict[str, int | None]:
    """The causes that show in the bytes of a file, with the messages that damaged chunks declare."""
    found: dict[str, int | None] = {}
    if damage.suspect_chunks:
        held = [chunk.messages for chunk in damage.suspect_chunks if chunk.messages is not None]
        found["damaged_chunks"] = sum(held) if held else None
    if damage.resyncs and not damage.is_whole:
        found["passed_over"] = None
    if damage.cut:
        found["cut"] = None
    return found


def told_causes(lost: Mapping[str, int | None]) -> str:
    """The causes in words, empty for none."""
    return "; ".join(f"{'some' if count is None else count} {_WORDS[cause]}" for cause, count in lost.items())


def report_of(
    damage: Damage, lost: Mapping[str, int | None], losses: Sequence[str], notes: Sequence[str]
) -> dict[str, object]:
    """The account as JSON values, as it stands in the output's metadata and in the document."""
    return {
        "expected": damage.expected,
        "recovered": damage.recovered,
        "lost": dict(lost),
        "suspect_chunks": [dataclasses.asdict(chunk) for chunk in damage.suspect_chunks],
        "resyncs": [{"from": stretch.start, "to": stretch.end, "reason": stretch.reason} for stretch in damage.resyncs],
        "unverified_chunks": damage.unverified,
        "duplicate_chunks": list(damage.duplicates),
        "losses": list(losses),
        "notes": list(notes),
    }
