"""What the beams of a LiDAR of several rings meet: each triangle is held against those beams only that may meet it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.assets.asset import Part
from mcap_landmarks_generator.layout import PlacedObject
from mcap_landmarks_generator.world import Returns

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_ROUNDING = 1e-9
"""So little outside its edges a triangle is still met: between two of them is no gap."""
_AT_ONCE = 8192
"""So many pairs of a beam and a triangle are worked on together: they stay in the processor's cache."""
_LONG = 0.5
"""A triangle whose longest edge exceeds this share of its distance is close or large: its distance is computed."""


class RingCaster:
    """The triangles of all objects of a world.

    PyBullet, which casts the planar LiDAR, takes a ray at a time through lists of Python: nearly three times as long
    for a cloud. Here beams and rings are a grid of angles, and a triangle covers a window of it.
    """

    def __init__(self, objects: Sequence[PlacedObject]) -> None:
        self._names = ("", *sorted({placed.asset.name for placed in objects}))
        self._objects = tuple(objects)
        parts = [(number, part) for number, placed in enumerate(objects) for part in placed.asset.parts]
        self._meshes = _Meshes.of(parts)
        self._name_of = np.array([self._names.index(placed.asset.name) for placed in objects], dtype=np.int64)
        self._vertices = np.zeros_like(self._meshes.vertices)
        self._planes = np.zeros_like(self._meshes.planes)
        for number in range(len(objects)):
            self._put(number, 0.0)

    def returns(
        self, starts: Floats, directions: Floats, reach_m: float, glass_deg: float = 90.0, time_s: float = 0.0
    ) -> Returns:
        """What beams from `starts` (B, 3) along unit vectors `directions` (B, R, 3), rings from below, meet in reach.

        Everyone who walks is where they are at `time_s`. Rows of beam after beam; glass as in `World.returns`.
        """
        for number, placed in enumerate(self._objects):
            if placed.moves:
                self._put(number, time_s)
        beams, rings = directions.shape[:2]
        rays = directions.reshape(-1, 3)
        from_z = np.repeat(starts[:, 2], rings)
        with np.errstate(divide="ignore"):
            ground_m = np.where(rays[:, 2] < 0, -from_z / rays[:, 2], np.inf)
        distances = np.where(ground_m <= reach_m, ground_m, np.inf)
        met = _Met.nothing() if not self._objects else self._met(starts, directions, reach_m)
        through = self._meshes.clear[met.triangle] & (met.cosine < np.cos(np.deg2rad(glass_deg)))
        stops = ~through
        np.minimum.at(distances, met.ray[stops], met.distance_m[stops])
        first = np.flatnonzero(stops & (met.distance_m == distances[met.ray]))
        cosines, names = np.abs(rays[:, 2]), np.zeros(beams * rings, dtype=np.int64)
        cosines[met.ray[first]] = met.cosine[first]
        names[met.ray[first]] = self._name_of[self._meshes.object_of[met.triangle[first]]]
        passed = np.zeros(beams * rings, dtype=np.int64)
        before = through & (met.distance_m < distances[met.ray])
        np.add.at(passed, met.ray[before], 1)
        return Returns(distances, cosines, self._names, names, passed)

    def _put(self, number: int, time_s: float) -> None:
        """Put an object where it is at a time."""
        vertices, triangles = self._meshes.of_object[number]
        x_m, y_m, heading_rad = self._objects[number].pose_at(time_s)
        c, s = np.cos(heading_rad), np.sin(heading_rad)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        place = np.array([x_m, y_m, 0.0])
        self._vertices[vertices] = self._meshes.vertices[vertices] @ turn.T + place
        planes = self._planes[triangles]
        planes[:, :, :3] = self._meshes.planes[triangles, :, :3] @ turn.T
        planes[:, :, 3] = self._meshes.planes[triangles, :, 3] - planes[:, :, :3] @ place

    def _met(self, starts: Floats, directions: Floats, reach_m: float) -> "_Met":
        """Every beam that goes through a triangle that faces it or is glass."""
        grid = _Grid.of(starts, directions)
        front = self._planes[:, 0, :3] @ grid.centre + self._planes[:, 0, 3] > -grid.spread_m
        chosen = np.flatnonzero(front | self._meshes.clear)
        window = grid.windows(self._vertices, self._meshes.faces[:, chosen], reach_m)
        parts = []
        for first in range(0, max(len(window.row), 1), _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            triangle, beam, ring = chosen[window.row[part]], window.beam[part], window.ring[part]
            distance, cosine, inside = _crossed(self._planes[triangle], starts[beam], directions[beam, ring])
            kept = np.flatnonzero(inside & (distance > 0) & (distance <= reach_m))
            ray = beam[kept] * directions.shape[1] + ring[kept]
            parts.append((ray, triangle[kept], distance[kept], cosine[kept]))
        return _Met(*map(np.concatenate, zip(*parts, strict=True)))


@dataclass(frozen=True, slots=True, eq=False)
class _Met:
    """N times a ray meets a triangle: their numbers, the distance, the cosine of the angle to the normal."""

    ray: Ints
    triangle: Ints
    distance_m: Floats
    cosine: Floats

    @classmethod
    def nothing(cls) -> Self:
        none = np.zeros(0, dtype=np.int64)
        return cls(none, none, np.zeros(0), np.zeros(0))


@dataclass(frozen=True, slots=True, eq=False)
class _Meshes:
    """All parts as one mesh, each in its object's frame: vertices (V, 3), faces (3, M), and per face its `_planes`, its
    object's number and whether it is glass; per object its range of vertices and of faces."""

    vertices: Floats
    faces: Ints
    planes: Floats
    object_of: Ints
    clear: Flags
    of_object: dict[int, tuple[slice, slice]]

    @classmethod
    def of(cls, parts: Sequence[tuple[int, Part]]) -> Self:
        """From parts with their objects' numbers, in the order of these."""
        faces, owners, clear = [], [], []
        ranges: dict[int, tuple[slice, slice]] = {}
        vertex = face = 0
        for number, part in parts:
            before = ranges.get(number, (slice(vertex, 0), slice(face, 0)))
            faces.append(part.faces + vertex)
            vertex, face = vertex + len(part.vertices), face + len(part.faces)
            ranges[number] = slice(before[0].start, vertex), slice(before[1].start, face)
            owners.append(np.full(len(part.faces), number))
            clear.append(np.full(len(part.faces), part.clear))
        if not faces:
            none = np.zeros(0, np.int64)
            return cls(np.zeros((0, 3)), np.zeros((3, 0), np.int64), np.zeros((0, 3, 4)), none, none.astype(bool), {})
        vertices, corners = np.concatenate([part.vertices for _, part in parts]), np.concatenate(faces)
        planes = _planes(*(vertices[corners[:, i]] for i in range(3)))
        whole = np.ascontiguousarray(corners.T)
        return cls(vertices, whole, planes, np.concatenate(owners), np.concatenate(clear), ranges)


def _planes(corner: Floats, second: Floats, third: Floats) -> Floats:
    """Of triangles with corners (M, 3) three linear functions (M, 3, 4) of a point: its height above the triangle's
    plane, and its barycentric coordinates u and v. Of a triangle without area they are zero, and no ray meets it."""
    first, second = second - corner, third - corner
    normal = np.cross(first, second)
    square = (normal**2).sum(axis=1, keepdims=True)
    square[square == 0] = np.inf
    rows = np.stack([normal / np.sqrt(square), np.cross(second, normal) / square, np.cross(normal, first) / square], 1)
    offset = -np.einsum("nij,nj->ni", rows, corner)
    return np.concatenate([rows, offset[..., None]], axis=2)


def _crossed(planes: Floats, starts: Floats, rays: Floats) -> tuple[Floats, Floats, Flags]:
    """Where N rays meet the planes (N, 3, 4) of a triangle each: distances, cosines of the angles to their normals, and
    whether within the triangle."""
    slope = np.einsum("nij,nj->in", planes[:, :, :3], rays)
    offset = np.einsum("nij,nj->in", planes[:, :, :3], starts) + planes[:, :, 3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = -offset[0] / slope[0]
        u, v = offset[1:] + distance * slope[1:]
    return distance, np.abs(slope[0]), (u >= -_ROUNDING) & (v >= -_ROUNDING) & (u + v <= 1 + _ROUNDING)


@dataclass(frozen=True, slots=True, eq=False)
class _Windows:
    """Pairs (P,) of a triangle (its row) and a beam and ring that may meet it."""

    row: Ints
    beam: Ints
    ring: Ints


@dataclass(frozen=True, slots=True, eq=False)
class _Grid:
    """Beams by their azimuths in the world and rings by the tangents of their elevations, seen from about one point.

    All starts lie within `spread_m` of `centre` (3,). azimuth (B,) rises, `order` (B,) are its beams; a beam's rings
    lie within `fan_rad` of it. tangent_from, tangent_to (R,) are bounds of each ring's tangents.
    """

    centre: Floats
    spread_m: float
    order: Ints
    azimuth: Floats
    fan_rad: float
    tangent_from: Floats
    tangent_to: Floats

    @classmethod
    def of(cls, starts: Floats, directions: Floats) -> Self:
        """Of beams from starts (B, 3) along directions (B, R, 3), rings from below."""
        centre = (starts.min(axis=0) + starts.max(axis=0)) / 2
        azimuths = np.arctan2(directions[..., 1], directions[..., 0])
        middle = azimuths[:, azimuths.shape[1] // 2]
        fan_rad = float(np.abs((azimuths - middle[:, None] + np.pi) % (2 * np.pi) - np.pi).max())
        tangents = directions[..., 2] / np.hypot(directions[..., 0], directions[..., 1])
        order = np.argsort(middle, kind="stable")
        return cls(
            centre,
            float(np.linalg.norm(starts - centre, axis=1).max()),
            order,
            middle[order],
            fan_rad,
            np.minimum.accumulate(tangents.min(axis=0)[::-1])[::-1],
            np.maximum.accumulate(tangents.max(axis=0)),
        )

    def windows(self, vertices: Floats, faces: Ints, reach_m: float) -> _Windows:
        """The beams and rings that may meet triangles (3, K) within reach."""
        seen = vertices - self.centre
        away = np.hypot(seen[:, 0], seen[:, 1])
        azimuth = np.arctan2(seen[:, 1], seen[:, 0])
        near, far = self._distances(seen, away, faces)
        first, last = self._rings(seen[:, 2], near, far, faces)
        row = np.flatnonzero((last > first) & (near <= reach_m))
        first, rings = first[row], (last - first)[row]
        begin, end = self._beams(azimuth[faces[:, row]], near[row])
        row, first, rings, begin = np.tile(row, 2), np.tile(first, 2), np.tile(rings, 2), begin.ravel()
        beams = end.ravel() - begin
        counts = np.maximum(beams, 0) * rings
        pair = np.repeat(np.arange(len(row)), counts)
        within = np.arange(len(pair)) - np.repeat(np.cumsum(counts) - counts, counts)
        turn, ring = np.divmod(within, rings[pair])
        return _Windows(row[pair], self.order[begin[pair] + turn], first[pair] + ring)

    def _distances(self, seen: Floats, away: Floats, faces: Ints) -> tuple[Floats, Floats]:
        """Bounds (K,) of the level distances of triangles from any start, the lower one zero around a start."""
        corners = away[faces]
        nearest, far = corners.min(axis=0), corners.max(axis=0)
        x, y = seen[:, 0][faces], seen[:, 1][faces]
        edge = np.sqrt(((x - np.roll(x, 1, axis=0)) ** 2 + (y - np.roll(y, 1, axis=0)) ** 2).max(axis=0))
        # No point of a triangle is farther than its longest edge / sqrt(3) from its nearest corner (Jung).
        near = nearest - edge / np.sqrt(3)
        long = np.flatnonzero(edge > _LONG * nearest)
        near[long] = _from_origin(x[:, long], y[:, long])
        return np.maximum(near - self.spread_m, 0.0), far + self.spread_m

    def _rings(self, height: Floats, near: Floats, far: Floats, faces: Ints) -> tuple[Ints, Ints]:
        """The first ring (K,) that may meet each triangle, and the one after the last."""
        corners = height[faces]
        low, high = corners.min(axis=0) - self.spread_m, corners.max(axis=0) + self.spread_m
        with np.errstate(divide="ignore"):
            lowest = low / np.where(low < 0, near, far)
            highest = high / np.where(high > 0, near, far)
        return (
            np.searchsorted(self.tangent_to, lowest, side="left"),
            np.searchsorted(self.tangent_from, highest, side="right"),
        )

    def _beams(self, azimuths: Floats, near: Floats) -> tuple[Ints, Ints]:
        """Ranges (2, K) of beams in order that may meet triangles whose corners are at azimuths (3, K)."""
        ahead = (azimuths[1:] - azimuths[0] + np.pi) % (2 * np.pi) - np.pi
        right, left = np.minimum(ahead.min(axis=0), 0.0), np.maximum(ahead.max(axis=0), 0.0)
        with np.errstate(divide="ignore"):
            beside = np.arcsin(np.minimum(self.spread_m / near, 1.0)) + self.fan_rad + _ROUNDING
        low, width = azimuths[0] + right - beside, left - right + 2 * beside
        around = (near == 0) | (width >= 2 * np.pi)
        low = np.where(around, -np.pi, (low + np.pi) % (2 * np.pi) - np.pi)
        high = np.where(around, np.pi, low + width)
        # What goes on beyond pi is met again from -pi on.
        begin = np.searchsorted(self.azimuth, low, side="left"), np.zeros(len(low), dtype=np.int64)
        again = np.where(around, -np.inf, high - 2 * np.pi)
        end = (np.searchsorted(self.azimuth, edge, side="right") for edge in (high, again))
        return np.array(begin), np.array(list(end))


def _from_origin(x: Floats, y: Floats) -> Floats:
    """Distances (N,) of triangles of the plane with corners (3, N) from the origin, zero inside."""
    along_x, along_y = np.roll(x, -1, axis=0) - x, np.roll(y, -1, axis=0) - y
    square = np.maximum(along_x**2 + along_y**2, np.finfo(float).tiny)
    share = np.clip(-(x * along_x + y * along_y) / square, 0.0, 1.0)
    side = x * along_y - y * along_x
    inside = (side.min(axis=0) >= 0) | (side.max(axis=0) <= 0)
    distance: Floats = np.hypot(x + share * along_x, y + share * along_y).min(axis=0)
    return np.where(inside, 0.0, distance)
