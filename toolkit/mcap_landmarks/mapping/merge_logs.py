"""Landmarks that several logs saw, each in a frame of its own, as one numbered list."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from mcap_landmarks.errors import MapError
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.labelling import LocalMap
from mcap_landmarks.mapping.map_alignment import align_maps

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Numbering:
    """G landmarks of all logs: kinds (G,) and rough positions (G, 2); per log, the number (L,) of its L landmarks."""

    kinds: Ints
    positions_xy: Array
    of_log: tuple[Ints, ...]


def number_landmarks(logs: Sequence[LocalMap], known: tuple[Ints, Array] | None, config: BuildMapConfig) -> Numbering:
    """Number the landmarks of all logs; those of a map that exists already, `known` (Q,) and (Q, 2), come first.

    Logs join one by one, whichever can be laid on what is there; landmarks of a class within three times
    `join_tolerance_m` of each other are then the same one.

    Raises:
        MapError: a log cannot be laid on the others, or fits in several ways.
    """
    numbers: dict[int, Ints] = {}
    if known is None:
        kinds, positions = logs[0].kinds, logs[0].positions_xy
        numbers[0] = np.arange(len(kinds))
    else:
        kinds, positions = known
    while len(numbers) < len(logs):
        for i in [i for i in range(len(logs)) if i not in numbers]:
            local = logs[i]
            seen = np.bincount(local.landmark[local.landmark >= 0], minlength=len(local.kinds))
            firm = seen >= min(3, seen.max(initial=0))
            pose = align_maps(local.kinds[firm], local.positions_xy[firm], kinds, positions, config)
            if pose is None:
                continue
            there = transform_points(pose, local.positions_xy)
            numbers[i] = _match(local.kinds, there, kinds, positions, 3 * config.join_tolerance_m)
            new = numbers[i] >= len(kinds)
            kinds = np.concatenate([kinds, local.kinds[new]])
            positions = np.concatenate([positions, there[new]])
            break
        else:
            lost = ", ".join(str(i + 1) for i in range(len(logs)) if i not in numbers)
            raise MapError(
                f"log {lost} cannot be laid on the rest of the map: too few landmarks in common, or several ways fit; "
                "map it on its own, or add a log that overlaps with both"
            )
    return Numbering(kinds, positions, tuple(numbers[i] for i in range(len(logs))))


def _match(kinds: Ints, positions: Array, map_kinds: Ints, map_xy: Array, reach_m: float) -> Ints:
    """Number (L,) in the map of each landmark, one to one; those without a partner get numbers after the map's."""
    distance = np.linalg.norm(positions[:, None] - map_xy, axis=2)
    distance[kinds[:, None] != map_kinds] = np.inf
    rows, columns = linear_sum_assignment(np.minimum(distance, 1e3 * reach_m))
    fits = distance[rows, columns] <= reach_m
    numbers = np.full(len(kinds), -1, dtype=np.int64)
    numbers[rows[fits]] = columns[fits]
    lone = np.flatnonzero(numbers < 0)
    numbers[lone] = len(map_kinds) + np.arange(len(lone))
    return numbers
