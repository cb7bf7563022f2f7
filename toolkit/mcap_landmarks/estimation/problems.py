"""A padded batch of pose problems, checked and turned into the arrays that the solver works on."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcap_landmarks.estimation import procrustes
from mcap_landmarks.estimation.linearise import Observations, Poses
from mcap_landmarks.estimation.symmetric import inverse2

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Problems(NamedTuple):
    """B problems of up to K observations: arrays (B, K, ...), the last two None where the caller gave none."""

    landmarks_xy: Array
    range_m: Array
    bearing_rad: Array
    covariance: Array
    landmark_covariance: Array | None
    mask: Bools | None

    @classmethod
    def of(
        cls,
        landmarks_xy: ArrayLike,
        range_m: ArrayLike,
        bearing_rad: ArrayLike,
        covariance: ArrayLike,
        landmark_covariance: ArrayLike | None,
        mask: ArrayLike | None,
    ) -> Self:
        """Broadcast everything to the shape of the ranges."""
        ranges = np.asarray(range_m, dtype=np.float64)
        shape = ranges.shape
        return cls(
            np.broadcast_to(np.asarray(landmarks_xy, dtype=np.float64), (*shape, 2)),
            ranges,
            np.broadcast_to(np.asarray(bearing_rad, dtype=np.float64), shape),
            np.broadcast_to(np.asarray(covariance, dtype=np.float64), (*shape, 2, 2)),
            None
            if landmark_covariance is None
            else np.broadcast_to(np.asarray(landmark_covariance, dtype=np.float64), (*shape, 2, 2)),
            None if mask is None else np.broadcast_to(np.asarray(mask, dtype=np.bool_), shape),
        )

    def prepare(self, part: slice | NDArray[np.int64]) -> tuple[Observations, Poses, Bools]:
        """Observations (K, B) of some problems, weighed by sensor and map, their start poses, and which count."""
        lx, ly = (self.landmarks_xy[part, :, axis].T.copy() for axis in (0, 1))
        range_m, bearing = self.range_m[part].T.copy(), self.bearing_rad[part].T.copy()
        noise = _entries(self.covariance[part])
        used = np.isfinite(lx + ly + range_m + bearing) & _positive(noise, strict=True)
        variance = noise[0] + range_m * range_m * noise[2]
        spread = None
        if self.mask is not None:
            used &= self.mask[part].T
        if self.landmark_covariance is not None:
            spread = _entries(self.landmark_covariance[part])
            used &= _positive(spread, strict=False)
            variance = variance + spread[0] + spread[2]
        if not used.all():
            lx, ly, range_m, bearing = (np.where(used, a, 0.0) for a in (lx, ly, range_m, bearing))
            variance = np.where(used, variance, 1.0)
        ux, uy = np.cos(bearing), np.sin(bearing)
        start = Poses(*procrustes.fit(lx, ly, range_m * ux, range_m * uy, used / variance))
        if spread is not None:
            noise = _add_map(noise, spread, start, ux, uy, range_m)
        if not used.all():
            noise = _where(used, noise)
        return Observations(lx, ly, range_m, ux, uy, *inverse2(*noise)), start, used


Entries = tuple[Array, Array, Array]


def _entries(matrices: Array) -> Entries:
    """The entries xx, xy, yy, each (K, B), of symmetric matrices (B, K, 2, 2)."""
    return matrices[..., 0, 0].T.copy(), matrices[..., 0, 1].T.copy(), matrices[..., 1, 1].T.copy()


def _positive(m: Entries, *, strict: bool) -> Bools:
    """Which matrices are finite and positive definite, or semidefinite if not strict."""
    xx, xy, yy = m
    det = xx * yy - xy * xy
    if strict:
        return (xx > 0) & (yy > 0) & (det > 0) & (xx < np.inf) & (yy < np.inf)
    return (xx >= 0) & (yy >= 0) & (det >= -1e-12 * xx * yy) & (xx < np.inf) & (yy < np.inf)


def _where(used: Bools, m: Entries) -> Entries:
    return np.where(used, m[0], 0.0), np.where(used, m[1], 0.0), np.where(used, m[2], 0.0)


def _add_map(noise: Entries, spread: Entries, poses: Poses, ux: Array, uy: Array, range_m: Array) -> Entries:
    """Noise of range and bearing plus the landmarks' own covariance, along the line of sight and across it."""
    rr, rb, bb = noise
    xx, xy, yy = spread
    nx, ny = poses.cosine * ux - poses.sine * uy, poses.sine * ux + poses.cosine * uy
    per_range = 1 / np.maximum(range_m, 1e-6)
    rr = rr + nx * nx * xx + 2 * nx * ny * xy + ny * ny * yy
    rb = rb + (nx * ny * (yy - xx) + (nx * nx - ny * ny) * xy) * per_range
    bb = bb + (ny * ny * xx - 2 * nx * ny * xy + nx * nx * yy) * per_range * per_range
    return rr, rb, bb
