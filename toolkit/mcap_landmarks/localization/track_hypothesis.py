"""One opinion of where a followed robot is: pose, covariance, what it saw on the way, and how likely all that is."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry import se2
from mcap_landmarks.localization.evidence import Memory
from mcap_landmarks.localization.match import Fix
from mcap_landmarks.localization.matching import Matcher, Objects, block_diagonal
from mcap_landmarks.localization.verification import UNMATCHED, Candidates, Constellations, Prior

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# An object this many of its standard deviations from where something was seen before is that again.
_AGAIN_SIGMAS = 3.0
# Wheels slip now and then: so many times larger sigmas are tried, at this price (as logarithm) each time.
_SLIPS = (1.0, 5.0, 25.0)
_SLIP_PRICE = 5.0
# Landmarks among which an object is looked for.
_NEAR = 12
# Other ways to match a bundle live on while they are likelier than this against the best (as logarithm).
_DOUBT = -7.0
_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


@dataclass(frozen=True, slots=True, eq=False)
class _Reading:
    """One way to match a bundle: landmarks (K,), the pose (3,) that fits, the covariance before, and how likely."""

    landmarks: Ints
    pose: Array
    covariance: Array
    log_likely: float


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A pose map_from_base (3,), its covariance (3, 3) in the base frame, and the logarithm of its weight.

    `by_motion` (3, 3) is the part of the covariance that odometry added since the last bundle.
    """

    matcher: Matcher
    pose: Array
    covariance: Array
    memory: Memory
    by_motion: Array
    log_weight: float = 0.0

    def moved(self, step: Array, step_covariance: Array, way_m: float) -> "Hypothesis":
        """After the base moved by `step` (3,) over a way, known up to a covariance (3, 3) in the frame it left."""
        back, jacobian = np.eye(3), np.eye(3)
        back[:2, :2] = se2.rotation(-step[2])
        jacobian[:2, 2] = _TURN @ step[:2]
        carry = back @ jacobian
        added = back @ step_covariance @ back.T
        return replace(
            self,
            pose=se2.compose(self.pose, step),
            covariance=carry @ self.covariance @ carry.T + added,
            memory=self.memory.after(way_m),
            by_motion=carry @ self.by_motion @ carry.T + added,
        )

    def saw(self, objects: Objects) -> list[tuple["Hypothesis", Fix]]:
        """After a bundle, in each way in which it may have to be read, likeliest first, with how it fits."""
        covariance = block_diagonal(objects.covariances[None])
        sets = self.matcher.sets(
            objects.points_xy[None], covariance, objects.probabilities[None], objects.spurious[None]
        )
        readings = self._readings(sets, objects)
        return [self._after(sets, objects, reading) for reading in readings]

    def _readings(self, sets: Constellations, objects: Objects) -> list[_Reading]:
        """Ways to match objects near where they should be; if some are not there, perhaps after a slip."""
        readings: dict[tuple[int, ...], _Reading] = {}
        for i, slip in enumerate(_SLIPS):
            covariance = self.covariance + (slip**2 - 1) * self.by_motion
            information = np.linalg.inv(covariance)
            starts = self._starts(sets, objects, covariance)
            prior = Prior(np.tile(self.pose, (len(starts.of), 1)), np.tile(information, (len(starts.of), 1, 1)))
            found = self.matcher.verifier.match(sets, starts, prior).candidates
            for landmarks, pose in zip(found.landmarks, found.pose, strict=True):
                key = tuple(landmarks.tolist())
                likely = self._likely(landmarks, sets, objects, covariance) - i * _SLIP_PRICE
                if key not in readings or likely > readings[key].log_likely:
                    readings[key] = _Reading(landmarks, pose, covariance, likely)
            if any(UNMATCHED not in key for key in readings):
                break
        best = sorted(readings.values(), key=lambda reading: -reading.log_likely)
        return [reading for reading in best if reading.log_likely > best[0].log_likely + _DOUBT]

    def _starts(self, sets: Constellations, objects: Objects, covariance: Array) -> Candidates:
        """Nothing matched, and each object that may be one of several landmarks as each of these."""
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

    def _likely(self, landmarks: Ints, sets: Constellations, objects: Objects, covariance: Array) -> float:
        """Logarithm of how likely a reading is; landmarks seen again count as often as they were seen apart."""
        spurious = objects.spurious
        used = landmarks != UNMATCHED
        rows = np.flatnonzero(used)
        likely = float(sets.log_ratio[0, rows, self.matcher.index.class_of[landmarks[rows]]].sum())
        astray = np.log(spurious) + sets.log_ratio[0].max(axis=1)  # a mapped one, measured quite wrong
        likely += float(np.where(used, np.log1p(-spurious) - sets.log_density[0], astray).sum())
        return likely - self._surprise(landmarks, self._worn(objects, landmarks), used, covariance)[0]

    def _worn(self, objects: Objects, landmarks: Ints) -> Objects:
        """The objects with the errors of each sighting of the same landmark taken for the same."""
        tired = self.memory.sightings_of(landmarks)
        return replace(objects, covariances=objects.covariances * tired[:, None, None])

    def _after(self, sets: Constellations, objects: Objects, reading: _Reading) -> tuple["Hypothesis", Fix]:
        landmarks = reading.landmarks
        used = landmarks != UNMATCHED
        chi2 = self._surprise(landmarks, objects, used, reading.covariance)[1]
        memory = self._learned(sets, objects, reading)
        worn = block_diagonal(self._worn(objects, landmarks).covariances[None])
        start = Candidates(np.zeros(1, dtype=np.int64), reading.pose[None], landmarks[None])
        prior = Prior(self.pose[None], np.linalg.inv(reading.covariance)[None].astype(np.float64))
        solved = self.matcher.verifier.solve(replace(sets, covariance=worn), start, prior)
        pose, covariance = solved.candidates.pose[0], solved.covariance[0]
        weight = self.log_weight + reading.log_likely
        fix = Fix(pose, covariance, landmarks, memory.odds_against, chi2, 2 * int(used.sum()))
        return Hypothesis(self.matcher, pose, covariance, memory, np.zeros((3, 3)), weight), fix

    def _learned(self, sets: Constellations, objects: Objects, reading: _Reading) -> Memory:
        """What is remembered after a bundle; what is new in it speaks for the place or against it."""
        landmarks, points = reading.landmarks, objects.points_xy
        used = landmarks != UNMATCHED
        variance = np.trace(objects.covariances, axis1=1, axis2=2) + np.trace(reading.covariance[:2, :2])
        variance += (points**2).sum(axis=1) * reading.covariance[2, 2]
        places = se2.transform_points(reading.pose, points)
        places[used] = self.matcher.index.positions_xy[landmarks[used]]
        again = self.memory.recall(landmarks, places, _AGAIN_SIGMAS * np.sqrt(variance))
        gain = np.where(used, 0.0, np.log(objects.spurious))
        new = np.flatnonzero(used & (again < 0))
        if len(new):
            before = self._surprise(landmarks, objects, used & (again >= 0), reading.covariance)[0]
            likely = before - self._surprise(landmarks, objects, used, reading.covariance)[0]
            gain[new] = likely / len(new) + np.log1p(-objects.spurious[new]) - self._expected_at(places[new])
            gain[new] += sets.log_ratio[0, new, self.matcher.index.class_of[landmarks[new]]]
        return self.memory.with_more(again, landmarks, places, gain)

    def _expected_at(self, places: Array) -> Array:
        """Logarithm of the density (K,) that an unknown place would have at new places (K, 2), beside what is known."""
        known = np.concatenate([self.memory.places_xy, places])
        apart = np.linalg.norm(places[:, None] - known, axis=-1)
        own = np.arange(len(places))
        apart[own, len(known) - len(places) + own] = np.inf
        density: Array = self.matcher.density.at(apart).max(axis=1)
        return density

    def _surprise(self, landmarks: Ints, objects: Objects, chosen: Bools, covariance: Array) -> tuple[float, float]:
        """Minus the log density of what was seen of chosen objects, given all that was known before; its chi-square."""
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
