"""The building block of every asset: a closed surface in one material, with its transforms and its shading."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Faces that meet at less than this angle are shaded as one smooth surface.
CREASE_RAD = np.deg2rad(40.0)
WELD_M = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A closed mesh: `vertices` (N,3), `uv` (N,2) in 0..1 within its material, `faces` (M,3) seen counter-clockwise."""

    vertices: Floats
    uv: Floats
    faces: Ints
    material: str
    labelled: bool = True

    def moved(self, x_m: float = 0.0, y_m: float = 0.0, z_m: float = 0.0) -> Self:
        """The solid, shifted."""
        return replace(self, vertices=self.vertices + np.array([x_m, y_m, z_m]))

    def turned(self, axis: ArrayLike, angle_rad: float) -> Self:
        """The solid, rotated about an axis through the origin (right-handed)."""
        return replace(self, vertices=self.vertices @ rotation(axis, angle_rad).T)

    def stretched(self, x: float = 1.0, y: float = 1.0, z: float = 1.0) -> Self:
        """The solid, scaled along the axes by positive factors."""
        return replace(self, vertices=self.vertices * np.array([x, y, z]))

    def mirrored(self) -> Self:
        """The solid's reflection in the plane y = 0, still facing outwards."""
        return replace(self, vertices=self.vertices * np.array([1.0, -1.0, 1.0]), faces=self.faces[:, ::-1])

    def unlabelled(self) -> Self:
        """The solid as a part that COCO does not count as the object (a pole)."""
        return replace(self, labelled=False)


def vector(x: float, y: float, z: float) -> Floats:
    """A vector (3,)."""
    return np.array([x, y, z], dtype=float)


def rotation(axis: ArrayLike, angle_rad: float) -> Floats:
    """Rotation matrix (3,3) about `axis` (Rodrigues)."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle_rad) * cross + (1 - np.cos(angle_rad)) * cross @ cross)


def welded(vertices: Floats) -> Ints:
    """For each vertex (N,3) a number (N,) that vertices at the same place share."""
    _, place = np.unique(np.round(vertices / WELD_M).astype(np.int64), axis=0, return_inverse=True)
    return place.reshape(-1)


def without_slivers(solid: Solid) -> Solid:
    """The solid without faces that touch one place twice, as grids have at their poles."""
    corners = welded(solid.vertices)[solid.faces]
    keep = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    return replace(solid, faces=solid.faces[keep])


def face_normals(vertices: Floats, faces: Ints) -> Floats:
    """Normals (M,3) of faces, as long as twice the face's area."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def shade(solid: Solid) -> tuple[Floats, Floats, Floats, Ints]:
    """Vertices (K,3), uv (K,2), unit normals (K,3) and faces (M,3), split where the surface has a crease.

    A corner's normal is the area-weighted mean over those faces at its place that meet its own face at less than
    `CREASE_RAD`, whatever their uv: seams of the texture stay invisible.
    """
    place = welded(solid.vertices)[solid.faces].ravel()
    weighted = face_normals(solid.vertices, solid.faces)
    unit = weighted / np.linalg.norm(weighted, axis=1, keepdims=True)
    face_of_corner = np.repeat(np.arange(len(solid.faces)), 3)
    first, second = _pairs_at_same_place(place)
    smooth = np.einsum("ij,ij->i", unit[face_of_corner[first]], unit[face_of_corner[second]]) > np.cos(CREASE_RAD)
    normals = np.zeros((len(place), 3))
    np.add.at(normals, first[smooth], weighted[face_of_corner[second[smooth]]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    corner_vertex = solid.faces.ravel()
    keys = np.column_stack([corner_vertex, np.round(normals * 1e4).astype(np.int64)])
    _, kept, faces = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return solid.vertices[corner_vertex[kept]], solid.uv[corner_vertex[kept]], normals[kept], faces.reshape(-1, 3)


def _pairs_at_same_place(place: Ints) -> tuple[Ints, Ints]:
    """All ordered pairs of corners (self-pairs too) that share a place."""
    order = np.argsort(place, kind="stable")
    counts = np.bincount(place)
    starts = np.cumsum(counts) - counts
    partners = counts[place[order]]
    first = np.repeat(order, partners)
    within = np.arange(len(first)) - np.repeat(np.cumsum(partners) - partners, partners)
    return first, order[np.repeat(starts[place[order]], partners) + within]
