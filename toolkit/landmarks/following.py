"""Follow a robot whose place in the map is known, and notice when it is not there any more."""

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry import se2
from toolkit.landmarks.matching import Matcher, Objects, block_diagonal
from toolkit.landmarks.verdicts import Fix
from toolkit.landmarks.verification import UNMATCHED, Candidates, Constellations, Prior

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# A landmark seen again counts as one sighting over so much of the way, since it errs the same from nearby.
_SAME_VIEW_M = 2.0
# An object this many of its standard deviations from where something was seen before is that again.
_AGAIN_SIGMAS = 3.0
# Beyond such uncertainty the linear model fails.
_LOST_RAD = 0.5
_LEAST_LOG_ODDS = -60.0
_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


class Follower:
    """Pose and its covariance, by a Kalman filter over odometry and landmarks, and the odds that all of it is wrong.

    The odds start with the expected number of accidental matches and grow with the way, so that after `length_m`
    without anything new they reach what is accepted at most. What is seen for the first time speaks for the place, or
    against it if the map lacks it; what is seen again says nothing new.
    """

    def __init__(self, matcher: Matcher, fix: Fix, points_xy: Array, length_m: float) -> None:
        self._matcher, self._length_m = matcher, length_m
        self.pose, self.covariance = fix.pose, fix.covariance
        self.log_odds = max(float(np.log(max(fix.expected_accidental, 1e-300))), _LEAST_LOG_ODDS)
        self._way_m = 0.0
        self._known_xy = self._places(fix.landmarks, points_xy)
        self._known_as = fix.landmarks
        self._known_at_m = np.zeros(len(points_xy))
        self._sightings = np.where(fix.landmarks == UNMATCHED, 0.0, 1.0)

    @property
    def lost(self) -> bool:
        """Whether the place is as likely wrong as right, or so uncertain that following makes no sense."""
        spread = np.sqrt(max(float(np.linalg.det(self.covariance[:2, :2])), 0.0))
        crowd = 2 * np.pi * spread * np.exp(self._matcher.density.log_density[-1])
        return bool(self.log_odds > 0 or crowd > 1 or self.covariance[2, 2] > _LOST_RAD**2)

    def move(self, step: Array, step_covariance: Array, way_m: float) -> None:
        """The base moves by `step` (3,) over a way, known up to a covariance (3, 3) in the frame it starts from."""
        back, jacobian = np.eye(3), np.eye(3)
        back[:2, :2] = se2.rotation(-step[2])
        jacobian[:2, 2] = _TURN @ step[:2]
        self.pose = se2.compose(self.pose, step)
        self.covariance = back @ (jacobian @ self.covariance @ jacobian.T + step_covariance) @ back.T
        self._way_m += way_m
        self._sightings = self._sightings * np.exp(-way_m / _SAME_VIEW_M)
        strayed = self._matcher.config.accidental * way_m / self._length_m
        self.log_odds = float(np.logaddexp(self.log_odds, np.log(max(strayed, 1e-300))))

    def see(self, objects: Objects) -> Fix:
        """Take in one bundle, and say how it fits."""
        k, verifier = len(objects.rows), self._matcher.verifier
        if not k:
            return Fix(self.pose, self.covariance, np.zeros(0, dtype=np.int64), float(np.exp(self.log_odds)), 0.0, 0)
        covariance = block_diagonal(objects.covariances[None])
        sets = self._matcher.sets(objects.points_xy[None], covariance, objects.probabilities[None])
        start = Candidates(np.zeros(1, dtype=np.int64), self.pose[None], np.full((1, k), UNMATCHED))
        prior = Prior(self.pose[None], np.linalg.inv(self.covariance)[None])
        matched = verifier.match(sets, start, prior).candidates
        landmarks = matched.landmarks[0]
        again = self._recall(landmarks, objects, matched.pose[0])
        self._weigh(landmarks, objects, sets.log_ratio[0], again < 0)
        used = landmarks != UNMATCHED
        chi2 = self._surprise(landmarks, objects, used)[1]
        self._remember(landmarks, self._places(landmarks, objects.points_xy, matched.pose[0]), again)
        tired = np.ones(k)
        tired[used] = [self._sightings[np.argmax(self._known_as == landmark)] for landmark in landmarks[used]]
        worn = block_diagonal((objects.covariances * tired[:, None, None])[None])
        sets = Constellations(sets.points_xy, worn, sets.log_ratio, sets.log_density)
        solved = verifier.solve(sets, matched, prior)
        self.pose, self.covariance = solved.candidates.pose[0], solved.covariance[0]
        odds = float(np.exp(self.log_odds))
        return Fix(self.pose, self.covariance, landmarks, odds, chi2, 2 * int(used.sum()))

    def _places(self, landmarks: Ints, points_xy: Array, pose: Array | None = None) -> Array:
        """Where in the map (K, 2) the objects are: where their landmarks are, or else where they were seen."""
        seen = se2.transform_points(self.pose if pose is None else pose, points_xy)
        return np.where((landmarks != UNMATCHED)[:, None], self._matcher.index.positions_xy[landmarks], seen)

    def _recall(self, landmarks: Ints, objects: Objects, pose: Array) -> Ints:
        """Which known thing (K,) each object is, -1 where it is seen for the first time."""
        if not len(self._known_as):
            return np.full(len(landmarks), -1, dtype=np.int64)
        points = objects.points_xy
        apart = np.linalg.norm(self._places(landmarks, points, pose)[:, None] - self._known_xy, axis=-1)
        variance = np.trace(objects.covariances, axis1=1, axis2=2) + np.trace(self.covariance[:2, :2])
        variance += (points**2).sum(axis=1) * self.covariance[2, 2]
        near = apart.argmin(axis=1)
        unmatched = np.where(apart.min(axis=1) < _AGAIN_SIGMAS * np.sqrt(variance), near, -1)
        same = landmarks[:, None] == self._known_as
        return np.where(landmarks == UNMATCHED, unmatched, np.where(same.any(axis=1), same.argmax(axis=1), -1))

    def _weigh(self, landmarks: Ints, objects: Objects, log_ratio: Array, fresh: Bools) -> None:
        """Let what is new speak for the place or against it."""
        used = landmarks != UNMATCHED
        spurious = self._matcher.config.spurious
        gain = float(np.log(spurious)) * int((fresh & ~used).sum())
        new = np.flatnonzero(fresh & used)
        if len(new):
            gain += self._surprise(landmarks, objects, used & ~fresh)[0] - self._surprise(landmarks, objects, used)[0]
            places = self._matcher.index.positions_xy[landmarks[new]]
            known = np.concatenate([self._known_xy, places])
            apart = np.linalg.norm(places[:, None] - known, axis=-1)
            apart[np.arange(len(new)), len(self._known_xy) + np.arange(len(new))] = np.inf
            gain -= float(self._matcher.density.at(apart).max(axis=1).sum())
            gain += float(log_ratio[new, self._matcher.index.class_of[landmarks[new]]].sum())
            gain += len(new) * float(np.log(1 - spurious))
        self.log_odds = max(self.log_odds - gain, _LEAST_LOG_ODDS)

    def _surprise(self, landmarks: Ints, objects: Objects, chosen: Bools) -> tuple[float, float]:
        """Minus the log density of what was seen of chosen objects, given all that was known before; its chi-square."""
        rows = np.flatnonzero(chosen)
        if not len(rows):
            return 0.0, 0.0
        verifier = self._matcher.verifier
        expected = se2.transform_points(se2.inverse(self.pose), verifier.index.positions_xy[landmarks[rows]])
        miss = (expected - objects.points_xy[rows]).ravel()
        jacobian = np.zeros((2 * len(rows), 3))
        jacobian[:, :2] = np.tile(np.eye(2), (len(rows), 1))
        jacobian[:, 2] = (expected @ _TURN.T).ravel()
        back = se2.rotation(-self.pose[2])
        own = objects.covariances[rows] + back @ verifier.spread[landmarks[rows]] @ back.T
        spread = jacobian @ self.covariance @ jacobian.T + block_diagonal(own[None])[0]
        chi2 = float(miss @ np.linalg.solve(spread, miss))
        return (chi2 + float(np.linalg.slogdet(2 * np.pi * spread)[1])) / 2, chi2

    def _remember(self, landmarks: Ints, places: Array, again: Ints) -> None:
        old = again[again >= 0]
        self._known_at_m[old] = self._way_m
        np.add.at(self._sightings, old, 1.0)
        new = again < 0
        self._known_xy = np.concatenate([self._known_xy, places[new]])
        self._known_as = np.concatenate([self._known_as, landmarks[new]])
        self._known_at_m = np.concatenate([self._known_at_m, np.full(int(new.sum()), self._way_m)])
        self._sightings = np.concatenate([self._sightings, np.ones(int(new.sum()))])
        keep = self._known_at_m > self._way_m - self._length_m
        self._known_xy, self._known_as = self._known_xy[keep], self._known_as[keep]
        self._known_at_m, self._sightings = self._known_at_m[keep], self._sightings[keep]
