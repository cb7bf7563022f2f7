"""Tracks that go on under another id: a scan may show another leg of a chair, or the other wheel of a bicycle."""

from collections.abc import Iterator

import numpy as np

from mcap_landmarks.fusion.class_centres import is_resolved
from mcap_landmarks.fusion.tracks import TrackTable
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.messages.scan_objects import ScanObjects

_MOVED_M = 0.3
"""How far beyond a track's radius a part of it may be: it stirs, and odometry drifts while it is not seen."""


def inherit(tracks: TrackTable, objects: ScanObjects, odom_from_base: Array) -> None:
    """Objects that no box has named are what was known in their place, if that is not seen any more; nearest first."""
    unnamed = [i for i, name in enumerate(objects.ids) if not tracks[name].belief.log_odds]
    pairs = _pairs(tracks, objects, unnamed, odom_from_base) if unnamed else []
    gone: set[str] = set()
    for away, i, _, name in sorted(pairs):
        if name in gone or tracks[objects.ids[i]].belief.log_odds:
            continue
        class_name, _ = tracks[name].belief.best()
        is_there = away <= tracks.radius_m(name, class_name) + _MOVED_M
        if is_there and is_resolved(objects, i, class_name, has_shape=class_name in tracks.shaped):
            tracks.pass_on(name, objects.ids[i])
            gone.add(name)


def _pairs(
    tracks: TrackTable, objects: ScanObjects, unnamed: list[int], odom_from_base: Array
) -> Iterator[tuple[float, int, int, str]]:
    """Objects and what was known near them and is not seen: distance in m, object, number and id of the track."""
    surfaces = transform_points(odom_from_base, np.array([objects.positions_xy[i][-1] for i in unnamed]))
    reach = tracks.config.largest_radius_m + _MOVED_M
    for i, surface in zip(unnamed, surfaces, strict=True):
        for name in tracks.near([(surface, reach)], objects.stamp_ns):
            track = tracks[name]
            if track.place_xy is not None and objects.stamp_ns > track.seen_ns:
                yield float(np.hypot(*(surface - track.place_xy))), i, track.number, name
