"""What differs between rows that belong together: counts, fields and the worst cases, gathered batch by batch."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from mcap_landmarks.diff.document import CaseEntry, Counts, FieldEntry
from mcap_landmarks.diff.fields import Batch
from mcap_landmarks.diff.values import Array, Flags, Rows, difference, largest_at, shown
from mcap_landmarks.messages.columns import Column, Kind
from mcap_landmarks.stage import Tolerance

WORST = 5
"""Cases that are kept of each field, of what was added and of what was removed."""
_FEW_VALUES = ("status", "class", "frame_id")
_TELLING = ("status", "score", "box_xyxy_px", "position_m")


class Case(NamedTuple):
    """One difference: its size, when (None outside time), of what, in which field, and the values of both sides."""

    difference: float
    time_ns: int | None
    item: str
    field: str
    baseline: object
    candidate: object

    def document(self) -> CaseEntry:
        """An entry of `worst`; a difference that no number tells is null."""
        return {
            "time_ns": self.time_ns,
            "item": self.item or None,
            "field": self.field,
            "baseline": self.baseline,
            "candidate": self.candidate,
            "difference": self.difference if np.isfinite(self.difference) else None,
        }


@dataclass(slots=True)
class FieldTally:
    """One field: in how many rows it is beyond its tolerance, the largest difference, and the worst cases.

    `transitions` count how often which text became which other.
    """

    tolerance: Tolerance
    changed: int = 0
    largest: float = 0.0
    cases: list[Case] = field(default_factory=list)
    transitions: Counter[tuple[str, str]] = field(default_factory=Counter)

    def document(self) -> FieldEntry:
        """An entry of `fields`; a difference that no number tells is null."""
        return {
            "changed": self.changed,
            "largest": self.largest if np.isfinite(self.largest) else None,
            "tolerance": self.tolerance._asdict(),
            "transitions": [
                {"baseline": before, "candidate": after, "count": count}
                for (before, after), count in self.transitions.most_common(WORST)
            ],
        }


@dataclass(slots=True)
class Tally:
    """How many rows are the same, changed, only in the candidate, only in the baseline, and in what they differ.

    `word` is what one row is. `tolerance` gives that of a field; `prefix` comes before the names of all fields.
    """

    word: str
    tolerance: Callable[[str], Tolerance]
    prefix: str = ""
    same: int = 0
    changed: int = 0
    fields: dict[str, FieldTally] = field(default_factory=dict)
    classes: dict[str, Counter[str]] = field(default_factory=lambda: {"added": Counter(), "removed": Counter()})
    alone: dict[str, list[Case]] = field(default_factory=lambda: {"added": [], "removed": []})

    @property
    def added(self) -> int:
        """How many only the candidate has."""
        return self.classes["added"].total()

    @property
    def removed(self) -> int:
        """How many only the baseline has."""
        return self.classes["removed"].total()

    @property
    def differs(self) -> bool:
        """Whether anything is not the same."""
        return bool(self.changed or self.added or self.removed)

    def counts(self) -> Counts:
        """The counts by name."""
        return {"same": self.same, "changed": self.changed, "added": self.added, "removed": self.removed}

    def compare(self, baseline: Batch, candidate: Batch, ids: Flags | None = None, also: Flags | None = None) -> Flags:
        """Compare rows (N,) that belong together; which of them differ.

        `ids` (N,) says whose ids count as different, where that is not plain equality; `also` (N,) which rows differ
        anyhow, by what is in them.
        """
        changed = np.zeros(len(baseline.labels), dtype=np.bool_) if also is None else also.copy()
        lengths: dict[str, Flags] = {}
        for name, mine in baseline.fields.columns.items():
            theirs = candidate.fields.columns[name]
            word = self.prefix + name
            tally = self.fields.get(word)
            if tally is None:
                tally = self.fields[word] = FieldTally(self.tolerance(word))
            apart, beyond = difference(name, mine, theirs, tally.tolerance)
            if name == "id" and ids is not None:
                beyond = ids
            for counted, other in lengths.items():
                if name.startswith(f"{counted}."):  # where lengths differ they tell enough
                    beyond = beyond & ~other
            if name in baseline.fields.counted:
                lengths[name] = beyond
            if beyond.any():
                changed |= beyond
                self._note(tally, word, (mine, theirs), apart, np.flatnonzero(beyond), baseline)
        self.changed += int(changed.sum())
        self.same += len(changed) - int(changed.sum())
        return changed

    def only(self, side: str, batch: Batch) -> None:
        """Count rows that are `added` or `removed`."""
        self.classes[side].update(_text(label) for label in batch.labels.tolist())
        kept = self.alone[side]
        columns = batch.fields.columns
        for row in range(min(len(batch.labels), WORST - len(kept))):
            values = {name: shown(columns[name], row) for name in _TELLING if name in columns}
            time = None if batch.times is None else int(batch.times[row])
            sides = (values, None) if side == "removed" else (None, values)
            kept.append(Case(np.inf, time, _name(batch, row), self.word, *sides))

    def _note(
        self, tally: FieldTally, name: str, columns: tuple[Column, Column], apart: Array, rows: Rows, batch: Batch
    ) -> None:
        tally.changed += len(rows)
        tally.largest = max(tally.largest, float(apart[rows].max()))
        if columns[0].kind is Kind.TEXT and columns[0].counts is None and name.endswith(_FEW_VALUES):
            pairs = zip(*(column.values[rows, 0].tolist() for column in columns), strict=True)
            tally.transitions.update((_text(before), _text(after)) for before, after in pairs)
        for row in rows[np.argsort(-apart[rows], kind="stable")][:WORST].tolist():
            size = float(apart[row])
            if len(tally.cases) == WORST and size <= tally.cases[-1].difference:
                break
            where, mine, theirs = largest_at(*columns, row)
            time = None if batch.times is None else int(batch.times[row])
            tally.cases.append(Case(size, time, _name(batch, row), name + where, mine, theirs))
            tally.cases.sort(key=lambda case: -case.difference)
            del tally.cases[WORST:]


def _name(batch: Batch, row: int) -> str:
    """What a row is called: its label, and its id if it has one."""
    ids = batch.fields.columns.get("id")
    parts = [batch.labels[row], ids.values[row, 0] if ids is not None and ids.kind is Kind.TEXT else b""]
    return " ".join(_text(part) for part in parts if part)


def _text(label: bytes) -> str:
    return label.decode(errors="replace")
