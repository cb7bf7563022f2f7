"""Match single bundles of objects to a landmark map without knowing the pose, and refuse rather than guess."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, logsumexp

from mcap_landmarks.geometry import se2
from mcap_landmarks.localization.acceptance import ClassEvidence, PairDensity
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.decision import is_accident
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.match import Fix, Match, Places, at_place, without_place
from mcap_landmarks.localization.pose_candidates import PoseCandidates
from mcap_landmarks.localization.validation import check_lengths
from mcap_landmarks.localization.verification import Candidates, Constellations, Fits, Verifier
from mcap_landmarks.maps.scene_objects import known_covariances
from mcap_landmarks.messages.scene import SceneObjects

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# More objects than these, the nearest, say nothing new and cost time.
_MOST = 24
# Gates: of true matches one object in 2000 and one set in 10,000 lies beyond them (chi-square of their dimensions).
_OBJECT, _SET = 5e-4, 1e-4
# Bundles matched at once, times the square of their objects: bounds the memory, 0.6 MB for the covariances of all.
_AT_ONCE = 20_000
# Candidates closer than this are one place: half of what makes a pose false (1 m, 20 degrees). So many places are kept.
_SAME_M, _SAME_RAD = 0.5, 0.17
_PLACES = 32
# The share of landmarks that are known better than what stands for the map's error in a search.
_MAP_QUANTILE = 0.9
# Odds are not told beyond e^50: exp would overflow, and they say no all the same.
_LOG_MOST = 50.0


@dataclass(frozen=True, slots=True, eq=False)
class Objects:
    """K objects of one bundle that could be in the map.

    rows (K,) in the scene, points_xy (K, 2) and covariances (K, 2, 2) in the base frame, probabilities (K, C) of what
    was seen, were the object of each class, spurious (K,) the probability that it is not in the map.
    """

    rows: Ints
    points_xy: Array
    covariances: Array
    probabilities: Array
    spurious: Array


class Matcher:
    """Matches sets of objects to one map."""

    def __init__(self, index: MapIndex, config: LocalizeConfig) -> None:
        self.index, self.config = index, config
        self.classes = ClassEvidence.of(index.names, index.class_of, config.misread)
        self.density = PairDensity.of(index.places, index.positions_xy)
        unknown = np.logical_not(index.covariances.any(axis=(1, 2)))
        spread = np.where(unknown[:, None, None], config.map_sigma_m**2 * np.eye(2), index.covariances)
        sigma_m = float(np.sqrt(np.quantile(spread[:, [0, 1], [0, 1]].max(axis=1), _MAP_QUANTILE)))
        self._pose_candidates = PoseCandidates(index, sigma_m)
        self.verifier = Verifier(index, spread, float(chdtri(2, _OBJECT)))

    def objects(self, scene: SceneObjects) -> Objects:
        """The nearest objects of a scene whose classes the map knows.

        Raises:
            MapError: lengths in the scene and in the map differ so much that one has the wrong unit.
        """
        names = set(self.index.names)
        known = [i for i, options in enumerate(scene.hypotheses) if any(name in names for name, _ in options)]
        nearest = np.argsort(np.linalg.norm(scene.positions_xy[known], axis=1), kind="stable")[:_MOST]
        rows = np.sort(np.array(known, dtype=np.int64)[nearest])
        check_lengths(scene.positions_xy[rows], self.index.extent_m)
        covariances = known_covariances(scene, self.config.range_sigma_m, self.config.bearing_sigma_rad)
        probabilities = self.classes.probabilities([scene.hypotheses[i] for i in rows])
        spurious = np.full(len(rows), self.config.spurious)
        return Objects(rows, scene.positions_xy[rows], covariances[rows], probabilities, spurious)

    def sets(self, points: Array, covariance: Array, probabilities: Array, spurious: Array) -> Constellations:
        """Sets of objects: points (B, K, 2), joint covariance (B, 2K, 2K), class likelihoods (B, K, C).

        `spurious` (B, K) is the probability that each is not in the map.
        """
        log_ratio = self.classes.log_ratios(probabilities.reshape(-1, probabilities.shape[-1]))
        density = self.density.chain(points)
        return Constellations(points, covariance, log_ratio.reshape(probabilities.shape), density, spurious)

    def candidates(self, sets: Constellations, fresh: Bools) -> Candidates:
        """Poses to try, from pairs or triangles of objects of which one is `fresh` (B, K)."""
        if sets.points_xy.shape[1] < 3:
            return self._pose_candidates.pairs(sets, fresh)
        triangles = self._pose_candidates.triangles(sets, fresh)
        if not self._pose_candidates.pairs_are_few:
            return triangles
        both = zip(triangles, self._pose_candidates.pairs(sets, fresh), strict=True)
        return Candidates(*(np.concatenate(parts) for parts in both))

    def places(self, sets: Constellations, candidates: Candidates, tests: int = 1) -> list[Places | None]:
        """Where each set may have been seen; `tests`: how many sets are tried for the same question.

        Each test has its own chance of an accident, so the expected numbers add up (Bonferroni).
        """
        if not len(candidates.of):
            return [None] * len(sets)
        fits = self.verifier.fit(sets, candidates)
        possible = fits.chi2 <= chdtri(np.maximum(fits.dof, 1), _SET)
        fits = fits.pick(possible & (fits.dof > 0) & np.isfinite(fits.log_ratio))
        fits = fits.pick(np.lexsort((-fits.log_ratio, fits.candidates.of)))
        bounds = np.searchsorted(fits.candidates.of, np.arange(len(sets) + 1))
        return [_places(fits, int(a), int(b), tests) for a, b in pairwise(bounds)]

    def match(self, scenes: Sequence[SceneObjects]) -> list[Match]:
        """Match each scene by itself.

        Raises:
            MapError: lengths in a scene and in the map differ so much that one has the wrong unit.
        """
        read = [self.objects(scene) for scene in scenes]
        found: list[Places | None] = [None] * len(scenes)
        by_size = defaultdict(list)
        for i, objects in enumerate(read):
            by_size[len(objects.rows)].append(i)
        for size, members in by_size.items():
            if size < 2:
                continue
            step = max(_AT_ONCE // size**2, 1)
            for first in range(0, len(members), step):
                part = members[first : first + step]
                for i, places in zip(part, self._places_of([read[i] for i in part]), strict=True):
                    found[i] = places
        return [self._match_at(*one) for one in zip(scenes, read, found, strict=True)]

    def _places_of(self, read: Sequence[Objects]) -> list[Places | None]:
        """Where each of several bundles of as many objects may have been seen."""
        sets = self.sets(
            np.stack([objects.points_xy for objects in read]),
            block_diagonal(np.stack([objects.covariances for objects in read])),
            np.stack([objects.probabilities for objects in read]),
            np.stack([objects.spurious for objects in read]),
        )
        return self.places(sets, self.candidates(sets, np.ones(sets.points_xy.shape[:2], dtype=np.bool_)))

    def _match_at(self, scene: SceneObjects, objects: Objects, places: Places | None) -> Match:
        if places is None or is_accident(places.expected_accidental, self.config):
            return without_place(scene, self.index, places, self.config)
        return at_place(scene, objects.rows, objects.points_xy, self.index, best_of(places), self.config)


def best_of(places: Places) -> Fix:
    """The best place, taken for true."""
    fits = places.fits
    return Fix(
        fits.candidates.pose[0],
        fits.covariance[0],
        fits.candidates.landmarks[0],
        places.expected_accidental,
        float(fits.chi2[0]),
        int(fits.dof[0]),
    )


def block_diagonal(covariances: Array) -> Array:
    """Joint covariance (B, 2K, 2K) of independent points with covariances (B, K, 2, 2)."""
    count, k = covariances.shape[:2]
    joint = np.zeros((count, 2 * k, 2 * k))
    for i in range(k):
        joint[:, 2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = covariances[:, i]
    return joint


def is_same_place(pose: Array, others: Array) -> Bools:
    """Which poses (M, 3) are at the place of one (3,), itself included."""
    apart = se2.between(pose, others)
    same: Bools = (np.hypot(apart[..., 0], apart[..., 1]) <= _SAME_M) & (np.abs(apart[..., 2]) <= _SAME_RAD)
    return same


def _places(fits: Fits, first: int, last: int, tests: int) -> Places | None:
    """The distinct places among one set's fits, which are sorted by their evidence.

    Beside accidents count the rivals: the odds of the other places against the best one.
    """
    if first == last:
        return None
    pose = fits.candidates.pose[first:last]
    kept: list[int] = []
    left = np.ones(last - first, dtype=np.bool_)
    while left.any() and len(kept) < _PLACES:
        i = int(np.argmax(left))
        left &= ~is_same_place(pose[i], pose)
        kept.append(first + i)
    rivals = fits.log_ratio[kept[1:]] - fits.log_ratio[kept[0]]
    expected = float(np.exp(np.minimum(logsumexp([fits.log_accidental[first], *rivals]), _LOG_MOST)))
    return Places(fits.pick(np.array(kept)), tests * expected)
