"""What a followed robot has seen of the map and beside it, and what each of these said about where it is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.localization.verification import UNMATCHED

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# A landmark seen again counts as one sighting over so much of the way, since it errs the same from nearby; what was
# seen once and not again over so much of the way was no object.
_SAME_VIEW_M = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """Landmarks seen and objects that the map lacks, over the last `length_m`, and what they say about the place.

    places_xy (N, 2) in the map, landmarks (N,) or `UNMATCHED`, gain (N,) the logarithm of how much each spoke for the
    place, sightings (N,) as far as they are independent, looks (N,) all of them, unseen_m (N,) the way since the last.
    """

    length_m: float
    places_xy: Array
    landmarks: Ints
    gain: Array
    sightings: Array
    looks: Ints
    unseen_m: Array

    @classmethod
    def of(cls, length_m: float, places_xy: Array, landmarks: Ints, expected_accidental: float) -> "Memory":
        """Of a place that was just accepted: its landmarks share what spoke for it."""
        count, used = len(landmarks), landmarks != UNMATCHED
        share = -np.log(max(expected_accidental, 1e-300)) / max(int(used.sum()), 1)
        looks = np.full(count, 2)
        return cls(length_m, places_xy, landmarks, np.where(used, share, 0.0), np.ones(count), looks, np.zeros(count))

    @property
    def odds_against(self) -> float:
        """Odds that the place is wrong."""
        return float(np.exp(-np.clip(self.gain.sum(), -700.0, 700.0)))

    def after(self, way_m: float) -> "Memory":
        """What is left after some way: what was seen just once goes sooner."""
        unseen_m = self.unseen_m + way_m
        stray = (self.landmarks == UNMATCHED) & (self.looks < 2)
        keep = unseen_m < np.where(stray, _SAME_VIEW_M, self.length_m)
        sightings = self.sightings * np.exp(-way_m / _SAME_VIEW_M)
        return Memory(
            self.length_m,
            self.places_xy[keep],
            self.landmarks[keep],
            self.gain[keep],
            sightings[keep],
            self.looks[keep],
            unseen_m[keep],
        )

    def recall(self, landmarks: Ints, places_xy: Array, reach_m: Array) -> Ints:
        """Which of what is known each of K objects is, -1 for what is new.

        Matched ones by their landmark, others by their place (K, 2), give or take `reach_m` (K,).
        """
        if not len(self.landmarks):
            return np.full(len(landmarks), -1, dtype=np.int64)
        apart = np.linalg.norm(places_xy[:, None] - self.places_xy, axis=-1)
        near = np.where(apart.min(axis=1) < reach_m, apart.argmin(axis=1), -1)
        same = landmarks[:, None] == self.landmarks
        return np.where(landmarks == UNMATCHED, near, np.where(same.any(axis=1), same.argmax(axis=1), -1))

    def with_more(self, again: Ints, landmarks: Ints, places_xy: Array, gain: Array) -> "Memory":
        """With K objects besides: those known `again`, the new ones (-1) with their gain (K,)."""
        old, new = np.bincount(again[again >= 0], minlength=len(self.landmarks)), again < 0
        count = int(new.sum())
        return Memory(
            self.length_m,
            np.concatenate([self.places_xy, places_xy[new]]),
            np.concatenate([self.landmarks, landmarks[new]]),
            np.concatenate([self.gain, gain[new]]),
            np.concatenate([self.sightings + old, np.ones(count)]),
            np.concatenate([self.looks + old, np.ones(count, dtype=np.int64)]),
            np.concatenate([np.where(old > 0, 0.0, self.unseen_m), np.zeros(count)]),
        )

    def sightings_of(self, landmarks: Ints) -> Array:
        """Sightings (K,) of landmarks that are known, 1 for none."""
        same = (landmarks[:, None] == self.landmarks) & (landmarks != UNMATCHED)[:, None]
        of = np.where(same, self.sightings, 0.0).max(axis=1, initial=0.0)
        return np.where(same.any(axis=1), np.maximum(of, 1.0), 1.0)
