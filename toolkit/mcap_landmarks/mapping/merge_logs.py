"""Landmarks that several logs saw, each in a frame of its own, as one numbered list."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.map_alignment import Alignment, align_maps
from mcap_landmarks.mapping.submap import Submap

Ints = NDArray[np.int64]

# Landmarks with so many observations lay a log on the map; where a log has none, those with most.
_FIRM = 3
# A log lies on the map by a pair of landmarks, whose errors grow with the distance from them, so that others may be so
# many tolerances from their partners.
_SAME_TOLERANCES = 3
# Logs with this share of the most landmarks in common are laid at once: the pose of each is the better for those that
# come before only where these add to what it has in common, and weaker ones wait for that.
_STRONG = 0.5
# A pair beyond that costs as much as a thousand at it, so that one more pair within is worth more than closer ones.
_BEYOND_REACH = 1e3


@dataclass(frozen=True, slots=True, eq=False)
class MergedLandmarks:
    """G landmarks of all logs: class_ids (G,), rough positions (G, 2); per log, the number (L,) of its L landmarks.

    None for a log that could not be laid on the others, for a reason; `order` are the rows of those that were, in which
    they were.
    """

    class_ids: Ints
    positions_xy: Array
    of_log: tuple[Ints | None, ...]
    order: tuple[int, ...]
    reasons: Mapping[int, str]


def merge_logs(
    logs: Sequence[Submap], known: tuple[Ints, Array] | None, config: BuildMapConfig, spare: Collection[int] = ()
) -> MergedLandmarks:
    """Number the landmarks of all logs; those of a map that exists already, `known` (Q,) and (Q, 2), come first.

    Without one, the log with most firm landmarks begins. Then always those are laid on what is there that have most in
    common with it; landmarks of a class within three times `join_tolerance_m` of each other are then the same one. Of
    those that remain another group may begin so, and the group of most logs counts. `spare` logs, which begin none and
    do not count, are what their odometry lost of others. The rows decide only between equals.
    """
    if known is not None:
        return _Growing(logs, config, *known).grow()
    found = list[MergedLandmarks]()
    left = {i for i in range(len(logs)) if i not in spare}
    while left and len(left) > max((_size(one, spare) for one in found), default=0):
        first = min(left, key=lambda i: (-int(_firm(logs[i]).sum()), i))
        found.append(_Growing(logs, config, logs[first].class_ids, logs[first].positions_xy, first).grow())
        left.difference_update(found[-1].order)
    return max(found, key=lambda one: _size(one, spare))


def _size(group: MergedLandmarks, spare: Collection[int]) -> int:
    """How many logs count in a group."""
    return len({*group.order}.difference(spare))


class _Growing:
    """Landmarks (G,), (G, 2) that logs are laid on; those of the log `first` are there."""

    def __init__(
        self,
        logs: Sequence[Submap],
        config: BuildMapConfig,
        class_ids: Ints,
        positions: Array,
        first: int | None = None,
    ) -> None:
        self._logs, self._config = logs, config
        self._class_ids, self._positions = class_ids, positions
        self._numbers = {} if first is None else {first: np.arange(len(class_ids))}

    def grow(self) -> MergedLandmarks:
        """Lay on it whatever can be."""
        reasons = dict[int, str]()
        while not reasons and (left := [i for i in range(len(self._logs)) if i not in self._numbers]):
            found = {i: self._fit(i) for i in left}
            if not self._lay_strong(found):
                reasons = {i: one.reason for i, one in found.items()}
        of_log = tuple(self._numbers.get(i) for i in range(len(self._logs)))
        return MergedLandmarks(self._class_ids, self._positions, of_log, tuple(self._numbers), reasons)

    def _lay_strong(self, found: Mapping[int, Alignment]) -> bool:
        """Lay the logs with most in common where they were found to lie; False if none was."""
        poses = sorted((-one.common, i) for i, one in found.items() if one.pose is not None)
        for common, i in poses:
            pose = found[i].pose
            if pose is not None and common <= _STRONG * poses[0][0]:
                self._lay(i, pose)
        return bool(poses)

    def _fit(self, i: int) -> Alignment:
        """Where a log lies."""
        log, firm = self._logs[i], _firm(self._logs[i])
        return align_maps(log.class_ids[firm], log.positions_xy[firm], self._class_ids, self._positions, self._config)

    def _lay(self, i: int, pose: Array) -> None:
        """Number the landmarks of a log where it lies; new ones come after those that are there."""
        own = self._logs[i]
        there = transform_points(pose, own.positions_xy)
        reach_m = _SAME_TOLERANCES * self._config.join_tolerance_m
        self._numbers[i] = _match(own.class_ids, there, self._class_ids, self._positions, reach_m)
        new = self._numbers[i] >= len(self._class_ids)
        self._class_ids = np.concatenate([self._class_ids, own.class_ids[new]])
        self._positions = np.concatenate([self._positions, there[new]])


def _firm(log: Submap) -> NDArray[np.bool_]:
    """Which landmarks (L,) of a log say where it lies."""
    observations = np.bincount(log.landmark[log.landmark >= 0], minlength=len(log.class_ids))
    firm: NDArray[np.bool_] = observations >= min(_FIRM, observations.max(initial=0))
    return firm


def _match(class_ids: Ints, positions: Array, map_class_ids: Ints, map_xy: Array, reach_m: float) -> Ints:
    """Number (L,) in the map of each landmark, one to one, with the least total distance (Kuhn 1955, Munkres 1957).

    Those without a partner get numbers after the map's.
    """
    distance = np.linalg.norm(positions[:, None] - map_xy, axis=2)
    distance[class_ids[:, None] != map_class_ids] = np.inf
    rows, columns = linear_sum_assignment(np.minimum(distance, _BEYOND_REACH * reach_m))
    fits = distance[rows, columns] <= reach_m
    numbers = np.full(len(class_ids), -1, dtype=np.int64)
    numbers[rows[fits]] = columns[fits]
    lone = np.flatnonzero(numbers < 0)
    numbers[lone] = len(map_class_ids) + np.arange(len(lone))
    return numbers
