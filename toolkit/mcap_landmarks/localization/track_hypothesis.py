"""One hypothesis of where a tracked robot is: pose, covariance, the evidence for its place, and its weight."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry import se2
from mcap_landmarks.localization.evidence import Evidence
from mcap_landmarks.localization.match import Fix
from mcap_landmarks.localization.matching import Matcher, Objects, block_diagonal
from mcap_landmarks.localization.verification import UNMATCHED, Candidates, Constellations, Prior

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# An object so many of its standard deviations from where an unmapped one was observed is that one again: 99 % of
# Gaussian errors in the plane are within three.
_AGAIN_SIGMAS = 3.0
# Wheels slip now and then: so many times larger sigmas of odometry are tried, at this price (as logarithm) each time,
# which is that of one slip in e^5 = 150 bundles.
_SLIPS = (1.0, 5.0, 25.0)
_SLIP_PRICE = 5.0
# Landmarks near an object that it may be.
_NEAR = 12
# Other associations of a bundle live on while their likelihood against the best (as logarithm) is above e^-7, one in a
# thousand: half the odds that an accepted match may have against it (`accidental`).
_DOUBT = -7.0
_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


@dataclass(frozen=True, slots=True, eq=False)
class _Association:
    """One way to associate a bundle: landmarks (K,), the pose (3,) that fits, the covariance before, its likelihood."""

    landmarks: Ints
    pose: Array
    covariance: Array
    log_likelihood: float


@dataclass(frozen=True, slots=True, eq=False)
class TrackHypothesis:
    """A pose map_from_base (3,), its covariance (3, 3) in the base frame, and the logarithm of its weight.

    A Kalman filter on SE(2) whose error is a right perturbation, a small motion in the base frame (Sola et al. 2018):
    so prediction needs no pose, and odometry's errors, which are the base's own, add as they are. `by_motion` (3, 3) is
    the part of the covariance that odometry added since the last bundle.
    """

    matcher: Matcher
    pose: Array
    covariance: Array
    evidence: Evidence
    by_motion: Array
    log_weight: float = 0.0

    def predicted(self, step: Array, step_covariance: Array, way_m: float) -> "TrackHypothesis":
        """After the base moved by `step` (3,) over a way, known up to a covariance (3, 3) in the frame it left.

        The error is carried by the adjoint of the step's inverse.
        """
        back, jacobian = np.eye(3), np.eye(3)
        back[:2, :2] = se2.rotation(-step[2])
        jacobian[:2, 2] = _TURN @ step[:2]
        carry = back @ jacobian
        added = back @ step_covariance @ back.T
        return replace(
            self,
            pose=se2.compose(self.pose, step),
            covariance=carry @ self.covariance @ carry.T + added,
            evidence=self.evidence.after(way_m),
            by_motion=carry @ self.by_motion @ carry.T + added,
        )

    def updated(self, objects: Objects) -> list[tuple["TrackHypothesis", Fix]]:
        """After a bundle, in each way in which it may have to be associated, likeliest first, with how it fits."""
        covariance = block_diagonal(objects.covariances[None])
        sets = self.matcher.sets(
            objects.points_xy[None], covariance, objects.probabilities[None], objects.spurious[None]
        )
        return [self._after(sets, objects, association) for association in self._associations(sets, objects)]

    def _associations(self, sets: Constellations, objects: Objects) -> list[_Association]:
        """Ways to match objects near where they should be; if some are not there, perhaps after a slip."""
        found: dict[tuple[int, ...], _Association] = {}
        for i, slip in enumerate(_SLIPS):
            covariance = self.covariance + (slip**2 - 1) * self.by_motion
            information = np.linalg.inv(covariance)
            starts = self._starts(sets, objects, covariance)
            prior = Prior(np.tile(self.pose, (len(starts.of), 1)), np.tile(information, (len(starts.of), 1, 1)))
            matched = self.matcher.verifier.match(sets, starts, prior).candidates
            for landmarks, pose in zip(matched.landmarks, matched.pose, strict=True):
                key = tuple(landmarks.tolist())
                log_likelihood = self._log_likelihood(landmarks, sets, objects, covariance) - i * _SLIP_PRICE
                if key not in found or log_likelihood > found[key].log_likelihood:
                    found[key] = _Association(landmarks, pose, covariance, log_likelihood)
            if any(UNMATCHED not in key for key in found):
                break
        best = sorted(found.values(), key=lambda one: -one.log_likelihood)
        return [one for one in best if one.log_likelihood > best[0].log_likelihood + _DOUBT]

    def _starts(self, sets: Constellations, objects: Objects, covariance: Array) -> Candidates:
        """Nothing matched, and each object that may be one of several landmarks within its gate as each of these."""
        index, spread = self.matcher.index, self.matcher.verifier.spread
        seen = se2.transform_points(self.pose, objects.points_xy)
        near = np.asarray(index.places.query(seen, k=np.arange(1, min(_NEAR, len(index)) + 1))[1], dtype=np.int64)
        expected = se2.transform_points(se2.inverse(self.pose), index.positions_xy[near])
        jacobian = _jacobian(expected)
        back = se2.rotation(-self.pose[2])
        wide = jacobian @ covariance @ jacobian.swapaxes(-1, -2) + objects.covariances[:, None]
        wide += back @ spread[near] @ back.T
        miss = (expected - objects.points_xy[:, None])[..., None]
        chi2 = (miss.swapaxes(-1, -2) @ np.linalg.solve(wide, miss))[..., 0, 0]
        likely = np.take_along_axis(sets.log_ratio[0], index.class_of[near], axis=1) > 0
        possible = (chi2 < self.matcher.verifier.gate) & likely
        possible &= (possible.sum(axis=1) > 1)[:, None]
        row, place = np.nonzero(possible)
        landmarks = np.full((1 + len(row), len(near)), UNMATCHED, dtype=np.int64)
        landmarks[1 + np.arange(len(row)), row] = near[row, place]
        return Candidates(np.zeros(len(landmarks), dtype=np.int64), np.tile(self.pose, (len(landmarks), 1)), landmarks)

    def _log_likelihood(self, landmarks: Ints, sets: Constellations, objects: Objects, covariance: Array) -> float:
        """Logarithm of how likely an association is, against an unknown place."""
        spurious = objects.spurious
        used = landmarks != UNMATCHED
        rows = np.flatnonzero(used)
        total = float(sets.log_ratio[0, rows, self.matcher.index.class_of[landmarks[rows]]].sum())
        astray = np.log(spurious) + sets.log_ratio[0].max(axis=1)  # a mapped one, measured quite wrong
        total += float(np.where(used, np.log1p(-spurious) - sets.log_density[0], astray).sum())
        return total - self._innovation(landmarks, self._inflated(objects, landmarks), used, covariance)[0]

    def _inflated(self, objects: Objects, landmarks: Ints) -> Objects:
        """The objects with the errors of each observation of the same landmark taken for the same.

        The n-th of them then adds an n-th of what the first did, so that looking longer helps only so far.
        """
        factor = self.evidence.effective_of(landmarks)
        return replace(objects, covariances=objects.covariances * factor[:, None, None])

    def _after(
        self, sets: Constellations, objects: Objects, association: _Association
    ) -> tuple["TrackHypothesis", Fix]:
        landmarks = association.landmarks
        used = landmarks != UNMATCHED
        chi2 = self._innovation(landmarks, objects, used, association.covariance)[1]
        evidence = self._evidence(sets, objects, association)
        inflated = block_diagonal(self._inflated(objects, landmarks).covariances[None])
        start = Candidates(np.zeros(1, dtype=np.int64), association.pose[None], landmarks[None])
        prior = Prior(self.pose[None], np.linalg.inv(association.covariance)[None].astype(np.float64))
        solved = self.matcher.verifier.solve(replace(sets, covariance=inflated), start, prior)
        pose, covariance = solved.candidates.pose[0], solved.covariance[0]
        weight = self.log_weight + association.log_likelihood
        fix = Fix(pose, covariance, landmarks, evidence.odds_against, chi2, 2 * int(used.sum()))
        return TrackHypothesis(self.matcher, pose, covariance, evidence, np.zeros((3, 3)), weight), fix

    def _evidence(self, sets: Constellations, objects: Objects, association: _Association) -> Evidence:
        """The evidence after a bundle; what is new in it speaks for the place or against it."""
        landmarks, points = association.landmarks, objects.points_xy
        used = landmarks != UNMATCHED
        variance = np.trace(objects.covariances, axis1=1, axis2=2) + np.trace(association.covariance[:2, :2])
        variance += (points**2).sum(axis=1) * association.covariance[2, 2]
        places = se2.transform_points(association.pose, points)
        places[used] = self.matcher.index.positions_xy[landmarks[used]]
        again = self.evidence.associate(landmarks, places, _AGAIN_SIGMAS * np.sqrt(variance))
        gain = np.where(used, 0.0, np.log(objects.spurious))
        new = np.flatnonzero(used & (again < 0))
        if len(new):
            before = self._innovation(landmarks, objects, used & (again >= 0), association.covariance)[0]
            likely = before - self._innovation(landmarks, objects, used, association.covariance)[0]
            gain[new] = likely / len(new) + np.log1p(-objects.spurious[new]) - self._expected_at(places[new])
            gain[new] += sets.log_ratio[0, new, self.matcher.index.class_of[landmarks[new]]]
        return self.evidence.updated(again, landmarks, places, gain)

    def _expected_at(self, places: Array) -> Array:
        """Logarithm of the density (K,) that an unknown place would have at new places (K, 2), beside what is known."""
        known = np.concatenate([self.evidence.places_xy, places])
        apart = np.linalg.norm(places[:, None] - known, axis=-1)
        own = np.arange(len(places))
        apart[own, len(known) - len(places) + own] = np.inf
        density: Array = self.matcher.density.at(apart).max(axis=1)
        return density

    def _innovation(self, landmarks: Ints, objects: Objects, chosen: Bools, covariance: Array) -> tuple[float, float]:
        """Minus the log density of the innovation of chosen objects, given what was known before; its chi-square."""
        rows = np.flatnonzero(chosen)
        if not len(rows):
            return 0.0, 0.0
        verifier = self.matcher.verifier
        expected = se2.transform_points(se2.inverse(self.pose), verifier.index.positions_xy[landmarks[rows]])
        miss = (expected - objects.points_xy[rows]).ravel()
        jacobian = _jacobian(expected).reshape(-1, 3)
        back = se2.rotation(-self.pose[2])
        own = objects.covariances[rows] + back @ verifier.spread[landmarks[rows]] @ back.T
        spread = jacobian @ covariance @ jacobian.T + block_diagonal(own[None])[0]
        chi2 = float(miss @ np.linalg.solve(spread, miss))
        return (chi2 + float(np.linalg.slogdet(2 * np.pi * spread)[1])) / 2, chi2


def _jacobian(expected: Array) -> Array:
    """Derivatives (..., 2, 3) of minus the expected places (..., 2), by a small motion in the base frame."""
    out = np.zeros((*expected.shape, 3))
    out[..., 0, 0] = out[..., 1, 1] = 1.0
    out[..., 2] = expected @ _TURN.T
    return out
