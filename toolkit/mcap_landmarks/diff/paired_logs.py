"""Which log of one set of runs is which of another: by what was recorded, then by name."""

from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from typing import Literal, NamedTuple, Protocol

PairedBy = Literal["fingerprint", "name"]


class NamedLog(Protocol):
    """A log of a set: its name there, and its recording's fingerprint, None where it cannot be read."""

    @property
    def name(self) -> str:
        """Its path in the folder, without suffix."""

    @property
    def fingerprint(self) -> str | None:
        """See `Recording.fingerprint`."""


class LogPair(NamedTuple):
    """Places in both sets of a log that is in both, and what tells."""

    baseline: int
    candidate: int
    by: PairedBy


def pair_logs(baseline: Sequence[NamedLog], candidate: Sequence[NamedLog]) -> list[LogPair]:
    """The logs that both sets have, in the order of the baseline.

    Of several with one fingerprint those are paired that have one name, and the last two that are left.
    """
    pairs: list[LogPair] = []

    def match(by: PairedBy, key: Callable[[NamedLog], Hashable]) -> None:
        rest: tuple[dict[Hashable, list[int]], ...] = (defaultdict(list), defaultdict(list))
        for side, (logs, taken) in enumerate(
            ((baseline, {pair.baseline for pair in pairs}), (candidate, {pair.candidate for pair in pairs}))
        ):
            for row, log in enumerate(logs):
                if row not in taken and key(log) is not None:
                    rest[side][key(log)].append(row)
        for value, rows in rest[0].items():
            others = rest[1].get(value, [])
            if len(rows) == len(others) == 1:
                pairs.append(LogPair(rows[0], others[0], by))

    match("fingerprint", lambda log: log.fingerprint and (log.fingerprint, log.name))
    match("fingerprint", lambda log: log.fingerprint)
    match("name", lambda log: log.name)
    return sorted(pairs)
