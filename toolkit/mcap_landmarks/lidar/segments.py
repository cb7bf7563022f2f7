"""Segments of a scan: runs of neighbouring beams that met one surface."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.beams import Beams

_LONGEST_GAP = 1
"""So many beams in a row may meet nothing between two hits of one segment: LiDARs lose some."""


@dataclass(frozen=True, slots=True)
class Breaks:
    """When neighbouring hits belong to two surfaces.

    `incidence_rad`: no surface is met at a smaller angle (lambda of Borges and Aldon 2004, about 10 degrees);
    `sigma_m`: noise of a range; `link_m`: hits of one piece are no farther apart, whatever the angle.
    """

    incidence_rad: float
    sigma_m: float
    link_m: float


@dataclass(frozen=True, slots=True)
class Segment:
    """Beams `first` to `last` of a sweep, counted from its start; beyond its end they go on at its start."""

    sweep: int
    first: int
    last: int

    def beams(self, beams: Beams) -> NDArray[np.int64]:
        """The indices (K,) of the beams, hits or not."""
        start, end = beams.starts[self.sweep], beams.starts[self.sweep + 1]
        return start + np.arange(self.first, self.last + 1) % (end - start)

    def hits(self, beams: Beams) -> NDArray[np.int64]:
        """The indices of the beams that met something."""
        found = self.beams(beams)
        return found[np.isfinite(beams.ranges_m[found])]


Cluster = tuple[Segment, ...]
"""The segments that make one object."""


def gap_m(first_xy: Array, second_xy: Array) -> float:
    """The distance between the nearest of points (N, 2) and (M, 2)."""
    offsets = first_xy[:, None] - second_xy
    return float(np.sqrt((offsets**2).sum(axis=-1).min()))


def hits_of(beams: Beams, cluster: Cluster) -> NDArray[np.int64]:
    """The indices (N,) of the hits of a cluster."""
    return np.concatenate([segment.hits(beams) for segment in cluster])


def points_of(beams: Beams, cluster: Cluster) -> Array:
    """The hits (N, 2) of a cluster."""
    return beams.points_at(hits_of(beams, cluster))


def near_clusters(beams: Beams, found: Sequence[Segment], near_m: float) -> list[Cluster]:
    """Segments as clusters, those together that are no more than `near_m` from one another, whatever lies behind."""
    if not found:
        return []
    hits = [points_of(beams, (segment,)) for segment in found]
    x, y = np.concatenate(hits).T
    starts = np.cumsum([0, *(len(points) for points in hits[:-1])])
    near = (x[:, None] - x) ** 2 + (y[:, None] - y) ** 2 <= near_m**2
    touching = np.logical_or.reduceat(np.logical_or.reduceat(near, starts, axis=0), starts, axis=1)
    clusters: list[Cluster] = []
    left = np.ones(len(found), dtype=np.bool_)
    while left.any():
        members = np.arange(len(found)) == np.argmax(left)
        while (grown := touching[members].any(axis=0)).sum() > members.sum():
            members = grown
        left &= ~members
        clusters.append(tuple(found[i] for i in np.flatnonzero(members).tolist()))
    return clusters


def extent_m(points_xy: Array) -> float:
    """The largest distance between two of the points (N, 2)."""
    offsets = points_xy[:, None] - points_xy
    return float(np.hypot(offsets[..., 0], offsets[..., 1]).max())


def farthest_link(near_m: Array, apart_rad: Array, breaks: Breaks) -> Array:
    """D_max: how far apart two hits of one surface can be at most, the nearer at a range, at an angle to each other.

    Borges and Aldon 2004: r sin(dphi) / sin(lambda - dphi) + 3 sigma.
    """
    spare = np.maximum(breaks.incidence_rad - apart_rad, breaks.incidence_rad / 4)
    reach: Array = near_m * np.sin(apart_rad) / np.sin(spare) + 3 * breaks.sigma_m
    return reach


def segments(beams: Beams, breaks: Breaks, largest_m: float) -> list[Segment]:
    """The pieces of a scan that can be objects: none larger than `largest_m`, nothing out of a larger surface.

    Surfaces end where neighbouring hits are farther apart than any surface explains, and fall into pieces where they
    are farther apart than `link_m`. Of a surface that is too large, such as a wall, only pieces in front of what lies
    to both their sides remain: something that stands before it. What is seen between two nearer things is left out.
    """
    found = []
    for number in range(len(beams.spacing_rad)):
        for surface in _surfaces(beams, number, breaks):
            pieces = [] if surface.is_hidden else _pieces(surface, breaks)
            if surface.size_m <= largest_m:
                found += [surface.segment(number, *piece) for piece in pieces]
            else:
                found += [
                    surface.segment(number, first, last)
                    for first, last in pieces
                    if extent_m(surface.points_xy[first : last + 1]) <= largest_m and surface.stands_out(first, last)
                ]
    return found


@dataclass(frozen=True, slots=True, eq=False)
class _Surface:
    """Hits in a row: their positions in the sweep, points, and ranges, and those of the beams before and after them."""

    places: NDArray[np.int64]
    points_xy: Array
    ranges_m: Array
    beside_m: tuple[float, float]

    @property
    def size_m(self) -> float:
        """The diagonal of the box around the hits: a bound that is cheap for long walls."""
        return float(np.hypot(*np.ptp(self.points_xy, axis=0)))

    @property
    def is_hidden(self) -> bool:
        """Whether nearer things stand before both ends: what is seen between them is no more than a part."""
        return bool(self.beside_m[0] < self.ranges_m[0] and self.beside_m[1] < self.ranges_m[-1])

    def segment(self, sweep: int, first: int, last: int) -> Segment:
        """Hits `first` to `last` as a segment."""
        return Segment(sweep, int(self.places[first]), int(self.places[last]))

    def stands_out(self, first: int, last: int) -> bool:
        """Whether the surface goes on behind hits `first` to `last`, at both ends."""
        if first == 0 or last == len(self.places) - 1:
            return False
        return bool(self.ranges_m[first - 1] > self.ranges_m[first] and self.ranges_m[last + 1] > self.ranges_m[last])


def _surfaces(beams: Beams, number: int, breaks: Breaks) -> Iterator[_Surface]:
    """The surfaces of a sweep."""
    start, end = beams.starts[number], beams.starts[number + 1]
    ranges, angles = beams.ranges_m[start:end], beams.angles_rad[start:end]
    hit = np.flatnonzero(np.isfinite(ranges))
    if not len(hit):
        return
    following, points = np.roll(hit, -1), beams.points_at(start + hit)
    steps = (following - hit) % (end - start) if len(hit) > 1 else np.array([end - start])
    apart = (angles[following] - angles[hit]) % (2 * np.pi)
    gaps = np.hypot(*(np.roll(points, -1, axis=0) - points).T)
    near = np.minimum(ranges[hit], ranges[following])
    linked = (steps <= _LONGEST_GAP + 1) & (apart <= (_LONGEST_GAP + 2) * beams.spacing_rad[number] * 1.25)
    linked &= gaps <= farthest_link(near, np.minimum(apart, np.pi / 2), breaks)
    if not beams.is_closed[number]:
        linked[-1] = False
    ends = np.flatnonzero(~linked)
    if not len(ends):  # one surface all around
        ends = np.array([len(hit) - 1])
    for before, last in zip(np.roll(ends, 1), ends, strict=True):
        count = (last - before - 1) % len(hit) + 1
        rows = (before + 1 + np.arange(count)) % len(hit)
        places = hit[rows]
        places = places + np.concatenate([[0], np.cumsum(np.diff(places) < 0)]) * (end - start)
        ends_m = (_range_at(beams, number, int(places[0]) - 1), _range_at(beams, number, int(places[-1]) + 1))
        yield _Surface(places, points[rows], ranges[hit[rows]], ends_m)


def _range_at(beams: Beams, number: int, place: int) -> float:
    """The range of a beam of a sweep; infinite beyond the ends of one that does not close."""
    start, count = beams.starts[number], beams.starts[number + 1] - beams.starts[number]
    known = beams.is_closed[number] or 0 <= place < count
    return float(beams.ranges_m[start + place % count]) if known else np.inf


def _pieces(surface: _Surface, breaks: Breaks) -> list[tuple[int, int]]:
    """The first and last hit of each piece of a surface."""
    gaps = np.hypot(*np.diff(surface.points_xy, axis=0).T)
    cuts = np.flatnonzero(gaps > breaks.link_m + 3 * breaks.sigma_m)
    return list(zip([0, *(cuts + 1).tolist()], [*cuts.tolist(), len(surface.places) - 1], strict=True))
