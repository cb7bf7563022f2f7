"""The beams that tell where an object is: its hits, what lies between them, and those that pass it by."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.beams import Beams
from mcap_landmarks.lidar.segments import Cluster, Segment

Floats = NDArray[np.float32]

_DENSE_M, _FAR_BESIDE_M, _APART_M = 0.65, 5.0, 0.03
"""Beams are looked at beside the outermost hits: every one that is so far from the next, densely at first."""
_MOST_HITS = 24
"""More hits than these, evenly thinned, say nothing new of where an object is: shapes err by more than noise then."""
_FAR_M = 1e4
"""Stands in for a beam that met nothing: beyond every range, and finite."""


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """P beams, each of one of R rows and those of a row side by side, in the frames of the rows' windows.

    row (P,); all else (P, 1), to stand beside what K cells of the row have: headings_rad, and ahead and left, the same
    as a unit vector; abreast_m and offset_m, where the frame's origin lies along the beam and to its left; ranges_m.
    """

    row: NDArray[np.intp]
    headings_rad: Floats
    ahead: Floats
    left: Floats
    abreast_m: Floats
    offset_m: Floats
    ranges_m: Floats

    def sums(self, values: Floats, rows: int) -> Floats:
        """The sums (R, K) over the beams of each of `rows` rows of values (P, K)."""
        total = np.zeros((rows, values.shape[1]), dtype=np.float32)
        first = np.flatnonzero(np.diff(self.row, prepend=-1))
        if len(first):
            total[self.row[first]] = np.add.reduceat(values, first)
        return total


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """C clusters with B beams together, those of a cluster side by side, in frames of their own: x away from the robot,
    y to the left.

    anchors_xy (C, 2) and bearings_rad (C,): those frames in the base frame, at the mean of the hits. lateral_m (C, 2):
    the rightmost and leftmost hit. spacing_m (C,): the distance of neighbouring beams there. Per beam (B,): cluster,
    whose it is; headings_rad, and directions (B, 2), the same as unit vectors; abreast_m and offset_m, where the
    frame's origin lies along the beam and to its left; ranges_m, very large where a beam met nothing; is_hit, whether
    it met this object; beside_m, how far beyond the outermost hit of its side it passes (0 between hits).
    """

    anchors_xy: Array
    bearings_rad: Array
    lateral_m: Array
    spacing_m: Array
    cluster: NDArray[np.intp]
    headings_rad: Floats
    directions: Floats
    abreast_m: Floats
    offset_m: Floats
    ranges_m: Floats
    is_hit: NDArray[np.bool_]
    beside_m: Floats

    def __len__(self) -> int:
        return len(self.anchors_xy)

    @property
    def hits(self) -> NDArray[np.intp]:
        """How many hits each cluster has (C,)."""
        return np.bincount(self.cluster[self.is_hit], minlength=len(self))

    def rays(self, clusters: NDArray[np.intp], reach_m: Array) -> tuple[Rays, Rays]:
        """The hits, and the other beams, of the clusters of rows (R,); of the latter those that pass within distances
        (R,) of their outermost hits."""
        starts = np.searchsorted(self.cluster, np.arange(len(self) + 1))
        many = np.diff(starts)[clusters]
        row = np.repeat(np.arange(len(clusters)), many)
        beam = np.arange(len(row)) + np.repeat(starts[clusters] - np.cumsum(many) + many, many)
        is_hit = self.is_hit[beam]
        others = ~is_hit & (self.beside_m[beam] <= reach_m[row])
        return self._rays(row[is_hit], beam[is_hit]), self._rays(row[others], beam[others])

    def _rays(self, row: NDArray[np.intp], beam: NDArray[np.intp]) -> Rays:
        beam = beam[:, None]
        return Rays(
            row,
            self.headings_rad[beam],
            self.directions[beam, 0],
            self.directions[beam, 1],
            self.abreast_m[beam],
            self.offset_m[beam],
            self.ranges_m[beam],
        )

    def in_base(self, clusters: NDArray[np.intp], local_xy: Array) -> Array:
        """Points (R, 2) of the frames of clusters (R,) in the base frame."""
        bearings = self.bearings_rad[clusters]
        c, s = np.cos(bearings), np.sin(bearings)
        x, y = local_xy[:, 0], local_xy[:, 1]
        return self.anchors_xy[clusters] + np.stack([c * x - s * y, s * x + c * y], axis=1)


def windows(beams: Beams, clusters: Sequence[Cluster]) -> Windows:
    """The windows of one or more clusters that have at least one hit each."""
    picked = [_beams_of(beams, one) for one in clusters]
    index, is_hit, beside = (np.concatenate(parts) for parts in zip(*picked, strict=True))
    cluster = np.repeat(np.arange(len(clusters)), [len(one) for one, _, _ in picked])
    points, of = beams.points_at(index[is_hit]), cluster[is_hit]
    first = np.searchsorted(of, np.arange(len(clusters)))
    anchors = np.add.reduceat(points, first) / np.bincount(of)[:, None]
    # Of two LiDARs on either side the one that has the first hit gives the direction of view.
    origins = beams.origins_xy[index[is_hit][first]]
    bearings = np.arctan2(*(anchors - origins).T[::-1])
    c, s = np.cos(bearings), np.sin(bearings)
    lateral = c[of] * (points[:, 1] - anchors[of, 1]) - s[of] * (points[:, 0] - anchors[of, 0])
    dx, dy = beams.directions_xy[index].T
    ahead, left = c[cluster] * dx + s[cluster] * dy, c[cluster] * dy - s[cluster] * dx
    away_x, away_y = (anchors[cluster] - beams.origins_xy[index]).T
    spacing = np.array([min(beams.spacing_rad[one.sweep] for one in cluster) for cluster in clusters])
    return Windows(
        anchors,
        bearings,
        np.stack([np.minimum.reduceat(lateral, first), np.maximum.reduceat(lateral, first)], axis=1),
        spacing * np.hypot(*(anchors - origins).T),
        cluster,
        np.arctan2(left, ahead).astype(np.float32),
        np.stack([ahead, left], axis=-1).astype(np.float32),
        (dx * away_x + dy * away_y).astype(np.float32),
        (dx * away_y - dy * away_x).astype(np.float32),
        np.minimum(beams.ranges_m[index], _FAR_M).astype(np.float32),
        is_hit,
        beside.astype(np.float32),
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
