"""Positions from ranges to known landmarks alone: with no bearing there is no heading, and often a mirror image."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# All problems take so many steps. Of made-up ones with three landmarks 86 % converge in three, 99.7 % in so many; the
# others lie close to the landmarks' line, where chi2 is nearly flat across it.
_ITERATIONS = 20
# A step shorter than a thousandth of a standard deviation is short enough: its squared Mahalanobis length.
_CONVERGED = 1e-6
# A step that is damped more is short whatever is left to go.
_LITTLE_DAMPING = 1e-3
# A determinant this small beside its matrix's diagonal is rounding noise.
_SINGULAR = 1e-12


@dataclass(frozen=True, slots=True)
class PositionSolutions:
    """Two positions (B, 2, 2) for each of B problems, the better first, with covariance (B, 2, 2, 2) and chi2 (B, 2).

    The second lies on the other side of the line that the landmarks spread along; landmarks in one line leave both
    equal in `chi2`. Where the geometry leaves a position open the covariance's diagonal is infinite. `dof` (B,) is
    k - 2.

    `converged` (B, 2) says whether the next step would be shorter than a thousandth of a standard deviation and the
    position is not open, `iterations` (B, 2) after how many steps that was so; `chi2` is the cost.
    """

    position_xy: Array
    covariance: Array
    chi2: Array
    dof: NDArray[np.int64]
    converged: NDArray[np.bool_]
    iterations: NDArray[np.int64]


def solve_ranges(
    landmarks_xy: ArrayLike, range_m: ArrayLike, variance: ArrayLike, *, mask: ArrayLike | None = None
) -> PositionSolutions:
    """Positions at ranges (B, K) with variance (B, K) in m^2 from three or more landmarks (B, K, 2).

    From the linear solution along the landmarks' main direction and its mirror image on by damped Gauss-Newton. What is
    masked or not finite does not count.
    """
    ranges = np.asarray(range_m, dtype=np.float64)
    landmarks = np.broadcast_to(np.asarray(landmarks_xy, dtype=np.float64), (*ranges.shape, 2))
    noise = np.broadcast_to(np.asarray(variance, dtype=np.float64), ranges.shape)
    used = np.isfinite(ranges + landmarks.sum(axis=2)) & (noise > 0) & (noise < np.inf)
    if mask is not None:
        used &= np.asarray(mask, dtype=np.bool_)
    weight = np.where(used, 1 / np.where(used, noise, 1.0), 0.0)
    landmarks, ranges = np.where(used[..., None], landmarks, 0.0), np.where(used, ranges, 0.0)
    both = [_refine(start, landmarks, ranges, weight) for start in _mirrored_starts(landmarks, ranges, weight)]
    position, covariance, chi2, converged, steps = (np.stack(parts, axis=1) for parts in zip(*both, strict=True))
    at = np.arange(len(ranges))[:, None], np.argsort(chi2, axis=1, kind="stable")
    dof = np.maximum(used.sum(axis=1) - 2, 0)
    return PositionSolutions(position[at], covariance[at], chi2[at], dof, converged[at], steps[at])


def _mirrored_starts(landmarks: Array, ranges: Array, weight: Array) -> tuple[Array, Array]:
    """Start positions (B, 2) on both sides of the landmarks' main axis."""
    total = weight.sum(axis=1, keepdims=True)
    share = weight / np.where(total > 0, total, 1.0)
    middle = (share[..., None] * landmarks).sum(axis=1)
    d = landmarks - middle[:, None]
    xx, yy, xy = (
        (share * d[..., 0] ** 2).sum(1),
        (share * d[..., 1] ** 2).sum(1),
        (share * d[..., 0] * d[..., 1]).sum(1),
    )
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    along, across = np.stack([np.cos(angle), np.sin(angle)], 1), np.stack([-np.sin(angle), np.cos(angle)], 1)
    # |d - p|^2 = r^2 less its mean over the landmarks is linear in p.
    u = (d * along[:, None]).sum(axis=2)
    half = ((d**2).sum(axis=2) - ranges**2) / 2
    spread = (share * u * u).sum(axis=1)
    u_position = (share * u * half).sum(axis=1) / np.where(spread > 0, spread, 1.0)
    height = np.sqrt(np.maximum(-2 * (share * half).sum(axis=1) - u_position**2, 0.0))
    foot = middle + u_position[:, None] * along
    return foot + height[:, None] * across, foot - height[:, None] * across


def _refine(
    start: Array, landmarks: Array, ranges: Array, weight: Array
) -> tuple[Array, Array, Array, NDArray[np.bool_], NDArray[np.int64]]:
    """Positions (B, 2) of least chi2 near the starts, covariance (B, 2, 2), chi2, who converged, and when."""
    position, damping = start, np.full(len(start), 1e-6)
    information, right, chi2 = _normal(position, landmarks, ranges, weight)
    steps, short = np.zeros(len(start), dtype=np.int64), np.zeros(len(start), dtype=np.bool_)
    for _ in range(_ITERATIONS):
        diagonal = np.eye(2) * information
        damped = information + damping[:, None, None] * diagonal + 1e-12 * np.eye(2)
        step = np.linalg.solve(damped, right[..., None])[..., 0]
        short |= ((step * right).sum(axis=1) < _CONVERGED) & (damping <= _LITTLE_DAMPING)
        steps += ~short
        trial = position + step
        new = _normal(trial, landmarks, ranges, weight)
        better = new[2] <= chi2
        position = np.where(better[:, None], trial, position)
        information = np.where(better[:, None, None], new[0], information)
        right, chi2 = np.where(better[:, None], new[1], right), np.where(better, new[2], chi2)
        damping = np.where(better, damping / 10, damping * 10)
    det = np.linalg.det(information)
    regular = det > _SINGULAR * information[:, 0, 0] * information[:, 1, 1]
    covariance = np.linalg.inv(np.where(regular[:, None, None], information, np.eye(2)))
    covariance = np.where(regular[:, None, None], covariance, np.diag([np.inf, np.inf]))
    return position, covariance, chi2, short & regular, steps


def _normal(position: Array, landmarks: Array, ranges: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Gauss-Newton's information (B, 2, 2), right-hand side (B, 2) and chi2 (B,)."""
    d = position[:, None] - landmarks
    distance = np.maximum(np.hypot(d[..., 0], d[..., 1]), 1e-9)
    outward = d / distance[..., None]
    residual = ranges - distance
    information = np.einsum("bk,bki,bkj->bij", weight, outward, outward)
    right = np.einsum("bk,bki->bi", weight * residual, outward)
    return information, right, (weight * residual**2).sum(axis=1)
