"""What the catalog hands out: assets made of textured parts, and how solids and pictures become them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.assets.section import Section
from mcap_landmarks_generator.assets.solid import Floats, Ints, Solid, shade
from mcap_landmarks_generator.assets.texture import Image

ATLAS_WIDTH_PX = 256
CLEAR = "clear"
"""The material of glass."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """One rigid mesh with its texture.

    `vertices` (N,3) in metres, `uv` (N,2) in 0..1 (v up: the texture's first row is v = 1), `normals` (N,3) of unit
    length, `faces` (M,3) counter-clockwise seen from outside, `texture` (H,W,3) RGB. `labelled` is False for what COCO
    does not count as the object, such as a sign's pole. A `clear` one is glass: it is not drawn and throws no shadow.
    """

    vertices: Floats
    uv: Floats
    normals: Floats
    faces: Ints
    texture: Image
    labelled: bool
    clear: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Asset:
    """An object to place: x forward, z up, origin on the ground below the centre of its section at LiDAR height."""

    name: str
    variant: str
    seed: int
    section: Section
    parts: tuple[Part, ...]

    @property
    def bounds_m(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest corner (3,) of all parts."""
        points = np.concatenate([part.vertices for part in self.parts])
        return points.min(axis=0), points.max(axis=0)

    @property
    def footprint_radius_m(self) -> float:
        """Radius of the upright cylinder about the origin that holds every part."""
        return float(max(np.hypot(part.vertices[:, 0], part.vertices[:, 1]).max() for part in self.parts))


@dataclass(frozen=True, slots=True)
class Variant:
    """How to make one kind of a class: its fixed section, its closed solids, and the pictures of their materials.

    `shape` and `paint` get separate random generators.
    """

    section: Section
    shape: Callable[[np.random.Generator], Sequence[Solid]]
    paint: Callable[[np.random.Generator], Mapping[str, Image]]


@dataclass(frozen=True, slots=True)
class AssetClass:
    """One class of objects, its variants by name, the default first.

    A module of this package's `classes`, `distractors` or `structures` declares exactly one, as `CLASS`.
    """

    name: str
    coco_id: int | None
    variants: Mapping[str, Variant]


def assemble(solids: Sequence[Solid], pictures: Mapping[str, Image]) -> tuple[Part, ...]:
    """Parts from solids and the pictures of their materials: one of labelled solids, of others, and of glass."""
    atlas, places = _atlas(pictures)
    parts = []
    opaque, glass = ([solid for solid in solids if (solid.material == CLEAR) == clear] for clear in (False, True))
    for labelled in (True, False):
        chosen = [solid for solid in opaque if solid.labelled == labelled]
        if chosen:
            parts.append(_joined(chosen, atlas, places, labelled))
    if glass:
        parts.append(replace(_joined(glass, atlas, places, False), clear=True))
    return tuple(parts)


def _joined(solids: Sequence[Solid], atlas: Image, places: Mapping[str, NDArray[np.float64]], labelled: bool) -> Part:
    """One part from several solids, shaded each for itself."""
    vertices, uvs, normals, faces, count = [], [], [], [], 0
    for solid in solids:
        points, uv, normal, triangles = shade(solid)
        low, high = places[solid.material]
        vertices.append(points)
        uvs.append(low + (high - low) * np.clip(uv, 0.0, 1.0))
        normals.append(normal)
        faces.append(triangles + count)
        count += len(points)
    return Part(
        np.concatenate(vertices), np.concatenate(uvs), np.concatenate(normals), np.concatenate(faces), atlas, labelled
    )


def _atlas(pictures: Mapping[str, Image]) -> tuple[Image, dict[str, NDArray[np.float64]]]:
    """One texture with every picture on it, and where each lies: low and high uv corner (2,2), half a pixel inside."""
    corners: dict[str, tuple[int, int]] = {}
    x = y = row_height = 0
    for name, picture in sorted(pictures.items(), key=lambda item: (-item[1].shape[0], item[0])):
        height, width = picture.shape[:2]
        if x + width > ATLAS_WIDTH_PX:
            x, y, row_height = 0, y + row_height, 0
        corners[name] = (x, y)
        x, row_height = x + width, max(row_height, height)
    total_px = y + row_height
    atlas = np.zeros((total_px, ATLAS_WIDTH_PX, 3), np.uint8)
    places = {}
    for name, (left, top) in corners.items():
        height, width = pictures[name].shape[:2]
        atlas[top : top + height, left : left + width] = pictures[name]
        low = ((left + 0.5) / ATLAS_WIDTH_PX, 1 - (top + height - 0.5) / total_px)
        high = ((left + width - 0.5) / ATLAS_WIDTH_PX, 1 - (top + 0.5) / total_px)
        places[name] = np.array([low, high])
    return atlas, places
