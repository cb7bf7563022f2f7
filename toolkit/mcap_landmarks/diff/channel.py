"""The differences of one channel."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from mcap_landmarks.diff.document import ChannelEntry, Unpaired
from mcap_landmarks.diff.fields import LIST_UNITS, MESSAGES, ComparedMessages, Items, pair_items
from mcap_landmarks.diff.pairs import Pairs
from mcap_landmarks.diff.tally import Tally
from mcap_landmarks.diff.values import Flags, Rows
from mcap_landmarks.stage import Tolerance

CLASSED = ("detections", "objects", "landmarks")
"""Units that are of a class."""


@dataclass(slots=True)
class ChannelDiff:
    """What differs in one channel. `rows` are what is counted, `unit` by its word: messages, or the items in them.

    `tolerance` gives that of a field; fields of messages that are lists of items begin with `message.`. Ids of items
    are names that each run gives as it likes: only one that does not stay with its partner's is a change.
    """

    message_type: str
    tolerance: Callable[[str], Tolerance]
    unit: str = MESSAGES
    rows: Tally = field(init=False)
    messages: Tally = field(init=False)
    _there: dict[bytes, bytes] = field(default_factory=dict)
    _back: dict[bytes, bytes] = field(default_factory=dict)
    _strange: set[tuple[bytes, bytes]] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.rows = self.messages = Tally(self.unit.removesuffix("s"), self.tolerance)
        if self.unit in LIST_UNITS:
            self.messages = Tally("message", self.tolerance, prefix="message.")

    @property
    def differs(self) -> bool:
        """Whether anything is not the same."""
        return self.rows.differs or self.messages.differs

    def pair(self, baseline: ComparedMessages, candidate: ComparedMessages, times: Rows | None) -> None:
        """Compare messages that belong together, at `times` (N,) in nanoseconds or outside time."""
        touched = None
        if baseline.items is not None and candidate.items is not None:
            touched = self._pair_items(baseline.items, candidate.items, times)
        self.messages.compare(baseline.batch(times), candidate.batch(times), also=touched)

    def only(self, side: str, messages: ComparedMessages, times: Rows | None) -> None:
        """Count messages that are `added` or `removed`, and what is in them."""
        self.messages.only(side, messages.batch(times))
        if messages.items is not None:
            self.rows.only(side, messages.items.batch(times))

    def equal(self, messages: ComparedMessages) -> None:
        """Count messages whose bytes are the same, and what is in them."""
        self.messages.same += messages.rows
        if messages.items is not None:
            self.rows.same += len(messages.items.labels)
            if ids := messages.items.ids:
                names = {name: name for name in ids.values[:, 0].tolist()}
                self._there.update(names)
                self._back.update(names)

    def document(self) -> ChannelEntry:
        """An entry of `channels`."""
        tallies = [self.rows] if self.rows is self.messages else [self.messages, self.rows]
        fields = {name: entry for tally in tallies for name, entry in tally.fields.items() if entry.changed}
        worst = [*self.rows.alone["removed"], *self.rows.alone["added"]]
        worst += [case for entry in fields.values() for case in entry.cases]
        return {
            "type": self.message_type,
            "unit": self.unit,
            **self.rows.counts(),
            "messages": self.messages.counts(),
            "classes": self._classes(),
            "fields": {name: entry.document() for name, entry in fields.items()},
            "worst": [case.document() for case in worst],
        }

    def _classes(self) -> dict[str, Unpaired]:
        """How many of each class only one side has, where what is counted is of a class."""
        if self.unit not in CLASSED:
            return {}
        added, removed = self.rows.classes["added"], self.rows.classes["removed"]
        return {name: {"added": added[name], "removed": removed[name]} for name in sorted({*added, *removed} - {""})}

    def _pair_items(self, baseline: Items, candidate: Items, times: Rows | None) -> Flags:
        """Compare the items of messages (N,) that belong together; which messages have any that is not the same."""
        pairs, tally = pair_items(baseline, candidate), self.rows
        mine, theirs = baseline.batch(times), candidate.batch(times)
        ids = self._ids(baseline, candidate, pairs) if baseline.ids else None
        changed = tally.compare(mine.take(pairs.baseline), theirs.take(pairs.candidate), ids)
        tally.only("removed", mine.take(pairs.removed))
        tally.only("added", theirs.take(pairs.added))
        touched = np.zeros(len(baseline.counts), dtype=np.bool_)
        touched[baseline.messages[pairs.baseline[changed]]] = True
        touched[baseline.messages[pairs.removed]] = True
        touched[candidate.messages[pairs.added]] = True
        return touched

    def _ids(self, baseline: Items, candidate: Items, pairs: Pairs) -> Flags:
        """Which pairs (K,) have ids that were not partners before; an id that only numbers its place says nothing.

        What comes a second time has become the custom, so that one switch of tracks is one change.
        """
        sides = (baseline, pairs.baseline), (candidate, pairs.candidate)
        ids = [items.ids.values[rows, 0].tolist() for items, rows in sides if items.ids]
        places = [items.places[rows].tolist() for items, rows in sides]
        found = np.zeros(len(pairs.baseline), dtype=np.bool_)
        for row, (mine, theirs, place, other) in enumerate(zip(*ids, *places, strict=True)):
            if mine == b"%d" % place and theirs == b"%d" % other:
                continue
            if self._there.get(mine, theirs) == theirs and self._back.get(theirs, mine) == mine:
                self._there[mine], self._back[theirs] = theirs, mine
            elif (mine, theirs) in self._strange:
                self._strange.discard((mine, theirs))
                self._there[mine], self._back[theirs] = theirs, mine
            else:
                self._strange.add((mine, theirs))
                found[row] = True
        return found
