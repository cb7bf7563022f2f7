"""Localize the bundles of a log one after the other, as a sequence that odometry holds together."""

from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation.odometry import Motions, OdometryNoise, motion_covariance
from mcap_landmarks.geometry import se2
from mcap_landmarks.localization.decision import is_accident
from mcap_landmarks.localization.local_map import LocalMap
from mcap_landmarks.localization.match import Fix, Match, at_place, without_place
from mcap_landmarks.localization.matching import Matcher, Objects, best_of
from mcap_landmarks.localization.relocalization import Relocalizer
from mcap_landmarks.localization.tracker import Tracker
from mcap_landmarks.localization.verification import UNMATCHED
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import OdometryAt

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class SequenceLocalizer:
    """Localizes one log's bundles in their order.

    While the place is unknown, all that was observed over the last `length_m` is matched as one set of objects; when
    that can hardly be an accident, the robot is tracked through the map. Odometry counts as good as `noise` says.
    """

    def __init__(self, matcher: Matcher, noise: OdometryNoise, length_m: float) -> None:
        self._matcher, self._noise, self._length_m = matcher, noise, length_m
        counts = np.bincount(matcher.index.class_of)
        self._frequency: Array = counts / counts.sum()
        self._reset()

    def _reset(self) -> None:
        self._local_map = LocalMap(self._matcher.density, self._frequency, self._length_m, self._matcher.config)
        self._relocalizer = Relocalizer(self._matcher, self._length_m)
        self._tracker: Tracker | None = None
        self._before: OdometryAt | None = None
        self._bundles_at_m: deque[float] = deque()

    def localize(self, scene: SceneObjects, odometry: OdometryAt | None) -> Match:
        """Match the next bundle; without odometry by itself. Then, and where odometry
        begins anew, what came before is forgotten.

        Raises:
            MapError: lengths in the scene and in the map differ so much that one has the wrong unit.
        """
        if odometry is None:
            self._reset()
            return self._matcher.match([scene])[0]
        objects = self._matcher.objects(scene)
        if self._before is not None and self._before.piece != odometry.piece:
            self._reset()
        self._predict(odometry)
        old = self._local_map.numbers
        numbers = self._local_map.update(objects.points_xy, objects.covariances, objects.probabilities)
        objects = replace(objects, spurious=self._local_map.spurious_of(numbers))
        fresh = ~np.isin(self._local_map.numbers, old)
        bundles = self._count(scene, odometry.way_m)
        if self._tracker is not None:
            fix = self._tracker.update(objects)
            if not self._tracker.lost:
                return self._report(scene, objects, fix, bundles)
            self._tracker, fresh = None, np.ones_like(fresh)
        found = self._relocalizer.search(self._local_map, fresh)
        config = self._matcher.config
        if found is None or is_accident(found[0].expected_accidental, config):
            return without_place(scene, self._matcher.index, found[0] if found else None, config, bundles)
        fix, rows = best_of(found[0]), found[1]
        self._tracker = Tracker(self._matcher, fix, self._local_map.points_xy[rows], self._length_m)
        landmark_of = dict(zip(self._local_map.numbers[rows].tolist(), fix.landmarks.tolist(), strict=True))
        own = np.array([landmark_of.get(number, UNMATCHED) for number in numbers.tolist()], dtype=np.int64)
        fix = Fix(fix.pose, fix.covariance, own, fix.expected_accidental, fix.chi2, fix.dof)
        return self._report(scene, objects, fix, bundles)

    def _predict(self, odometry: OdometryAt) -> None:
        before, self._before = self._before, odometry
        if before is None:
            return
        step = se2.between(before.odom_from_base, odometry.odom_from_base)
        way_m = odometry.way_m - before.way_m
        # A scan that came late is of before the last one: the way back to it is as uncertain as the way on.
        turned_rad = odometry.turned_rad - before.turned_rad
        motion = Motions(step[None], np.array([abs(way_m)]), np.array([abs(turned_rad)]))
        covariance = motion_covariance(motion, self._noise)[0]
        self._local_map.predict(step, covariance, way_m)
        self._relocalizer.predict(step)
        if self._tracker is not None:
            self._tracker.predict(step, covariance, way_m)

    def _count(self, scene: SceneObjects, way_m: float) -> int:
        """How many bundles with objects the sequence has over its length, this one at least."""
        if len(scene):
            self._bundles_at_m.append(way_m)
        while self._bundles_at_m and self._bundles_at_m[0] < way_m - self._length_m:
            self._bundles_at_m.popleft()
        return max(len(self._bundles_at_m), 1)

    def _report(self, scene: SceneObjects, objects: Objects, fix: Fix, bundles: int) -> Match:
        return at_place(scene, objects.rows, objects.points_xy, self._matcher.index, fix, self._matcher.config, bundles)
