"""Landmarks that several logs saw, each in a frame of its own, as one numbered list."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from mcap_landmarks.errors import MapError
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.map_alignment import align_maps
from mcap_landmarks.mapping.submap import Submap

Ints = NDArray[np.int64]

# Landmarks with so many observations lay a log on the map; where a log has none, those with most.
_FIRM = 3
# A log lies on the map by a pair of landmarks, whose errors grow with the distance from them, so that others may be so
# many tolerances from their partners.
_SAME_TOLERANCES = 3
# A pair beyond that costs as much as a thousand at it, so that one more pair within is worth more than closer ones.
_BEYOND_REACH = 1e3


@dataclass(frozen=True, slots=True, eq=False)
class MergedLandmarks:
    """G landmarks of all logs: class_ids (G,), rough positions (G, 2); per log, the number (L,) of its L landmarks.

    None for a log that may be left out and could not be laid on the others.
    """

    class_ids: Ints
    positions_xy: Array
    of_log: tuple[Ints | None, ...]


def merge_logs(
    logs: Sequence[Submap], known: tuple[Ints, Array] | None, config: BuildMapConfig, spare: Collection[int] = ()
) -> MergedLandmarks:
    """Number the landmarks of all logs; those of a map that exists already, `known` (Q,) and (Q, 2), come first.

    Logs are merged one by one, whichever can be laid on what is there; landmarks of a class within three times
    `join_tolerance_m` of each other are then the same one.

    Raises:
        MapError: a log that is not `spare` cannot be laid on the others, or fits in several ways.
    """
    numbers: dict[int, Ints] = {}
    if known is None:
        class_ids, positions = logs[0].class_ids, logs[0].positions_xy
        numbers[0] = np.arange(len(class_ids))
    else:
        class_ids, positions = known
    while len(numbers) < len(logs):
        for i in [i for i in range(len(logs)) if i not in numbers]:
            own = logs[i]
            observations = np.bincount(own.landmark[own.landmark >= 0], minlength=len(own.class_ids))
            firm = observations >= min(_FIRM, observations.max(initial=0))
            pose = align_maps(own.class_ids[firm], own.positions_xy[firm], class_ids, positions, config)
            if pose is None:
                continue
            there = transform_points(pose, own.positions_xy)
            numbers[i] = _match(own.class_ids, there, class_ids, positions, _SAME_TOLERANCES * config.join_tolerance_m)
            new = numbers[i] >= len(class_ids)
            class_ids = np.concatenate([class_ids, own.class_ids[new]])
            positions = np.concatenate([positions, there[new]])
            break
        else:
            lost = ", ".join(str(i + 1) for i in range(len(logs)) if i not in {*numbers, *spare})
            if not lost:
                break
            raise MapError(
                f"log {lost} cannot be laid on the rest of the map: too few landmarks in common, or several ways fit; "
                "map it on its own, or add a log that overlaps with both"
            )
    return MergedLandmarks(class_ids, positions, tuple(numbers.get(i) for i in range(len(logs))))


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
