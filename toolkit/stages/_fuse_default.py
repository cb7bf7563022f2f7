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
_KEPT_BUNDLES = 100
_LEAST_SHARE = 0.02
_LEAST_TOLD = 0.005


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

    def add(self, objects: ScanObjects, detections: Detections | None, view: View | None) -> tuple[SceneObjects, int]:
        """The scene at a scan, with what an image beside it shows; also the number of boxes that nothing explains."""
        self._bundle += 1
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
        costs, radii = self._costs(objects, beliefs, [name for name, _ in named], sights, view)
        pairs = _assigned(costs)
        for box, i in pairs:
            name, score = named[box]
            rivals = np.exp((costs[box, i] - costs[box]) / 2)
            beliefs[i].hit(name, score / float(rivals.sum()))
            if not (sights.cut[box, 0] or sights.cut[box, 2]):
                before = beliefs[i].radii_m.get(name, radii[box, i])
                beliefs[i].radii_m[name] = float(0.7 * before + 0.3 * radii[box, i])
        hit = {i for _, i in pairs}
        for i, belief in enumerate(beliefs):
            if belief.hits and i not in hit and self._is_missed(objects, i, belief, sights, view):
                belief.miss()
        return len(detections) - len(pairs)

    def _costs(
        self, objects: ScanObjects, beliefs: list[Belief], names: list[str], sights: Sights, view: View
    ) -> tuple[Array, Array]:
        """Costs (M, N) of taking boxes for objects, very high where it cannot be; radii (M, N) that they would have."""
        rules = self._rules
        costs, radii = np.full((len(names), len(objects)), _NEVER), np.zeros((len(names), len(objects)))
        for box, name in enumerate(names):
            size = rules.sizes.get(name, ANY_SIZE)
            radii[box] = radii_in_boxes(objects, view, sights, box, size)
            found = centres_of(objects, name, radii[box])
            sideways, upright = misfits(view, sights, box, (found.positions_xy, found.covariances), size, rules.error)
            earned = np.array([max(_share(belief, name), _LEAST_SHARE) for belief in beliefs])
            total = sideways + upright - 2 * np.log(found.fits) - 2 * np.log(earned)
            possible = (sideways <= rules.bearing_gate) & (upright <= rules.size_gate)
            costs[box] = np.where(possible, total, _NEVER)
        return costs, radii

    def _is_missed(self, objects: ScanObjects, i: int, belief: Belief, sights: Sights, view: View) -> bool:
        """Whether the image would show an object, large enough, and has no box that it could be in or behind."""
        name, _ = belief.probabilities({})[0]
        size = self._rules.sizes.get(name, ANY_SIZE)
        middle_m = (size.foot_m[0] + size.top_m[0]) / 2
        point = self._centres(objects, name).positions_xy[i]
        place = view.from_camera(point[None])[0]
        distance, half_width = float(np.hypot(*place)), size.width_m[0] / 2
        height_px = (size.top_m[0] - size.foot_m[1]) / max(distance, 0.1) * view.camera.intrinsics[1, 1]
        if height_px < self._rules.least_height_px or not view.shows(point, half_width, middle_m):
            return False
        return not sights.covers(math.atan2(place[1], place[0]), half_width / distance)

    def _centres(self, objects: ScanObjects, name: str) -> Centres:
        default = self._rules.sizes.get(name, ANY_SIZE).radius_m
        radii = [self._tracks[track].belief.radii_m.get(name, default) for track in objects.ids]
        return centres_of(objects, name, np.array(radii, dtype=np.float64))

    def _scene(self, objects: ScanObjects) -> SceneObjects:
        """Objects whose class is known well enough; of several of one class in one place the surest."""
        found = []
        for i, track in enumerate(objects.ids):
            belief = self._tracks[track].belief
            options = belief.probabilities(fits_of(objects, i)) if belief.hits else []
            if options and options[0][1] >= self._rules.least_probability:
                told = tuple((name, share) for name, share in options if share >= _LEAST_TOLD)
                found.append((options[0][1], i, told))
        kept: list[tuple[int, tuple[tuple[str, float], ...], Array, Array, float]] = []
        for _, i, options in sorted(found, key=lambda entry: (-entry[0], entry[1])):
            name = options[0][0]
            centres = self._centres(objects, name)
            position, radius = centres.positions_xy[i], self._radius(objects.ids[i], name)
            same = [entry for entry in kept if entry[1][0][0] == name]
            if all(np.hypot(*(position - other[2])) > radius for other in same):
                kept.append((i, options, position, centres.covariances[i], radius))
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
