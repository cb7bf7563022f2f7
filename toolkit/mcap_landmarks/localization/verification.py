"""Do objects fit the map at a pose? Association, generalised least squares and chi-square, many poses at once.

Poses are estimated by Gauss-Newton on SE(2) with a right perturbation, a small motion in the base frame (Sola et al.
2018): there the objects' covariance is the same for every pose. Objects are gated by their squared Mahalanobis distance
(Bar-Shalom and Fortmann 1988), and outliers dropped by data snooping (Baarda 1968).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry import se2
from mcap_landmarks.localization.acceptance import log_tail
from mcap_landmarks.localization.index import MapIndex

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

UNMATCHED = -1
# Landmarks looked at around the place where an object is expected: seldom do more fit within the gate.
_NEAR = 3
# Turns in one step of least squares stay below this, where the linear model still holds (sine against angle: 1.5 %).
_STEP_RAD = 0.3
# Gauss-Newton steps: starts are closed-form fits or predictions, from where it converges quadratically.
_STEPS = 2
# An outlier is dropped of more objects than these: of three, any two would do without the third.
_TESTABLE = 3
_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


@dataclass(frozen=True, slots=True, eq=False)
class Constellations:
    """B sets of K objects each, as seen in their base frame.

    points_xy (B, K, 2) m with the joint covariance (B, 2K, 2K) m^2 of all their coordinates, log_ratio (B, K, C) of
    their class evidence, log_density (B, K) of landmarks expected there at an unknown place, spurious (B, K) the
    probability that each is not in the map.
    """

    points_xy: Array
    covariance: Array
    log_ratio: Array
    log_density: Array
    spurious: Array

    def __len__(self) -> int:
        return len(self.points_xy)


class Candidates(NamedTuple):
    """M poses to try: of which set, the pose map_from_base (M, 3), and landmark per object (M, K) or `UNMATCHED`."""

    of: Ints
    pose: Array
    landmarks: Ints

    def pick(self, rows: Bools | Ints) -> "Candidates":
        """Some of them."""
        return Candidates(self.of[rows], self.pose[rows], self.landmarks[rows])


class Prior(NamedTuple):
    """What is known of M poses before: map_from_base (M, 3), information (M, 3, 3) about a motion in the base frame."""

    pose: Array
    information: Array

    @classmethod
    def none(cls, pose: Array) -> "Prior":
        """Nothing."""
        return cls(pose, np.zeros((len(pose), 3, 3)))


class Fits(NamedTuple):
    """How M candidates fit: pose (M, 3) with covariance (M, 3, 3) in the base frame, chi-square and its degrees (M,).

    log_ratio (M,) is the logarithm of the likelihood ratio against an unknown place, log_accidental (M,) that of the
    expected number of accidental matches that are as good.
    """

    candidates: Candidates
    covariance: Array
    chi2: Array
    dof: Ints
    log_ratio: Array
    log_accidental: Array

    def pick(self, rows: Bools | Ints) -> "Fits":
        """Some of them."""
        return Fits(
            self.candidates.pick(rows),
            self.covariance[rows],
            self.chi2[rows],
            self.dof[rows],
            self.log_ratio[rows],
            self.log_accidental[rows],
        )


class Solved(NamedTuple):
    """Least squares of M candidates, in the base frame."""

    candidates: Candidates
    prior: Prior
    used: Bools
    residual: Array
    jacobian: Array
    weight: Array
    covariance: Array
    log_det: Array

    def put(self, rows: Ints, other: "Solved") -> None:
        """Write another solution of some rows into this one."""
        for whole, part in zip(_arrays(self), _arrays(other), strict=True):
            whole[rows] = part

    def weighted_residuals(self) -> Array:
        """Residuals (M, 2K) at the least-squares solution, times their weights: what data snooping tests."""
        moved = (self.weight @ self.residual[..., None])[..., 0]
        pull = self.jacobian.swapaxes(1, 2) @ moved[..., None]
        pull += self.prior.information @ se2.between(self.candidates.pose, self.prior.pose)[..., None]
        moved -= (self.weight @ (self.jacobian @ (self.covariance @ pull)))[..., 0]
        return moved


@dataclass(frozen=True, slots=True)
class Verifier:
    """Fits candidates to a map whose landmarks have covariances `spread` (N, 2, 2), none of them unknown.

    An object matches a landmark if its squared Mahalanobis distance is below `gate`, and the evidence gains by it.
    """

    index: MapIndex
    spread: Array
    gate: float

    def fit(self, sets: Constellations, candidates: Candidates) -> Fits:
        """Match whatever of each set fits at the pose, drop what does not, and fit the pose to what is matched."""
        return self._score(sets, self.match(sets, candidates, Prior.none(candidates.pose)))

    def match(self, sets: Constellations, candidates: Candidates, prior: Prior) -> Solved:
        """Match and fit, starting from what the candidates match already and from what is known of the pose."""
        solved = self.solve(sets, candidates, prior)
        for change in (self._with_more, self._without_worst):
            for _ in range(sets.points_xy.shape[1]):
                landmarks = change(sets, solved)
                rows = np.flatnonzero((landmarks != solved.candidates.landmarks).any(axis=1))
                if not len(rows):
                    break
                changed = solved.candidates._replace(landmarks=landmarks).pick(rows)
                solved.put(rows, self.solve(sets, changed, Prior(*(a[rows] for a in prior))))
        return solved

    def solve(self, sets: Constellations, candidates: Candidates, prior: Prior) -> Solved:
        """The poses that least squares gives the candidates, none of which is matched anew."""
        of, pose, landmarks = candidates
        count, k = landmarks.shape
        used = landmarks != UNMATCHED
        back = se2.rotation(-pose[:, 2])[:, None]
        own = back @ self.spread[landmarks] @ back.swapaxes(-1, -2)
        spread = sets.covariance[of]
        for i in range(k):
            spread[:, 2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += own[:, i]
        both = np.repeat(used, 2, axis=1)
        spread = np.where(both[:, :, None] & both[:, None, :], spread, np.eye(2 * k))
        weight: Array = np.linalg.inv(spread).astype(np.float64)
        points, places = sets.points_xy[of], self.index.positions_xy[landmarks]
        for step in range(_STEPS + 1):
            expected = se2.transform_points(se2.inverse(pose)[:, None], places)
            residual = np.where(used[..., None], expected - points, 0.0).reshape(count, 2 * k)
            jacobian = _jacobian(expected) * both[..., None]
            pulled = jacobian.swapaxes(1, 2) @ weight
            covariance = np.linalg.inv(pulled @ jacobian + prior.information)
            if step < _STEPS:
                right = pulled @ residual[..., None] + prior.information @ se2.between(pose, prior.pose)[..., None]
                move = (covariance @ right)[..., 0]
                pose = se2.compose(pose, move / np.maximum(np.abs(move[:, 2:]) / _STEP_RAD, 1.0))
        log_det = np.linalg.slogdet(spread)[1]
        fitted = Candidates(of.copy(), pose, landmarks.copy())
        return Solved(fitted, prior, used, residual, jacobian, weight, covariance, log_det)

    def _with_more(self, sets: Constellations, solved: Solved) -> Ints:
        """Landmarks (M, K) of each object, with those added that fit where the matched ones say they should be."""
        (of, pose, landmarks), used = solved.candidates, solved.used
        rows = np.flatnonzero(~used.all(axis=1))
        if not len(rows):
            return landmarks
        expected, spread = self._predict(sets, solved, rows)
        pose, of = pose[rows], of[rows]
        near = self._near(se2.transform_points(pose[:, None], expected))
        miss = se2.transform_points(se2.inverse(pose)[:, None, None], self.index.positions_xy[near])
        miss -= expected[:, :, None]
        back = se2.rotation(-pose[:, 2])[:, None, None]
        spread = spread[:, :, None] + back @ self.spread[near] @ back.swapaxes(-1, -2)
        chi2 = (miss[..., None, :] @ np.linalg.solve(spread, miss[..., None]))[..., 0, 0]
        gain = -chi2 / 2 - np.linalg.slogdet(spread)[1] / 2 - np.log(2 * np.pi)
        gain += np.take_along_axis(sets.log_ratio[of], self.index.class_of[near], axis=2)
        gain += (np.log((1 - sets.spurious) / sets.spurious) - sets.log_density)[of][..., None]
        taken = (near[..., None] == landmarks[rows][:, None, None, :]).any(axis=-1)
        gain = np.where((chi2 > self.gate) | taken | used[rows][..., None], -np.inf, gain)
        result = landmarks.copy()
        result[rows] = _add(landmarks[rows], near, gain)
        return result

    def _predict(self, sets: Constellations, solved: Solved, rows: Ints) -> tuple[Array, Array]:
        """Where each object should be in the base frame (R, K, 2), given the matched ones; how surely (R, K, 2, 2)."""
        covariance = sets.covariance[solved.candidates.of[rows]]
        count, k = len(rows), covariance.shape[1] // 2
        both = np.repeat(solved.used[rows], 2, axis=1)
        shared = np.where(both[:, None, :], covariance, 0.0)
        pull = shared @ solved.weight[rows]
        shift = (pull @ solved.residual[rows][..., None])[..., 0].reshape(count, k, 2)
        expected = sets.points_xy[solved.candidates.of[rows]] + shift
        by_pose = _jacobian(expected) - pull @ solved.jacobian[rows]
        spread = covariance - pull @ shared.swapaxes(1, 2)
        spread += by_pose @ solved.covariance[rows] @ by_pose.swapaxes(1, 2)
        return expected, blocks(spread)

    def _near(self, places: Array) -> Ints:
        """Nearest landmarks (..., H) of places (..., 2)."""
        count = min(_NEAR, len(self.index))
        return np.asarray(self.index.places.query(places, k=np.arange(1, count + 1))[1], dtype=np.int64)

    def _without_worst(self, _sets: Constellations, solved: Solved) -> Ints:
        """Landmarks (M, K) without the object that the others of its candidate, or what was known, least agree with.

        Baarda's test of one outlier at a time, with two coordinates each: weighted residuals over their own covariance.
        """
        weight, used = solved.weight, solved.used
        pulled = weight @ solved.jacobian
        left = blocks(weight - pulled @ solved.covariance @ pulled.swapaxes(1, 2))
        weighted = solved.weighted_residuals().reshape(*used.shape, 2)
        known = solved.prior.information.any(axis=(1, 2))
        testable = used & ((used.sum(axis=1) > _TESTABLE) | known)[:, None]
        left = np.where(testable[..., None, None], left, np.eye(2))
        apart = (weighted[..., None, :] @ np.linalg.solve(left, weighted[..., None]))[..., 0, 0]
        apart = np.where(testable, apart, 0.0)
        worst = apart.argmax(axis=1)
        landmarks = solved.candidates.landmarks.copy()
        rows = np.flatnonzero(apart.max(axis=1) > self.gate)
        landmarks[rows, worst[rows]] = UNMATCHED
        return landmarks

    def _score(self, sets: Constellations, solved: Solved) -> Fits:
        """The evidence for candidates: the likelihood integrated over the pose, by Laplace's method (MacKay 1992)."""
        (of, _, landmarks), used = solved.candidates, solved.used
        matched = used.sum(axis=1)
        chi2 = (solved.residual * solved.weighted_residuals()).sum(axis=1)
        dof = np.maximum(2 * matched - 3, 0)
        peak = (1.5 - matched) * np.log(2 * np.pi) - solved.log_det / 2
        peak += np.linalg.slogdet(solved.covariance)[1] / 2
        density = sets.log_density[of]
        lowest = np.where(used, density, np.inf).min(axis=1)
        unknown = np.log(2 * np.pi * len(self.index)) + np.where(used, density, 0.0).sum(axis=1) - lowest
        ratio = np.take_along_axis(sets.log_ratio[of], self.index.class_of[landmarks][..., None], axis=2)[..., 0]
        spurious = sets.spurious[of]
        evidence = np.where(used, ratio + np.log1p(-spurious), np.log(spurious)).sum(axis=1)
        best = peak - unknown + evidence
        return Fits(solved.candidates, solved.covariance, chi2, dof, best - chi2 / 2, log_tail(chi2, dof) - best)


def blocks(matrix: Array) -> Array:
    """The 2x2 blocks (M, K, 2, 2) on the diagonal of matrices (M, 2K, 2K)."""
    count, width = matrix.shape[:2]
    place = np.arange(width // 2)
    return matrix.reshape(count, width // 2, 2, width // 2, 2)[:, place, :, place].transpose(1, 0, 2, 3)


def _arrays(solved: Solved) -> tuple[Array | Ints | Bools, ...]:
    return (*solved.candidates, *solved.prior, *solved[2:])


def _jacobian(expected: Array) -> Array:
    """Derivatives (M, 2K, 3) of minus the expected places (M, K, 2), by a small motion in the base frame."""
    count, k = expected.shape[:2]
    out = np.empty((count, k, 2, 3))
    out[..., :2] = np.eye(2)
    out[..., 2] = expected @ _TURN.T
    return out.reshape(count, 2 * k, 3)


def _add(landmarks: Ints, near: Ints, gain: Array) -> Ints:
    """Matches (R, K) with those added that gain: all that have no rival, else the one that gains most."""
    rows = np.arange(len(gain))
    best = gain.argmax(axis=2)
    top = np.take_along_axis(gain, best[..., None], axis=2)[..., 0]
    choice = np.take_along_axis(near, best[..., None], axis=2)[..., 0]
    alone = (gain > 0).sum(axis=2) == 1
    first = top.argmax(axis=1)
    alone[rows, first] |= ~alone.any(axis=1) & (top[rows, first] > 0)
    # Of objects that want the same landmark the one that gains most gets it.
    rival = (choice[:, :, None] == choice[:, None, :]) & alone[:, None, :]
    loses = (rival & (top[:, None, :] > top[:, :, None])).any(axis=2)
    return np.where(alone & ~loses, choice, landmarks)
