"""Multi-hypothesis tracking of a robot whose place in the map is known, and when it is not there any more.

As Reid (1979) tracks targets, here one robot among landmarks: each way to associate a bundle with landmarks that later
bundles may confirm makes a hypothesis of its own, with a Kalman filter and a weight; unlikely ones are pruned, and
those that agree on the pose merged.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from mcap_landmarks.geometry import se2
from mcap_landmarks.localization.evidence import Evidence
from mcap_landmarks.localization.match import Fix
from mcap_landmarks.localization.matching import Matcher, Objects, is_same_place
from mcap_landmarks.localization.track_hypothesis import TrackHypothesis
from mcap_landmarks.localization.verification import UNMATCHED

Array = NDArray[np.float64]

# Hypotheses that are kept, each of which costs as much as the first; those are pruned whose weight against the best (as
# logarithm) is below e^-12, one in 160,000: far below the odds that an accepted match may have against it.
_MOST = 8
_PRUNED = -12.0
# So many more objects that match nothing than objects that do, lately, say that the pose is off: where a tenth of the
# objects is spurious, a walk of steps up for these and down for the others gets there with a chance of (1/9)^9.
_ASTRAY = 8
# A heading sigma beyond half a radian turns the linear model by its own size (sine against angle: 4 %).
_LOST_RAD = 0.5


class Tracker:
    """Pose of a robot by Kalman filters over odometry and landmarks, and the odds that its place is wrong."""

    def __init__(self, matcher: Matcher, fix: Fix, points_xy: Array, length_m: float) -> None:
        self._matcher = matcher
        used = fix.landmarks != UNMATCHED
        places = se2.transform_points(fix.pose, points_xy)
        places[used] = matcher.index.positions_xy[fix.landmarks[used]]
        evidence = Evidence.of(length_m, places, fix.landmarks, fix.expected_accidental)
        self._astray = 0
        self._hypotheses = [TrackHypothesis(matcher, fix.pose, fix.covariance, evidence, np.zeros((3, 3)))]

    @property
    def lost(self) -> bool:
        """Whether the place is as likely wrong as right, or so uncertain that following makes no sense.

        That is where odds are against it, where objects keep matching nothing, where more than one landmark is expected
        by chance within its uncertainty, or where the heading is lost.
        """
        best = self._hypotheses[0]
        spread = np.sqrt(max(float(np.linalg.det(best.covariance[:2, :2])), 0.0))
        crowd = 2 * np.pi * spread * np.exp(self._matcher.density.log_density[-1])
        doubtful = best.evidence.odds_against > 1 or self._astray > _ASTRAY
        return bool(doubtful or crowd > 1 or best.covariance[2, 2] > _LOST_RAD**2)

    def predict(self, step: Array, step_covariance: Array, way_m: float) -> None:
        """The base moves by `step` (3,) over a way, known up to a covariance (3, 3) in the frame it starts from."""
        self._hypotheses = [one.predicted(step, step_covariance, way_m) for one in self._hypotheses]

    def update(self, objects: Objects) -> Fix:
        """Take in one bundle, and say how it fits; other hypotheses than the best count as odds against it."""
        if not len(objects.rows):
            best = self._hypotheses[0]
            return Fix(best.pose, best.covariance, np.zeros(0, dtype=np.int64), best.evidence.odds_against, 0.0, 0)
        after = [branch for one in self._hypotheses for branch in one.updated(objects)]
        after.sort(key=lambda branch: -branch[0].log_weight)
        best, fix = after[0]
        matched = int((fix.landmarks != UNMATCHED).sum())
        self._astray = max(self._astray + len(fix.landmarks) - 2 * matched, 0)
        kept: list[TrackHypothesis] = []
        for one, _ in after:
            log_weight = one.log_weight - best.log_weight
            if log_weight < _PRUNED or len(kept) == _MOST:
                break
            if not is_same_place(one.pose, np.array([other.pose for other in kept]).reshape(-1, 3)).any():
                kept.append(replace(one, log_weight=log_weight))
        self._hypotheses = kept
        rivals = float(np.exp(logsumexp([one.log_weight for one in kept[1:]]))) if len(kept) > 1 else 0.0
        return replace(fix, expected_accidental=fix.expected_accidental + rivals)
