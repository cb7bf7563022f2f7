"""Horizontal slices of meshes, and how far rays reach before they meet them: an oracle that knows no PyBullet."""

import numpy as np
from mcap_landmarks_generator.assets.asset import Asset
from mcap_landmarks_generator.assets.section import Section
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def segments_at(asset: Asset, height_m: float) -> tuple[Floats, Floats]:
    """Both ends (N,2) of the segments in which a horizontal plane cuts the asset's faces."""
    starts, ends = [], []
    for part in asset.parts:
        corners = part.vertices[part.faces]
        above = corners[..., 2] > height_m
        for triangle, side in zip(corners, above, strict=True):
            if 0 < side.sum() < 3:
                odd = int(np.flatnonzero(side == (side.sum() == 1))[0])
                tip, a, b = triangle[odd], triangle[odd - 1], triangle[odd - 2]
                cut = [tip + (height_m - tip[2]) / (other[2] - tip[2]) * (other - tip) for other in (a, b)]
                starts.append(cut[0][:2])
                ends.append(cut[1][:2])
    return np.array(starts), np.array(ends)


def range_to_segments_m(segments: tuple[Floats, Floats], origins: Floats, directions: Floats) -> Floats:
    """Distance (R,) along rays from `origins` (R,2) to the first segment, infinite where there is none."""
    start, edge = segments[0][None], (segments[1] - segments[0])[None]
    offset = start - origins[:, None]
    d = directions[:, None]
    determinant = d[..., 0] * edge[..., 1] - d[..., 1] * edge[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (offset[..., 0] * edge[..., 1] - offset[..., 1] * edge[..., 0]) / determinant
        share = (offset[..., 0] * d[..., 1] - offset[..., 1] * d[..., 0]) / determinant
    hit = (share >= 0) & (share <= 1) & (along > 0)
    return np.where(hit, along, np.inf).min(axis=1)


def range_to_section_m(section: Section, origins: Floats, directions: Floats, limit_m: float = 12.0) -> Floats:
    """Distance (R,) along rays to a declared section, by sphere tracing; infinite where it is missed."""
    travelled = np.zeros(len(origins))
    for _ in range(80):
        gap = section.signed_distance_m(origins + travelled[:, None] * directions)
        travelled = np.minimum(travelled + np.maximum(gap, 0.0), limit_m)
    return np.where(gap < 1e-3, travelled, np.inf)


def rays_around(radius_m: float, count: int = 48, offsets: int = 9) -> tuple[Floats, Floats]:
    """Parallel bundles of rays (R,2), (R,2) from all sides across a disc of `radius_m` about the origin."""
    heading = np.repeat(2 * np.pi * np.arange(count) / count + 0.013, offsets)
    shift = np.tile(np.linspace(-radius_m, radius_m, offsets) * 0.97, count)
    inwards = -np.column_stack([np.cos(heading), np.sin(heading)])
    sideways = np.column_stack([-np.sin(heading), np.cos(heading)])
    return -inwards * (radius_m + 2.0) + sideways * shift[:, None], inwards
