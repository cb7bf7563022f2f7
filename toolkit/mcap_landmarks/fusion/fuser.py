"""The default fusion: detections assigned to tracks in the scan, each of which keeps the class it has earned."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

from mcap_landmarks.classes import ANY_SIZE, Size
from mcap_landmarks.fusion.box_geometry import BoxError, Sights, View, misfits, sights_of
from mcap_landmarks.fusion.centres import Centres, centres_of, fits_of, radii_in_boxes
from mcap_landmarks.fusion.class_belief import Belief, Weighing
from mcap_landmarks.fusion.track_history import Past, is_redundant, shown
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects

_NEVER = 1e6
_KEPT_BUNDLES = 1000
_UNSEEN_PER_RAD = 0.3
"""Boxes of a class, per image and radian, of what is too far away, too thin or hidden for the LiDAR."""
_REMEMBERED_NS, _MOVED_M = 60 * 10**9, 0.3
_ASIDE, _UPRIGHT = 1.3, 2.0
"""How much more chi-squares of bearing and size tell than sigmas say, which are wide for gates."""
_APART = 1.25
"""Two objects of one class are farther apart than this many of its radii."""
_LEAST_FIT = 0.05
"""Real objects differ from the shapes of their class, so that a scan never speaks more against it."""
_USUAL_FIT = 0.5
"""How well the scan fits a class where it does not speak for it or against it."""
_TURNED_RAD, _NEARER, _STALE = 0.035, 0.1, 0.15
"""Images from nearly the same place say the same: what counts as another place, and what they count at least."""
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
    """M boxes as N objects: ratios (M, N), how much likelier a box is if it is of an object than if it is of something
    that the scan does not show, 0 where it cannot be; the same with what is known of the objects in `odds` (M, N); how
    far aside the object is (M, N), in sigmas; radii_m (M, N) that it would have.
    """

    ratios: Array
    odds: Array
    aside: Array
    radii_m: Array


@dataclass(slots=True)
class _Track:
    belief: Belief
    seen: int
    seen_ns: int = 0
    viewed: tuple[float, float] | None = None  # direction in the odometry frame, logarithm of the distance
    place_xy: Array | None = None  # where it was last, in the odometry frame, if its class is known
    past: Past = field(default_factory=Past)
    redundant: bool = False


class Fuser:
    """Fuses scan after scan. Its state is what each track in the scan has been taken for so far."""

    def __init__(self, rules: Rules) -> None:
        self._rules = rules
        self._tracks: dict[str, _Track] = {}
        self._bundle = 0
        self._shaped: set[str] = set()  # classes that the scans' shapes are of

    def add(
        self, objects: ScanObjects, detections: Detections | None, view: View | None, odometry: Array | None
    ) -> tuple[SceneObjects, int]:
        """The scene at a scan, with what an image beside it shows; also the number of boxes that nothing explains."""
        self._bundle += 1
        self._shaped.update(name for options in objects.hypotheses for name, _ in options)
        for name in objects.ids:
            track = self._tracks.setdefault(name, _Track(Belief(self._rules.weighing, alone=odometry is None), 0))
            track.seen, track.seen_ns = self._bundle, objects.stamp_ns
        self._tracks = {k: track for k, track in self._tracks.items() if track.seen > self._bundle - _KEPT_BUNDLES}
        unexplained = 0
        if odometry is not None:
            self._inherit(objects, odometry)
        if detections is not None and view is not None:
            unexplained = self._learn(objects, detections, view, odometry)
        if odometry is not None:
            self._place(objects, odometry)
            if detections is not None:
                self._compare(objects.stamp_ns)
        return self._scene(objects), unexplained

    def _inherit(self, objects: ScanObjects, odom_from_base: Array) -> None:
        """Objects that no box has named are what was known in their place, if that is not seen any more.

        A scan may show another part of it now: another leg of a chair, or the other wheel of a bicycle.
        """
        lost = {
            name: track
            for name, track in self._tracks.items()
            if track.place_xy is not None and 0 < objects.stamp_ns - track.seen_ns <= _REMEMBERED_NS
        }
        unnamed = [i for i, name in enumerate(objects.ids) if not self._tracks[name].belief.log_odds]
        if not (lost and unnamed):
            return
        surfaces = transform_points(odom_from_base, np.array([objects.positions_xy[i][-1] for i in unnamed]))
        places = np.array([track.place_xy for track in lost.values()])
        away = np.hypot(*(surfaces[:, None] - places).transpose(2, 0, 1))
        donors = list(lost)
        for row, column in zip(*np.unravel_index(np.argsort(away, axis=None), away.shape), strict=True):
            donor, heir = donors[column], objects.ids[unnamed[row]]
            if donor not in self._tracks or self._tracks[heir].belief.log_odds:
                continue
            belief = self._tracks[donor].belief
            name, _ = belief.probabilities()[0]
            fits = fits_of(objects, unnamed[row]).get(name, 0.0 if name in self._shaped else 1.0)
            if away[row, column] <= self._radius(donor, name) + _MOVED_M and fits >= _RESOLVED:
                self._tracks[heir].belief, self._tracks[heir].viewed = belief, self._tracks[donor].viewed
                self._tracks[heir].past = self._tracks[donor].past
                del self._tracks[donor]

    def _place(self, objects: ScanObjects, odom_from_base: Array) -> None:
        """Note where the objects are whose class is known."""
        for i, track in enumerate(objects.ids):
            belief = self._tracks[track].belief
            options = belief.probabilities() if belief.log_odds else []
            rows = [k for k, (name, _) in enumerate(objects.hypotheses[i]) if options and name == options[0][0]]
            sure = bool(options) and options[0][1] >= self._rules.least_probability
            place = transform_points(odom_from_base, objects.positions_xy[i][rows[0] if rows else -1])
            self._tracks[track].place_xy = place if sure else None
            if sure:
                self._tracks[track].past.stood(self._bundle, place)

    def _learn(self, objects: ScanObjects, detections: Detections, view: View, odometry: Array | None) -> int:
        heading_rad = 0.0 if odometry is None else float(odometry[2])
        sights = sights_of(view, detections.boxes_xyxy, self._rules.error)
        beliefs = [self._tracks[name].belief for name in objects.ids]
        named = [options[0] for options in detections.hypotheses]
        names = [name for name, _ in named]
        candidates = self._candidates(objects, beliefs, names, sights, view)
        pairs = _assigned(candidates.odds)
        places = np.array([positions[-1] for positions in objects.positions_xy]).reshape(-1, 2)
        for box, i in pairs:
            name, score = named[box]
            taken = [j for other, j in pairs if other != box]
            rivals = 1.0 + float(np.delete(candidates.odds[box], [i, *taken]).sum())
            ratio = 1 - score + score * float(candidates.ratios[box, i]) / rivals
            fresh = self._fresh(objects.ids[i], places[i], heading_rad)
            beliefs[i].hit(name, ratio, float(candidates.aside[box, i]), fresh)
            if odometry is not None and fresh > _STALE:
                self._tracks[objects.ids[i]].past.note(shown(self._bundle, name, box, sights, view, odometry))
            if not (sights.cut[box, 0] or sights.cut[box, 2]):
                before = beliefs[i].radii_m.get(name, candidates.radii_m[box, i])
                beliefs[i].radii_m[name] = float(0.7 * before + 0.3 * candidates.radii_m[box, i])
        hit = {i for _, i in pairs}
        nearness = self._nearness(objects, pairs, view, names, sights)
        for i, belief in enumerate(beliefs):
            if belief.log_odds and i not in hit and self._is_missed(objects, i, belief, sights, nearness, view):
                belief.miss(self._fresh(objects.ids[i], places[i], heading_rad))
        return len(detections) - len(pairs)

    def _compare(self, stamp_ns: int) -> None:
        """Find the tracks whose boxes were of another one."""
        known: dict[str, list[_Track]] = {}
        for track in self._tracks.values():
            track.redundant = False
            if track.place_xy is not None and stamp_ns - track.seen_ns <= _REMEMBERED_NS:
                known.setdefault(track.belief.probabilities()[0][0], []).append(track)
        for name, tracks in known.items():
            size = self._rules.sizes.get(name, ANY_SIZE)
            for one in tracks:
                others = (other for other in tracks if other is not one and not other.redundant)
                one.redundant = any(is_redundant(one.past, other.past, name, size) for other in others)

    def _fresh(self, name: str, place_xy: Array, heading_rad: float) -> float:
        """How much an image says about a track that the images before have not said."""
        track = self._tracks[name]
        before = track.viewed
        track.viewed = heading_rad + math.atan2(place_xy[1], place_xy[0]), math.log(max(np.hypot(*place_xy), 0.1))
        if before is None:
            return 1.0
        turned, nearer = abs(wrap(track.viewed[0] - before[0])), abs(track.viewed[1] - before[1])
        return float(np.clip(turned / _TURNED_RAD + nearer / _NEARER, _STALE, 1.0))

    def _candidates(
        self, objects: ScanObjects, beliefs: list[Belief], names: list[str], sights: Sights, view: View
    ) -> _Candidates:
        """Every box as every object."""
        rules, shape = self._rules, (len(names), len(objects))
        found = _Candidates(np.zeros(shape), np.zeros(shape), np.zeros(shape), np.zeros(shape))
        for box, name in enumerate(names):
            size = rules.sizes.get(name, ANY_SIZE)
            found.radii_m[box] = radii_in_boxes(objects, view, sights, box, size)
            centres = centres_of(objects, name, found.radii_m[box], has_shape=name in self._shaped)
            places = centres.positions_xy, centres.covariances
            aside, sigma, upright = misfits(view, sights, box, places, size, rules.error)
            possible = (aside**2 <= rules.bearing_gate) & (upright <= rules.size_gate)
            density = np.exp(-(_ASIDE * aside**2 + _UPRIGHT * upright) / 2) / (math.sqrt(2 * math.pi / _ASIDE) * sigma)
            fits = np.maximum(centres.fits, _LEAST_FIT) / _USUAL_FIT
            told = 1.0 if sights.cut[box, [1, 3]].any() else size.telling
            ratios = np.where(possible, told * density / _UNSEEN_PER_RAD * fits, 0.0)
            odds = np.array([belief.share(name) for belief in beliefs])
            found.ratios[box], found.odds[box], found.aside[box] = ratios, ratios * odds, aside
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
            if options and not self._tracks[track].redundant and self._is_clear(objects, i, *options[0]):
                told = tuple((name, share) for name, share in options if share >= _LEAST_TOLD)
                found.append((options[0][1], i, told))
        kept: list[tuple[int, tuple[tuple[str, float], ...], Array, Array, float]] = []
        for _, i, told in sorted(found, key=lambda entry: (-entry[0], entry[1])):
            name = told[0][0]
            centres = self._centres(objects, name)
            position, radius = centres.positions_xy[i], self._radius(objects.ids[i], name)
            same = [entry for entry in kept if entry[1][0][0] == name]
            if all(np.hypot(*(position - other[2])) > _APART * radius for other in same):
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


def _assigned(odds: Array) -> list[tuple[int, int]]:
    """Pairs (box, object) of the most likely assignment, where a box may be of nothing in the scan."""
    boxes, objects = odds.shape
    with np.errstate(divide="ignore"):
        costs = np.hstack([np.maximum(-np.log(odds), -_NEVER), np.zeros((boxes, boxes))])
    rows, columns = linear_sum_assignment(np.where(np.isfinite(costs), costs, _NEVER))
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if j < objects and odds[i, j] > 1]
