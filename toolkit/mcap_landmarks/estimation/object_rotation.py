"""How far a robot turned between two moments, by the objects that it saw at both."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array

_SAME_RANGE_M = 0.5
"""An object's distance changes by less in the fraction of a second from one scene to the next."""
_SAME_TURN_RAD = 0.05
"""Bearings of objects that stand turn alike to within this: their noise and the robot's own motion."""
_NEAREST_M = 0.3
_MOST_RAD = 1.2


def object_turn(first_xy: Array, second_xy: Array, same: NDArray[np.bool_], moved_xy: Array) -> float | None:
    """How far to the left the robot turned from a first to a second scene; None where objects do not tell.

    Objects stand at (N, 2) and (M, 2) in the robot's frame; `same` (N, M) says which may be one thing, and `moved_xy`
    (2,) how far the robot went meanwhile, in the first frame. Each pair that may be one thing votes with the change of
    its bearing; the largest group of votes that agree counts, by its mean.
    """
    here = first_xy - moved_xy
    far = np.linalg.norm(here, axis=1), np.linalg.norm(second_xy, axis=1)
    bearings = np.arctan2(here[:, 1], here[:, 0]), np.arctan2(second_xy[:, 1], second_xy[:, 0])
    near = np.abs(far[0][:, None] - far[1]) < _SAME_RANGE_M
    turned = wrap(bearings[0][:, None] - bearings[1])
    voting = same & near & (np.abs(turned) < _MOST_RAD) & (np.minimum(far[0][:, None], far[1]) > _NEAREST_M)
    votes = turned[voting]
    if not len(votes):
        return None
    together = np.abs(votes[:, None] - votes) < _SAME_TURN_RAD
    groups = together.sum(axis=1)
    best = int(np.argmax(groups))
    outside = groups[~together[best]]
    if len(outside) and outside.max() == groups[best]:  # two turns are as likely
        return None
    return float(votes[together[best]].mean())
