"""What became of single bundles from one run to another, the worst change first."""

from typing import NamedTuple

import numpy as np

from mcap_landmarks.evaluation.pose_metrics import FALSE_M, pose_errors
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.messages.match import Status
from mcap_landmarks.report.page.bundle_table import WORDS
from mcap_landmarks.report.page.paged_result import PagedResult

_SAME_M, _SAME_DEG = 1e-3, 0.1
"""Poses that are nearer than a millimetre and a tenth of a degree are the same to look at, as the map draws them."""


class BundleChange(NamedTuple):
    """A bundle that changed: when, how bad that is (the lower the worse), in words, and by how much.

    `moved_m` is the distance of the two poses, `off_m` how far each is from the truth; None where there is none.
    """

    stamp_ns: int
    rank: int
    words: str
    moved_m: float | None
    off_m: tuple[float | None, float | None]


class _Side(NamedTuple):
    """One run, by stamp: statuses, poses (3,), and distances to the truth."""

    statuses: dict[int, int]
    poses: dict[int, np.ndarray]
    off_m: dict[int, float]


def bundle_changes(baseline: PagedResult, candidate: PagedResult) -> list[BundleChange]:
    """Bundles of the same stamp that differ, and those that only one run has.

    First those that are localized no more, then those that became false, then those that moved, the farthest first,
    then those that only one run has, at last those that are localized now.
    """
    mine, theirs = _side(baseline), _side(candidate)
    stamps = sorted({*mine.statuses, *theirs.statuses})
    found = [change for stamp_ns in stamps if (change := _change(stamp_ns, mine, theirs)) is not None]
    return sorted(found, key=_worst_first)


def _change(stamp_ns: int, mine: _Side, theirs: _Side) -> BundleChange | None:
    off_m = mine.off_m.get(stamp_ns), theirs.off_m.get(stamp_ns)
    before, after = mine.statuses.get(stamp_ns), theirs.statuses.get(stamp_ns)
    if before is None or after is None:
        where = "candidate" if before is None else "baseline"
        return BundleChange(stamp_ns, 3, f"only the {where} has it", None, off_m)
    moved = _moved(mine.poses.get(stamp_ns), theirs.poses.get(stamp_ns))
    if before != after:
        rank = 0 if before == Status.LOCALIZED else 4 if after == Status.LOCALIZED else 2
        return BundleChange(stamp_ns, rank, f"{WORDS[before]} → {WORDS[after]}", moved, off_m)
    if moved is None:
        return None
    is_false = (off_m[1] or 0.0) > FALSE_M >= (off_m[0] or 0.0)
    return BundleChange(stamp_ns, 1 if is_false else 2, "false now" if is_false else "moved", moved, off_m)


def _worst_first(one: BundleChange) -> tuple[int, float, int]:
    return one.rank, -(one.moved_m or 0.0), one.stamp_ns


def _side(result: PagedResult) -> _Side:
    table, drawn = result.bundles, result.drawn
    statuses = dict(zip(table.stamps_ns.tolist(), table.statuses.tolist(), strict=True))
    if drawn is None:
        return _Side(statuses, {}, {})
    errors = pose_errors(drawn.scored.estimate, drawn.scored.reference)
    times = drawn.estimate.time_ns
    off = np.hypot(errors[:, 0], errors[:, 1]).tolist()
    return _Side(
        statuses,
        dict(zip(times.tolist(), drawn.estimate.poses, strict=True)),
        dict(zip(times[drawn.scored.rows].tolist(), off, strict=True)),
    )


def _moved(before: np.ndarray | None, after: np.ndarray | None) -> float | None:
    """The distance between two poses; None if one is missing, or they are the same to look at."""
    if before is None or after is None:
        return None
    distance = float(np.hypot(*(after - before)[:2]))
    turned = abs(float(np.degrees(wrap(after[2] - before[2]))))
    return distance if distance > _SAME_M or turned > _SAME_DEG else None
