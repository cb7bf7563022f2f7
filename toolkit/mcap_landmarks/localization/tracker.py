"""Follow a robot whose place in the map is known, and notice when it is not there any more."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from mcap_landmarks.geometry import se2
from mcap_landmarks.localization.evidence import Memory
from mcap_landmarks.localization.match import Fix
from mcap_landmarks.localization.matching import Matcher, Objects, is_same_place
from mcap_landmarks.localization.track_hypothesis import Hypothesis
from mcap_landmarks.localization.verification import UNMATCHED

Array = NDArray[np.float64]

_MOST = 8
# Opinions that are less likely against the best (as logarithm) are dropped.
_DROPPED = -12.0
# So many more objects that do not match than objects that do, of late, say that the pose is off.
_ASTRAY = 8
# Beyond such uncertainty the linear model fails.
_LOST_RAD = 0.5


class Follower:
    """Pose of a robot by a Kalman filter over odometry and landmarks, and the odds that its place is wrong.

    Where a bundle can be read in several ways, each of them is followed until later bundles decide.
    """

    def __init__(self, matcher: Matcher, fix: Fix, points_xy: Array, length_m: float) -> None:
        self._matcher = matcher
        used = fix.landmarks != UNMATCHED
        places = se2.transform_points(fix.pose, points_xy)
        places[used] = matcher.index.positions_xy[fix.landmarks[used]]
        memory = Memory.of(length_m, places, fix.landmarks, fix.expected_accidental)
        self._astray = 0
        self._hypotheses = [Hypothesis(matcher, fix.pose, fix.covariance, memory, np.zeros((3, 3)))]

    @property
    def lost(self) -> bool:
        """Whether the place is as likely wrong as right, or so uncertain that following makes no sense."""
        best = self._hypotheses[0]
        spread = np.sqrt(max(float(np.linalg.det(best.covariance[:2, :2])), 0.0))
        crowd = 2 * np.pi * spread * np.exp(self._matcher.density.log_density[-1])
        doubtful = best.memory.odds_against > 1 or self._astray > _ASTRAY
        return bool(doubtful or crowd > 1 or best.covariance[2, 2] > _LOST_RAD**2)

    def move(self, step: Array, step_covariance: Array, way_m: float) -> None:
        """The base moves by `step` (3,) over a way, known up to a covariance (3, 3) in the frame it starts from."""
        self._hypotheses = [one.moved(step, step_covariance, way_m) for one in self._hypotheses]

    def see(self, objects: Objects) -> Fix:
        """Take in one bundle, and say how it fits."""
        if not len(objects.rows):
            best = self._hypotheses[0]
            return Fix(best.pose, best.covariance, np.zeros(0, dtype=np.int64), best.memory.odds_against, 0.0, 0)
        after = [branch for one in self._hypotheses for branch in one.saw(objects)]
        after.sort(key=lambda branch: -branch[0].log_weight)
        best, fix = after[0]
        matched = int((fix.landmarks != UNMATCHED).sum())
        self._astray = max(self._astray + len(fix.landmarks) - 2 * matched, 0)
        kept: list[Hypothesis] = []
        for one, _ in after:
            likely = one.log_weight - best.log_weight
            if likely < _DROPPED or len(kept) == _MOST:
                break
            if not is_same_place(one.pose, np.array([other.pose for other in kept]).reshape(-1, 3)).any():
                kept.append(replace(one, log_weight=likely))
        self._hypotheses = kept
        rivals = float(np.exp(logsumexp([one.log_weight for one in kept[1:]]))) if len(kept) > 1 else 0.0
        return replace(fix, expected_accidental=fix.expected_accidental + rivals)
