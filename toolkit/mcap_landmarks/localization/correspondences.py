"""Objects of many bundles that are each taken for a landmark, as arrays for the solvers, and what they tell of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation.polar import polar_from_points
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.localization.class_association import pairs_by_class
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.decision import Decision, Rule, of_classes, of_one_kind
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.maps.scene_objects import known_covariances
from mcap_landmarks.messages.scene import SceneObjects

Rows = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Larger than this, and the sigma of a bearing leaves the whole circle open: three of them are half of it.
_NO_BEARING_RAD = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Objects (K,) of one scene and the landmarks (K,) they are taken for; `decision` is what was asked by now."""

    scene: SceneObjects
    objects: Rows
    landmarks: Rows
    decision: Decision

    @classmethod
    def of(cls, scene: SceneObjects, landmark_of: Mapping[str, int]) -> Self:
        """The objects whose class stands for one landmark."""
        objects, landmarks = pairs_by_class(scene.classes, landmark_of)
        return cls(scene, objects, landmarks, of_classes(scene.classes, len(objects)))

    def of_one_kind(self, rule: Rule) -> "Problem":
        """The same, known to have `RANGES` or `BEARINGS` alone."""
        return replace(self, decision=of_one_kind(self.decision, rule, len(self.objects)))


@dataclass(frozen=True, slots=True, eq=False)
class Correspondences:
    """Problems as arrays (B, K), padded to the largest; `mask` says what is there. See `solve_poses`."""

    landmarks_xy: Array
    landmark_covariance: Array
    range_m: Array
    bearing_rad: Array
    covariance: Array
    mask: Bools

    @classmethod
    def of(cls, problems: Sequence[Problem], landmark_map: LandmarkMap, config: LocalizeConfig) -> Self:
        """Arrays of B problems."""
        count, width = len(problems), max(len(problem.objects) for problem in problems)
        points, covariances = np.ones((count, width, 2)), np.tile(np.eye(2), (count, width, 1, 1))
        landmarks, spread = np.zeros((count, width, 2)), np.zeros((count, width, 2, 2))
        mask = np.zeros((count, width), dtype=np.bool_)
        for i, problem in enumerate(problems):
            k = len(problem.objects)
            mask[i, :k] = True
            points[i, :k] = problem.scene.positions_xy[problem.objects]
            known = known_covariances(problem.scene, config.range_sigma_m, config.bearing_sigma_rad)
            covariances[i, :k] = known[problem.objects]
            landmarks[i, :k] = landmark_map.positions_xy[problem.landmarks]
            spread[i, :k] = landmark_map.covariances[problem.landmarks]
        return cls(landmarks, spread, *polar_from_points(points, covariances), mask)

    def pick(self, rows: Rows) -> "Correspondences":
        """Some of the problems."""
        return Correspondences(
            self.landmarks_xy[rows],
            self.landmark_covariance[rows],
            self.range_m[rows],
            self.bearing_rad[rows],
            self.covariance[rows],
            self.mask[rows],
        )

    def ranges_alone(self) -> Bools:
        """Problems (B,) of ranges without bearings: no object has a covariance that tells its direction."""
        return np.asarray((self._no_bearing() & ~self._no_range() | ~self.mask).all(axis=1))

    def bearings_alone(self) -> Bools:
        """Problems (B,) of bearings without ranges: no object has a covariance that tells its distance."""
        return np.asarray((self._no_range() & ~self._no_bearing() | ~self.mask).all(axis=1))

    def _no_bearing(self) -> Bools:
        return np.asarray(self.covariance[..., 1, 1] > _NO_BEARING_RAD**2)

    def _no_range(self) -> Bools:
        return np.asarray(self.covariance[..., 0, 0] > self.range_m**2)
