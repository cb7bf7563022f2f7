"""The objects that scans show, each followed by its id: what it has been taken for so far, and where it was."""

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from mcap_landmarks.fusion.class_belief import ClassBelief
from mcap_landmarks.fusion.class_centres import centre_of
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.place_grid import PlaceGrid
from mcap_landmarks.fusion.track_history import TrackHistory
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.messages.scan_objects import ScanObjects

STALE = 0.15
"""Images from nearly the same place say the same, right or wrong, and count so much at least: seven as one."""
_TURNED_RAD, _NEARER = 0.035, 0.1
"""Seen from another side by two degrees, or at a distance larger or smaller by such a share, is seen from another
place: a box has moved or grown by more than it is sure to."""
_KEPT_BUNDLES = 1000
"""A track that scans do not show for longer is forgotten; at ten scans a second nearly twice what is remembered."""
_REMEMBERED_NS = 60 * 10**9
"""For so long a place holds: odometry of 1 to 2 % at a walking pace drifts by about a metre meanwhile."""
_CELL_M = 4.0
"""Side of a cell of the grid, about the reach of a box some metres away; it decides how fast tracks are found only."""
_LEAST_M = 0.1
"""Distances below are the same, since their logarithm counts."""


@dataclass(slots=True)
class Track:
    """One object: its number in the order in which they came, what is believed of its class, and when it was seen.

    `viewed`: its direction in the odometry frame and the logarithm of its distance, in the last image that counted;
    `place_xy` (2,): where it was last, in the odometry frame, if its class is known; `is_redundant`: whether another
    track explained its boxes when that was `judged`, in that bundle.
    """

    number: int
    belief: ClassBelief
    bundle: int = 0
    seen_ns: int = 0
    viewed: tuple[float, float] | None = None
    place_xy: Array | None = None
    history: TrackHistory = field(default_factory=TrackHistory)
    is_redundant: bool = False
    judged: int = 0

    def freshness(self, place_xy: Array, heading_rad: float) -> float:
        """How much an image says about the track, at a place (2,) in the base frame, that those before have not."""
        before = self.viewed
        self.viewed = heading_rad + math.atan2(place_xy[1], place_xy[0]), math.log(max(np.hypot(*place_xy), _LEAST_M))
        if before is None:
            return 1.0
        turned, nearer = abs(wrap(self.viewed[0] - before[0])), abs(self.viewed[1] - before[1])
        return float(np.clip(turned / _TURNED_RAD + nearer / _NEARER, STALE, 1.0))


class TrackTable:
    """All tracks by id, the one that was seen longest ago first.

    `bundle` counts the scans, `shaped` has the classes that shapes in scans so far were of, `grid` tells where tracks
    of a known class have been, in the odometry frame.
    """

    def __init__(self, config: FuseConfig) -> None:
        self.config = config
        self.bundle = 0
        self.shaped: set[str] = set()
        self.grid = PlaceGrid(_CELL_M)
        self._tracks: dict[str, Track] = {}
        self._count = 0

    def __contains__(self, name: str) -> bool:
        return name in self._tracks

    def __getitem__(self, name: str) -> Track:
        return self._tracks[name]

    def see(self, objects: ScanObjects, *, alone: bool) -> None:
        """Note what a scan shows, and forget what none has shown for long; new tracks are `alone` without odometry."""
        self.bundle += 1
        self.shaped.update(name for options in objects.hypotheses for name, _ in options)
        for name in objects.ids:
            track = self._tracks.pop(name, None) or self._new(alone=alone)
            track.bundle, track.seen_ns = self.bundle, objects.stamp_ns
            self._tracks[name] = track
        gone = itertools.takewhile(lambda entry: entry[1].bundle <= self.bundle - _KEPT_BUNDLES, self._tracks.items())
        for name in [name for name, _ in gone]:
            self._remove(name)

    def _new(self, *, alone: bool) -> Track:
        self._count += 1
        return Track(self._count, ClassBelief(self.config, alone=alone), judged=self.bundle)

    def _remove(self, name: str) -> None:
        del self._tracks[name]
        self.grid.remove(name)

    def near(self, places: Iterable[tuple[Array, float]], stamp_ns: int) -> list[str]:
        """The tracks of a known class that were seen lately and have been in any of some circles, oldest first.

        Circles are centres (2,) in the odometry frame and radii in m.
        """
        names = set[str]().union(*(self.grid.near(*circle) for circle in places))
        return sorted((name for name in names if self.is_known(name, stamp_ns)), key=lambda name: self[name].number)

    def is_known(self, name: str, stamp_ns: int) -> bool:
        """Whether a track's class is known, and it was seen lately."""
        track = self._tracks[name]
        return track.place_xy is not None and stamp_ns - track.seen_ns <= _REMEMBERED_NS

    def place(self, objects: ScanObjects, odom_from_base: Array) -> None:
        """Note where the objects are whose class is known."""
        for i, name in enumerate(objects.ids):
            track = self._tracks[name]
            best, share = track.belief.best()
            track.place_xy = None
            if best and share >= self.config.min_probability:
                rows = [k for k, (known, _) in enumerate(objects.hypotheses[i]) if known == best]
                track.place_xy = transform_points(odom_from_base, objects.positions_xy[i][rows[0] if rows else -1])
                track.history.stood(self.bundle, track.place_xy)
                self.grid.add(name, track.place_xy)

    def pass_on(self, name: str, heir: str) -> None:
        """What is known of a track is known of another one from now on, and the track is gone."""
        track, new = self._tracks[name], self._tracks[heir]
        new.belief, new.viewed, new.history = track.belief, track.viewed, track.history
        self.grid.rename(name, heir)
        self._remove(name)

    def centre(self, objects: ScanObjects, i: int, class_name: str) -> tuple[Array, Array]:
        """Centre (2,) and covariance (2, 2) of a scan's object i, if it is of a class."""
        radii_m, usual_m = self._tracks[objects.ids[i]].belief.radii_m, self.config.size(class_name).radius_m
        radius_m = radii_m.get(class_name, usual_m)
        position, covariance, _ = centre_of(objects, i, class_name, radius_m, has_shape=class_name in self.shaped)
        return position, covariance

    def radius_m(self, name: str, class_name: str) -> float:
        """The radius of a track of a class: the class's own, else that which its boxes gave."""
        size = self.config.known_size(class_name)
        return size.radius_m if size else self._tracks[name].belief.radii_m.get(class_name, 0.0)
