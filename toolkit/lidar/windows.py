"""The beams that tell where an object is: its hits, what lies between them, and those that pass it by."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.se2 import Array
from toolkit.lidar.beams import Beams
from toolkit.lidar.segments import Cluster, Segment

Floats = NDArray[np.float32]

_DENSE_M, _FAR_BESIDE_M, _APART_M = 0.65, 5.0, 0.03
"""Beams are looked at beside the outermost hits: every one that is so far from the next, densely at first."""
_MOST_HITS = 24
_FAR_M = 1e4


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """C clusters with up to B beams each, in frames of their own: x away from the robot, y to the left.

    anchors_xy (C, 2) and bearings_rad (C,): those frames in the base frame, at the mean of the hits. Per beam (C, B):
    headings_rad, and directions (C, B, 2), the same as unit vectors; abreast_m and offset_m, where the frame's origin
    lies along the beam and to its left; ranges_m, very large where a beam met nothing; is_hit, whether it met this
    object; beside_m, how far beyond the outermost hit of its side it passes (0 between hits). Where a cluster has fewer
    beams, ranges are 0 and constrain nothing. lateral_m (C, 2): the rightmost and leftmost hit. spacing_m (C,): the
    distance of neighbouring beams there.
    """

    anchors_xy: Array
    bearings_rad: Array
    headings_rad: Floats
    directions: Floats
    abreast_m: Floats
    offset_m: Floats
    ranges_m: Floats
    is_hit: NDArray[np.bool_]
    beside_m: Floats
    lateral_m: Array
    spacing_m: Array

    def __len__(self) -> int:
        return len(self.anchors_xy)

    def within(self, rows: NDArray[np.intp], reach_m: Array | None) -> "Windows":
        """Some clusters, those that several rows ask for repeated, with the beams that pass near their outermost hits:
        within distances (R,), or all of them."""
        near = np.full((len(rows), 1), True) if reach_m is None else self.beside_m[rows] <= reach_m[:, None]
        columns = np.flatnonzero((near & (self.ranges_m[rows] > 0)).any(axis=0))
        pick = np.ix_(rows, columns)
        return Windows(
            self.anchors_xy[rows],
            self.bearings_rad[rows],
            self.headings_rad[pick],
            self.directions[pick],
            self.abreast_m[pick],
            self.offset_m[pick],
            np.where(near, self.ranges_m[rows], np.float32(0))[:, columns],
            self.is_hit[pick],
            self.beside_m[pick],
            self.lateral_m[rows],
            self.spacing_m[rows],
        )

    def in_base(self, local_xy: Array) -> Array:
        """Points (C, 2) of the clusters' frames in the base frame."""
        c, s = np.cos(self.bearings_rad), np.sin(self.bearings_rad)
        x, y = local_xy[:, 0], local_xy[:, 1]
        return self.anchors_xy + np.stack([c * x - s * y, s * x + c * y], axis=1)


def windows(beams: Beams, clusters: Sequence[Cluster]) -> Windows:
    """The windows of clusters that have at least one hit each."""
    picked = [_beams_of(beams, cluster) for cluster in clusters]
    width = max((len(index) for index, _, _ in picked), default=0)
    index = np.zeros((len(clusters), width), dtype=np.int64)
    is_hit, exists = np.zeros(index.shape, dtype=np.bool_), np.zeros(index.shape, dtype=np.bool_)
    beside = np.zeros(index.shape, dtype=np.float32)
    for row, (which, hit, away) in enumerate(picked):
        index[row, : len(which)], is_hit[row, : len(which)], exists[row, : len(which)] = which, hit, True
        beside[row, : len(which)] = away
    points = np.where(is_hit[..., None], beams.points_xy[index], 0.0)
    count = np.maximum(is_hit.sum(axis=1), 1)
    anchors = points.sum(axis=1) / count[:, None]
    # Of two LiDARs on either side the one that has the first hit gives the direction of view.
    origins = beams.origins_xy[index[np.arange(len(index)), np.argmax(is_hit, axis=1)]]
    bearings = np.arctan2(*(anchors - origins).T[::-1])
    c, s = np.cos(bearings)[:, None], np.sin(bearings)[:, None]
    dx, dy = beams.directions_xy[index, 0], beams.directions_xy[index, 1]
    ahead, left = c * dx + s * dy, c * dy - s * dx
    away_xy = anchors[:, None] - beams.origins_xy[index]
    lateral = c * (points[..., 1] - anchors[:, None, 1]) - s * (points[..., 0] - anchors[:, None, 0])
    spacing = np.array([min(beams.spacing_rad[one.sweep] for one in cluster) for cluster in clusters])
    return Windows(
        anchors,
        bearings,
        np.arctan2(left, ahead).astype(np.float32),
        np.stack([ahead, left], axis=-1).astype(np.float32),
        (dx * away_xy[..., 0] + dy * away_xy[..., 1]).astype(np.float32),
        (dx * away_xy[..., 1] - dy * away_xy[..., 0]).astype(np.float32),
        np.where(exists, np.minimum(beams.ranges_m[index], _FAR_M), 0.0).astype(np.float32),
        is_hit,
        beside,
        np.stack(
            [np.where(is_hit, lateral, np.inf).min(axis=1), np.where(is_hit, lateral, -np.inf).max(axis=1)], axis=1
        ),
        spacing * np.hypot(*(anchors - origins).T),
    )


def _beams_of(beams: Beams, cluster: Cluster) -> tuple[NDArray[np.int64], NDArray[np.bool_], Array]:
    """Indices, whether they are hits, and `beside_m`, of the beams of one cluster."""
    hits = {int(i) for segment in cluster for i in segment.hits(beams)}
    which, away = [], []
    for sweep in sorted({segment.sweep for segment in cluster}):
        own = [segment for segment in cluster if segment.sweep == sweep]
        start, count = beams.starts[sweep], beams.starts[sweep + 1] - beams.starts[sweep]
        first, last = _span(own, count)
        inner = _inner(own, first, last, count)
        room = (count - (last - first + 1)) // 2 if beams.is_closed[sweep] else count
        spacing = beams.spacing_rad[sweep] * float(beams.ranges_m[start + first % count])
        steps = _beside(spacing, room)
        outer = np.concatenate([first - steps, last + steps])
        metres = np.tile(steps, 2) * spacing
        inside = np.full(len(outer), True) if beams.is_closed[sweep] else (outer >= 0) & (outer < count)
        which.append(start + np.concatenate([inner, outer[inside]]) % count)
        away.append(np.concatenate([np.zeros(len(inner)), metres[inside]]))
    index = np.concatenate(which)
    return index, np.array([int(i) in hits for i in index], dtype=np.bool_), np.concatenate(away)


def _beside(spacing_m: float, room: int) -> NDArray[np.int64]:
    """How many beams away from the outermost hits to look, at most `room`."""
    step = max(round(_APART_M / spacing_m), 1)
    dense = np.arange(step, max(int(_DENSE_M / spacing_m), 3) + 1, step)
    far = dense[-1] * 2 ** np.arange(1, int(np.log2(max(_FAR_BESIDE_M / (dense[-1] * spacing_m), 1))) + 1)
    steps = np.unique(np.concatenate([[1, 2, 3], dense, far]))
    return steps[steps <= room]


def _span(segments: Sequence[Segment], count: int) -> tuple[int, int]:
    """The first and last beam of segments of one sweep, beyond its end if they lie across its seam."""
    if len(segments) == 1:
        return segments[0].first, segments[0].last
    firsts = sorted((segment.first % count, segment.last - segment.first) for segment in segments)
    gaps = [(firsts[(i + 1) % len(firsts)][0] - first - length) % count for i, (first, length) in enumerate(firsts)]
    begin = (int(np.argmax(gaps)) + 1) % len(firsts)
    first = firsts[begin][0]
    return first, max(first + (other - first) % count + length for other, length in firsts)


def _inner(segments: Sequence[Segment], first: int, last: int, count: int) -> NDArray[np.int64]:
    """The beams from the first to the last of some segments, in each of them and between them thinned alike, so that
    segments look the same alone and together."""
    cuts = sorted({first, *((segment.first - first) % count + first for segment in segments)})
    cuts = sorted({*cuts, *((segment.last + 1 - first) % count + first for segment in segments)} - {first + count})
    runs = np.split(np.arange(first, last + 1), [cut - first for cut in cuts if first < cut <= last])
    return np.concatenate([_thinned(run) for run in runs])


def _thinned(places: NDArray[np.int64]) -> NDArray[np.int64]:
    """Places, evenly thinned where they are more than it takes."""
    if len(places) <= _MOST_HITS:
        return places
    return places[np.linspace(0, len(places) - 1, _MOST_HITS).round().astype(np.int64)]
