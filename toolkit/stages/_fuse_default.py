"""The default fusion: detections assigned to tracks in the scan, each of which keeps the class it has earned."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from toolkit.geometry.se2 import Array
from toolkit.messages.detections import Detections
from toolkit.messages.scan_objects import ScanObjects
from toolkit.messages.scene import SceneObjects
from toolkit.stages._fuse_belief import Belief, Weighing
from toolkit.stages._fuse_centres import Centres, centres_of, fits_of, radii_in_boxes
from toolkit.stages._fuse_sights import BoxError, Sights, View, misfits, sights_of
from toolkit.stages._fuse_sizes import ANY_SIZE, Size

_NEVER = 1e6
_KEPT_BUNDLES = 1000
_LEAST_SHARE = 0.02
_ALONE = 12.0
"""What it costs a box to be of nothing in the scan, such as an object too far away or too thin for the LiDAR."""
_LEAST_TOLD = 0.005
_SMALLER = 0.8
"""How much smaller than usual an object may be that is before another one."""
_RESOLVED = 0.01
"""A shape that fits a cluster worse has no centre that counts: hits of several things have run together."""


@dataclass(frozen=True, slots=True)
class Rules:
    """What the fusion goes by; see `FuseConfig`."""

    sizes: Mapping[str, Size]
    error: BoxError
    weighing: Weighing
    bearing_gate: float
    size_gate: float
    least_probability: float
    least_height_px: float


@dataclass(frozen=True, slots=True, eq=False)
class _Candidates:
    """M boxes as N objects: costs (M, N), very high where it cannot be; how far aside the object is (M, N), in sigmas;
    radii_m (M, N) that it would have.
    """

    costs: Array
    aside: Array
    radii_m: Array


@dataclass(slots=True)
class _Track:
    belief: Belief
    seen: int


class Fuser:
    """Fuses scan after scan. Its state is what each track in the scan has been taken for so far."""

    def __init__(self, rules: Rules) -> None:
        self._rules = rules
        self._tracks: dict[str, _Track] = {}
        self._bundle = 0
        self._shaped: set[str] = set()  # classes that the scans' shapes are of

    def add(self, objects: ScanObjects, detections: Detections | None, view: View | None) -> tuple[SceneObjects, int]:
        """The scene at a scan, with what an image beside it shows; also the number of boxes that nothing explains."""
        self._bundle += 1
        self._shaped.update(name for options in objects.hypotheses for name, _ in options)
        for name in objects.ids:
            track = self._tracks.setdefault(name, _Track(Belief(self._rules.weighing), 0))
            track.seen = self._bundle
        self._tracks = {k: track for k, track in self._tracks.items() if track.seen > self._bundle - _KEPT_BUNDLES}
        unexplained = 0
        if detections is not None and view is not None:
            unexplained = self._learn(objects, detections, view)
        return self._scene(objects), unexplained

    def _learn(self, objects: ScanObjects, detections: Detections, view: View) -> int:
        sights = sights_of(view, detections.boxes_xyxy, self._rules.error)
        beliefs = [self._tracks[name].belief for name in objects.ids]
        named = [options[0] for options in detections.hypotheses]
        names = [name for name, _ in named]
        candidates = self._candidates(objects, beliefs, names, sights, view)
        pairs = _assigned(candidates.costs)
        for box, i in pairs:
            name, score = named[box]
            rivals = np.exp((candidates.costs[box, i] - np.append(candidates.costs[box], _ALONE)) / 2)
            beliefs[i].hit(name, score / float(rivals.sum()), float(candidates.aside[box, i]))
            if not (sights.cut[box, 0] or sights.cut[box, 2]):
                before = beliefs[i].radii_m.get(name, candidates.radii_m[box, i])
                beliefs[i].radii_m[name] = float(0.7 * before + 0.3 * candidates.radii_m[box, i])
        hit = {i for _, i in pairs}
        nearness = self._nearness(objects, pairs, view, names, sights)
        for i, belief in enumerate(beliefs):
            if belief.log_odds and i not in hit and self._is_missed(objects, i, belief, sights, nearness, view):
                belief.miss()
        return len(detections) - len(pairs)

    def _candidates(
        self, objects: ScanObjects, beliefs: list[Belief], names: list[str], sights: Sights, view: View
    ) -> _Candidates:
        """Every box as every object."""
        rules, shape = self._rules, (len(names), len(objects))
        found = _Candidates(np.full(shape, _NEVER), np.zeros(shape), np.zeros(shape))
        for box, name in enumerate(names):
            size = rules.sizes.get(name, ANY_SIZE)
            found.radii_m[box] = radii_in_boxes(objects, view, sights, box, size)
            centres = centres_of(objects, name, found.radii_m[box], has_shape=name in self._shaped)
            places = centres.positions_xy, centres.covariances
            aside, upright = misfits(view, sights, box, places, size, rules.error)
            earned = np.array([max(_share(belief, name), _LEAST_SHARE) for belief in beliefs])
            total = aside**2 + upright - 2 * np.log(centres.fits) - 2 * np.log(earned)
            possible = (aside**2 <= rules.bearing_gate) & (upright <= rules.size_gate)
            found.costs[box], found.aside[box] = np.where(possible, total, _NEVER), aside
        return found

    def _nearness(
        self, objects: ScanObjects, pairs: list[tuple[int, int]], view: View, names: list[str], sights: Sights
    ) -> Array:
        """How far from the camera what is in the boxes (M,) is; at least, where that goes by height only."""
        sizes = [self._rules.sizes.get(name, ANY_SIZE) for name in names]
        tall = np.array([size.least_tall_m for size in sizes])
        nearness = _SMALLER * tall / np.maximum(sights.top - sights.bottom, 1e-3)
        for box, i in pairs:
            nearness[box] = np.hypot(*view.from_camera(objects.positions_xy[i][-1:])[0])
        return nearness

    def _is_missed(
        self, objects: ScanObjects, i: int, belief: Belief, sights: Sights, nearness: Array, view: View
    ) -> bool:
        """Whether the image would show an object, large enough, and has no box that it could be in or behind."""
        name, _ = belief.probabilities()[0]
        size = self._rules.sizes.get(name, ANY_SIZE)
        middle_m = (size.foot_m[0] + size.top_m[0]) / 2
        point = self._centres(objects, name).positions_xy[i]
        place = view.from_camera(point[None])[0]
        distance, half_width = float(np.hypot(*place)), size.width_m[0] / 2
        height_px = size.least_tall_m / max(distance, 0.1) * view.camera.intrinsics[1, 1]
        if height_px < self._rules.least_height_px or not view.shows(point, half_width, middle_m):
            return False
        before = nearness < distance
        return not sights.covers(math.atan2(place[1], place[0]), half_width / distance, before)

    def _centres(self, objects: ScanObjects, name: str) -> Centres:
        default = self._rules.sizes.get(name, ANY_SIZE).radius_m
        radii = [self._tracks[track].belief.radii_m.get(name, default) for track in objects.ids]
        return centres_of(objects, name, np.array(radii, dtype=np.float64), has_shape=name in self._shaped)

    def _scene(self, objects: ScanObjects) -> SceneObjects:
        """Objects whose class is known well enough; of several of one class in one place the surest."""
        found = []
        for i, track in enumerate(objects.ids):
            belief = self._tracks[track].belief
            options = belief.probabilities() if belief.log_odds else []
            if options and self._is_clear(objects, i, *options[0]):
                told = tuple((name, share) for name, share in options if share >= _LEAST_TOLD)
                found.append((options[0][1], i, told))
        kept: list[tuple[int, tuple[tuple[str, float], ...], Array, Array, float]] = []
        for _, i, told in sorted(found, key=lambda entry: (-entry[0], entry[1])):
            name = told[0][0]
            centres = self._centres(objects, name)
            position, radius = centres.positions_xy[i], self._radius(objects.ids[i], name)
            same = [entry for entry in kept if entry[1][0][0] == name]
            if all(np.hypot(*(position - other[2])) > radius for other in same):
                kept.append((i, told, position, centres.covariances[i], radius))
        kept.sort(key=lambda entry: entry[0])
        return SceneObjects(
            objects.stamp_ns,
            objects.frame_id,
            tuple(objects.ids[i] for i, *_ in kept),
            tuple(options for _, options, *_ in kept),
            np.array([position for _, _, position, *_ in kept]).reshape(-1, 2),
            np.array([covariance for *_, covariance, _ in kept]).reshape(-1, 2, 2),
            np.array([radius for *_, radius in kept], dtype=np.float64),
        )

    def _is_clear(self, objects: ScanObjects, i: int, name: str, probability: float) -> bool:
        """Whether an object's class is sure enough, and the scan shows where its centre is."""
        fit = fits_of(objects, i).get(name, 0.0 if name in self._shaped else 1.0)
        return probability >= self._rules.least_probability and fit >= _RESOLVED

    def _radius(self, track: str, name: str) -> float:
        size = self._rules.sizes.get(name)
        return size.radius_m if size else self._tracks[track].belief.radii_m.get(name, 0.0)


def _share(belief: Belief, name: str) -> float:
    """How much of a track's odds a class has, nothing included."""
    odds = {known: math.exp(value) for known, value in belief.log_odds.items()}
    own = odds.get(name, math.exp(belief.other))
    return own / (1 + sum(odds.values()) + (0.0 if name in odds else own))


def _assigned(costs: Array) -> list[tuple[int, int]]:
    """Pairs (box, object) of the assignment that costs least, where a box alone costs more than any pair may."""
    boxes, objects = costs.shape
    alone = np.full((boxes, boxes), _NEVER / 2)
    rows, columns = linear_sum_assignment(np.hstack([costs, alone]))
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if j < objects and costs[i, j] < _NEVER]
