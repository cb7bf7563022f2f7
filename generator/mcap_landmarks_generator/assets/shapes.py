"""Solids from few numbers: lofts through rings, and what follows from them (lathe, limb, boxes, ellipsoid, torus)."""

import numpy as np
from numpy.typing import ArrayLike

from mcap_landmarks_generator.assets.solid import Floats, Solid, without_slivers


def circle(radius_m: float = 1.0, sides: int = 16, start_rad: float = 0.0) -> Floats:
    """Counter-clockwise polygon (sides,2) whose mean radius is `radius_m`, so that facets do not shrink a section."""
    angle = start_rad + 2 * np.pi * np.arange(sides) / sides
    half = np.pi / sides
    mean = np.cos(half) * np.log(np.tan(half) + 1 / np.cos(half)) / half
    return np.asarray(radius_m / mean * np.column_stack([np.cos(angle), np.sin(angle)]))


def rounded_rectangle(length_m: float, width_m: float, corner_m: float, arc_points: int = 4) -> Floats:
    """Counter-clockwise polygon (4 * arc_points, 2) with quarter circles at its corners."""
    quarter = np.linspace(0.0, np.pi / 2, arc_points)
    x, y = length_m / 2 - corner_m, width_m / 2 - corner_m
    corners = []
    for turn, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        angle = quarter + turn * np.pi / 2
        corners.append(np.column_stack([sx * x + corner_m * np.cos(angle), sy * y + corner_m * np.sin(angle)]))
    return np.concatenate(corners)


def surface(points: Floats, material: str, uv: Floats | None = None) -> Solid:
    """A grid of points (A,B,3); seen from outside, the second index runs counter-clockwise about the first."""
    a, b = points.shape[:2]
    if uv is None:
        v, u = np.meshgrid(np.linspace(0, 1, a), np.linspace(0, 1, b), indexing="ij")
        uv = np.stack([u, v], axis=-1)
    index = np.arange(a * b).reshape(a, b)
    p, q, r, s = (i.ravel() for i in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.column_stack([p, q, r]), np.column_stack([p, r, s])])
    return without_slivers(Solid(points.reshape(-1, 3), np.asarray(uv, float).reshape(-1, 2), faces, material))


def loft(rings: ArrayLike, material: str, u: ArrayLike | None = None, v: ArrayLike | None = None) -> Solid:
    """A skin over rings (K,N,3), each counter-clockwise about the direction in which they follow, closed at both ends.

    The texture's `u` (N+1,) runs around the rings, `v` (K,) along them; by default evenly, and by length with the ends.
    """
    open_rings = np.asarray(rings, float)
    capped = np.concatenate([_shrunk(open_rings[:1]), open_rings, _shrunk(open_rings[-1:])])
    closed = np.concatenate([capped, capped[:, :1]], axis=1)
    if v is None:
        steps = np.linalg.norm(np.diff(closed, axis=0), axis=2).mean(axis=1)
        along = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    else:
        along = np.pad(np.asarray(v, float), 1, mode="edge")
    around = np.linspace(0.0, 1.0, closed.shape[1]) if u is None else np.asarray(u, float)
    return surface(closed, material, np.stack(np.broadcast_arrays(around[None, :], along[:, None]), axis=-1))


def _shrunk(rings: Floats) -> Floats:
    """The rings, drawn together to their centres."""
    return np.broadcast_to(rings.mean(axis=1, keepdims=True), rings.shape)


def stack(outlines: list[tuple[float, Floats]], material: str) -> Solid:
    """A loft upwards through (z, outline (N,2)) pairs."""
    return loft([np.column_stack([outline, np.full(len(outline), z)]) for z, outline in outlines], material)


def lathe(profile: ArrayLike, material: str, sides: int = 16) -> Solid:
    """A solid of revolution about z from (radius, z) pairs that go upwards."""
    ring = circle(1.0, sides)
    return stack([(z, np.maximum(radius, 0.0) * ring) for radius, z in np.asarray(profile, float)], material)


def limb(spine: ArrayLike, radii: ArrayLike, material: str, sides: int = 10, front: ArrayLike = (1, 0, 0)) -> Solid:
    """A bent rod along `spine` (K,3), `radii` () or (K,) or (K,2); the first radius starts out towards `front`."""
    centres = np.asarray(spine, float)
    size = np.asarray(radii, float)
    if size.ndim < 2:
        size = np.broadcast_to(size[..., None] if size.ndim else size, (len(centres), 2))
    along = np.gradient(centres, axis=0) if len(centres) > 2 else np.tile(centres[-1] - centres[0], (2, 1))
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    ring = circle(1.0, sides)
    side = np.asarray(front, float)
    if abs(side @ along[0]) > 0.95 * np.linalg.norm(side):
        side = np.array([0.0, 0.0, 1.0]) if abs(along[0, 2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    rings = []
    for centre, direction, (a, b) in zip(centres, along, size, strict=True):
        side = side - direction * (side @ direction)
        side = side / np.linalg.norm(side)
        other = np.cross(direction, side)
        rings.append(centre + a * ring[:, :1] * side + b * ring[:, 1:] * other)
    return loft(rings, material)


def box(length_m: float, width_m: float, height_m: float, material: str) -> Solid:
    """A box centred on the origin; every face shows the whole texture, upright on the sides."""
    half = np.array([length_m, width_m, height_m]) / 2
    sides = [((1, 0, 0), (0, 1, 0)), ((-1, 0, 0), (0, -1, 0)), ((0, 1, 0), (-1, 0, 0)), ((0, -1, 0), (1, 0, 0))]
    planes = [(np.array(out), np.array(right), np.array([0, 0, 1])) for out, right in sides]
    planes += [(np.array([0, 0, z]), np.array([0, -1, 0]), np.array([z, 0, 0])) for z in (1, -1)]
    vertices, uv, faces = [], [], []
    for face, (out, right, up) in enumerate(planes):
        for u, v in ((0, 0), (1, 0), (1, 1), (0, 1)):
            vertices.append((out + (2 * u - 1) * right + (2 * v - 1) * up) * half)
            uv.append((u, v))
        faces += [(4 * face, 4 * face + 1, 4 * face + 2), (4 * face, 4 * face + 2, 4 * face + 3)]
    return Solid(np.array(vertices, float), np.array(uv, float), np.array(faces), material)


def rounded_box(
    length_m: float, width_m: float, height_m: float, corner_m: float, material: str, edge_m: float
) -> Solid:
    """A box centred on the origin, its upright edges rounded by `corner_m`, its top and bottom edges by `edge_m`."""
    turn = np.linspace(0.0, np.pi / 2, 4)
    inset = edge_m * (1 - np.sin(turn))
    depth = edge_m * (1 - np.cos(turn))
    outlines = [rounded_rectangle(length_m - 2 * i, width_m - 2 * i, max(corner_m - i, 1e-3)) for i in inset]
    below = [(d - height_m / 2, outline) for d, outline in zip(depth, outlines, strict=True)]
    above = [(height_m / 2 - d, outline) for d, outline in zip(depth, outlines, strict=True)]
    return stack(below + above[::-1], material)


def ellipsoid(
    length_m: float, width_m: float, height_m: float, material: str, sides: int = 12, rings: int = 8
) -> Solid:
    """An ellipsoid about the origin with the given diameters, its poles on z."""
    polar = np.linspace(-np.pi / 2, np.pi / 2, rings)
    profile = np.column_stack([np.cos(polar), np.sin(polar)]) / 2
    return lathe(profile, material, sides).stretched(length_m, width_m, height_m)


def torus(radius_m: float, tube_m: float, material: str, sides: int = 24, tube_sides: int = 6) -> Solid:
    """A ring about the y axis (a wheel that rolls along x)."""
    around = 2 * np.pi * np.arange(sides + 1) / sides
    across = 2 * np.pi * np.arange(tube_sides + 1) / tube_sides
    reach = radius_m + tube_m * np.cos(across)[None, :]
    points = np.stack(
        [
            reach * np.cos(around)[:, None],
            np.broadcast_to(tube_m * np.sin(across)[None, :], (sides + 1, tube_sides + 1)),
            reach * np.sin(around)[:, None],
        ],
        axis=-1,
    )
    return surface(points, material)


def sheet(points: Floats, material: str) -> Solid:
    """A thin surface from a grid (A,B,3) that is seen from both sides."""
    front = surface(points, material)
    return Solid(front.vertices, front.uv, np.concatenate([front.faces, front.faces[:, ::-1]]), material)
