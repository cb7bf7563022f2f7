"""What a tracked robot has observed of the map and beside it, and what each of these said about where it is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.localization.verification import UNMATCHED

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# After so much of the way an object 6 m away is seen from 18 degrees elsewhere: until then the errors of its
# observations are taken for the same, and an object that is one is observed again.
_SAME_VIEW_M = 2.0
_LOG_MOST = 700.0  # exp of more than 709 overflows


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Landmarks and unmapped objects observed over the last `length_m`, and what they say about the place.

    The sum of logarithms of likelihood ratios, as in Wald's sequential test (1945): `gain` (N,) is that of each object,
    counted once, since what it says again is no news. places_xy (N, 2) in the map, landmarks (N,) or `UNMATCHED`,
    observations (N,) of each, effective (N,) how many of them err like the next one, unseen_m (N,) the way since the
    last one.
    """

    length_m: float
    places_xy: Array
    landmarks: Ints
    gain: Array
    effective: Array
    observations: Ints
    unseen_m: Array

    @classmethod
    def of(cls, length_m: float, places_xy: Array, landmarks: Ints, expected_accidental: float) -> "Evidence":
        """Of a place that was just accepted: its landmarks share what spoke for it."""
        count, used = len(landmarks), landmarks != UNMATCHED
        share = -np.log(max(expected_accidental, 1e-300)) / max(int(used.sum()), 1)
        twice = np.full(count, 2)  # what was matched together is no stray
        return cls(length_m, places_xy, landmarks, np.where(used, share, 0.0), np.ones(count), twice, np.zeros(count))

    @property
    def odds_against(self) -> float:
        """Odds that the place is wrong."""
        return float(np.exp(-np.clip(self.gain.sum(), -_LOG_MOST, _LOG_MOST)))

    def after(self, way_m: float) -> "Evidence":
        """What is left after some way: a stray, which was observed once and matches nothing, goes sooner."""
        unseen_m = self.unseen_m + way_m
        stray = (self.landmarks == UNMATCHED) & (self.observations < 2)
        keep = unseen_m < np.where(stray, _SAME_VIEW_M, self.length_m)
        effective = self.effective * np.exp(-way_m / _SAME_VIEW_M)
        return Evidence(
            self.length_m,
            self.places_xy[keep],
            self.landmarks[keep],
            self.gain[keep],
            effective[keep],
            self.observations[keep],
            unseen_m[keep],
        )

    def associate(self, landmarks: Ints, places_xy: Array, reach_m: Array) -> Ints:
        """Which of what is known each of K objects is, -1 for what is new.

        Matched ones by their landmark, others by the nearest place (K, 2), give or take `reach_m` (K,).
        """
        if not len(self.landmarks):
            return np.full(len(landmarks), -1, dtype=np.int64)
        apart = np.linalg.norm(places_xy[:, None] - self.places_xy, axis=-1)
        near = np.where(apart.min(axis=1) < reach_m, apart.argmin(axis=1), -1)
        same = landmarks[:, None] == self.landmarks
        return np.where(landmarks == UNMATCHED, near, np.where(same.any(axis=1), same.argmax(axis=1), -1))

    def updated(self, again: Ints, landmarks: Ints, places_xy: Array, gain: Array) -> "Evidence":
        """With K objects besides: those known `again`, and the new ones (-1) with their gain (K,)."""
        old, new = np.bincount(again[again >= 0], minlength=len(self.landmarks)), again < 0
        count = int(new.sum())
        return Evidence(
            self.length_m,
            np.concatenate([self.places_xy, places_xy[new]]),
            np.concatenate([self.landmarks, landmarks[new]]),
            np.concatenate([self.gain, gain[new]]),
            np.concatenate([self.effective + old, np.ones(count)]),
            np.concatenate([self.observations + old, np.ones(count, dtype=np.int64)]),
            np.concatenate([np.where(old > 0, 0.0, self.unseen_m), np.zeros(count)]),
        )

    def effective_of(self, landmarks: Ints) -> Array:
        """How many observations (K,) of landmarks err like the next one would, 1 at least."""
        same = (landmarks[:, None] == self.landmarks) & (landmarks != UNMATCHED)[:, None]
        of = np.where(same, self.effective, 0.0).max(axis=1, initial=0.0)
        return np.where(same.any(axis=1), np.maximum(of, 1.0), 1.0)
