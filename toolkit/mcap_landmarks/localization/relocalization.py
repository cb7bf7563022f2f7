"""Search the whole map for what a robot has observed lately, and keep the places that it may be at."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry import se2
from mcap_landmarks.localization.local_map import LocalMap
from mcap_landmarks.localization.match import Places
from mcap_landmarks.localization.matching import Matcher, is_same_place
from mcap_landmarks.localization.verification import UNMATCHED, Candidates, Constellations

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Besides everything, only what was observed over these shares of the length is tried: where odometry fails, what lies
# before misleads. Halves, since by how much is unknown.
_SHARES = (1.0, 1 / 2, 1 / 4, 1 / 8, 1 / 16, 0.0)
# Guesses that are kept: as many as there are places of one search (`matching._PLACES`).
_KEPT = 32


@dataclass(frozen=True, slots=True, eq=False)
class _Guess:
    """A place the robot may be at: its pose (3,) now, and the landmark that each object by number is taken for."""

    pose: Array
    landmark_of: dict[int, int]


class Relocalizer:
    """Looks for a robot by the map around it, over all of `length_m` or the latest part of it."""

    def __init__(self, matcher: Matcher, length_m: float) -> None:
        self._matcher, self._length_m = matcher, length_m
        self._guesses: list[_Guess] = []

    def predict(self, step: Array) -> None:
        """The base moves by `step` (3,)."""
        self._guesses = [_Guess(se2.compose(guess.pose, step), guess.landmark_of) for guess in self._guesses]

    def search(self, local_map: LocalMap, fresh: Bools) -> tuple[Places, Ints] | None:
        """The places where the local map fits best, and the rows of what of it was matched.

        Only groups with one of the `fresh` objects (N,) are looked up; what was found before is kept and checked again.
        """
        windows = self._windows(local_map)
        pool = self._guesses + (self._started(local_map, fresh) if windows and fresh.any() else [])
        best: tuple[Places, Ints] | None = None
        found: list[tuple[float, _Guess]] = []
        for rows in windows:
            places = self._places(local_map, pool, rows, len(windows))
            if places is None:
                continue
            found += zip(places.fits.log_ratio.tolist(), _guesses(local_map, rows, places.fits.candidates), strict=True)
            if best is None or places.expected_accidental < best[0].expected_accidental:
                best = places, rows
        self._guesses = _distinct(found)
        return best

    def _windows(self, local_map: LocalMap) -> list[Ints]:
        """Rows of what was observed over each share of the length and of what was observed again, two objects at least.

        That there are several is paid for: as many tests as windows are tried (`Matcher.places`).
        """
        windows: list[Ints] = []
        for share in _SHARES:
            rows = np.flatnonzero(local_map.age_m <= share * self._length_m)
            if len(rows) > 1 and (not windows or len(rows) < len(windows[-1])):
                windows.append(rows)
        again = np.flatnonzero(local_map.observations > 1)
        if len(again) > 1 and not any(np.array_equal(again, rows) for rows in windows):
            windows.append(again)
        return windows

    def _started(self, local_map: LocalMap, fresh: Bools) -> list[_Guess]:
        rows = np.arange(len(local_map))
        return _guesses(local_map, rows, self._matcher.candidates(self._set(local_map, rows), fresh[None]))

    def _set(self, local_map: LocalMap, rows: Ints) -> Constellations:
        both = np.stack([2 * rows, 2 * rows + 1], axis=1).ravel()
        covariance = local_map.covariance[both][:, both]
        points, probabilities = local_map.points_xy[rows], local_map.probabilities[rows]
        return self._matcher.sets(points[None], covariance[None], probabilities[None], local_map.spurious[rows][None])

    def _places(self, local_map: LocalMap, pool: list[_Guess], rows: Ints, tests: int) -> Places | None:
        numbers = local_map.numbers[rows].tolist()
        matched = [[guess.landmark_of.get(number, UNMATCHED) for number in numbers] for guess in pool]
        landmarks = np.array(matched, dtype=np.int64).reshape(len(pool), len(rows))
        usable = np.flatnonzero((landmarks != UNMATCHED).sum(axis=1) > 1)
        if not len(usable):
            return None
        pose = np.array([pool[i].pose for i in usable])
        candidates = Candidates(np.zeros(len(usable), dtype=np.int64), pose, landmarks[usable])
        return self._matcher.places(self._set(local_map, rows), candidates, tests)[0]


def _guesses(local_map: LocalMap, rows: Ints, candidates: Candidates) -> list[_Guess]:
    numbers = local_map.numbers[rows].tolist()
    return [
        _Guess(pose, {n: int(landmark) for n, landmark in zip(numbers, row, strict=True) if landmark != UNMATCHED})
        for pose, row in zip(candidates.pose, candidates.landmarks, strict=True)
    ]


def _distinct(found: list[tuple[float, _Guess]]) -> list[_Guess]:
    """The likeliest guesses, those of one place as one with all that any of them matched."""
    kept: list[_Guess] = []
    for _, guess in sorted(found, key=lambda one: -one[0]):
        same = np.flatnonzero(is_same_place(guess.pose, np.array([other.pose for other in kept]).reshape(-1, 3)))
        if len(same):
            known = kept[same[0]].landmark_of
            taken = set(known.values())
            known.update({n: m for n, m in guess.landmark_of.items() if n not in known and m not in taken})
        elif len(kept) < _KEPT:
            kept.append(_Guess(guess.pose, dict(guess.landmark_of)))
    return kept
