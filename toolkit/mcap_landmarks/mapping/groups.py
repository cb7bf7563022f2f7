"""Groups of three landmarks, as the thesis's database has them, from what was seen along the way."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.mapping.observations import LogObservations, left_to_right
from mcap_landmarks.maps.model import Group

_SIZE = 3


def groups_of(
    logs: Sequence[LogObservations],
    numbers: Sequence[NDArray[np.int64]],
    trajectories: Sequence[Array],
    name_of: Mapping[int, str],
) -> tuple[Group, ...]:
    """The three nearest landmarks of every bundle, left to right, each set once with the pose that saw it first.

    numbers (N,) says per log which landmark each observation shows; `name_of` has the ids of those that count.
    """
    found: dict[frozenset[str], Group] = {}
    for log, number, poses in zip(logs, numbers, trajectories, strict=True):
        known = np.array([int(n) in name_of for n in number], dtype=np.bool_)
        for i, pose in enumerate(poses):
            rows = log.objects_of(i)
            rows = rows[known[rows]]
            if len(rows) < _SIZE:
                continue
            nearest = rows[np.argsort(np.linalg.norm(log.points_xy[rows], axis=1), kind="stable")[:_SIZE]]
            ordered = nearest[left_to_right(log.points_xy[nearest])]
            ids = tuple(name_of[int(number[row])] for row in ordered)
            if len(set(ids)) == _SIZE:
                found.setdefault(frozenset(ids), Group(ids, pose))
    return tuple(found.values())
