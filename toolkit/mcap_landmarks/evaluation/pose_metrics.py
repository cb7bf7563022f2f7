"""How well estimated poses agree with the reference: pure figures over pairs of poses."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array, between, rotation, transform_points

FALSE_M, FALSE_DEG = 1.0, 20.0
"""A pose that is farther off is false: beyond what a robot could drive on with."""
Figures = dict[str, float | None]
"""Figures by name, None where there is nothing to compute them from."""


def align(reference_from_estimate: Array, poses: Array, covariances: Array) -> tuple[Array, Array]:
    """Poses (N, 3) and covariances (N, 3, 3) of an estimate, moved into the frame of the reference.

    Positions move even where headings are NaN.
    """
    turn = np.eye(3)
    turn[:2, :2] = rotation(reference_from_estimate[2])
    xy = transform_points(reference_from_estimate, poses[:, :2])
    moved = np.column_stack([xy, wrap(poses[:, 2] + reference_from_estimate[2])])
    return moved, turn @ covariances @ turn.T


def pose_errors(estimate: Array, reference: Array) -> Array:
    """Errors (N, 3) in x, y and heading (rad) of poses (N, 3); NaN headings stay NaN."""
    errors = estimate - reference
    errors[:, 2] = wrap(errors[:, 2])
    return errors


def false_figures(errors: Array) -> Figures:
    """Count and share of poses that are more than 1 m or 20 degrees off."""
    far = np.hypot(errors[:, 0], errors[:, 1]) > FALSE_M
    count = int(np.sum(far | (np.abs(np.degrees(errors[:, 2])) > FALSE_DEG)))
    return {"count": count, "share": count / len(errors) if len(errors) else None}


def position_figures(errors: Array) -> Figures:
    """RMSE, median, 95th percentile and largest distance in metres, shares within 0.2 m and 1 m."""
    distance = np.hypot(errors[:, 0], errors[:, 1])
    if not len(distance):
        return dict.fromkeys(("rmse_m", "median_m", "p95_m", "max_m", "within_0_2_m", "within_1_m"))
    return {
        "rmse_m": float(np.sqrt(np.mean(distance**2))),
        "median_m": float(np.median(distance)),
        "p95_m": float(np.percentile(distance, 95)),
        "max_m": float(distance.max()),
        "within_0_2_m": float(np.mean(distance <= 0.2)),
        "within_1_m": float(np.mean(distance <= 1.0)),
    }


def axis_figures(errors: Array, reference: Array) -> Figures:
    """Of one axis, errors (N,) and true coordinates (N,): the thesis's relative figures (section 5.1).

    They depend on where the origin lies. Where the truth is zero, within a micrometre, there are none.
    """
    figures: Figures = dict.fromkeys(
        ("median_abs_m", "mean_relative_percent", "max_relative_percent", "under_5_percent")
    )
    if len(errors):
        figures["median_abs_m"] = float(np.median(np.abs(errors)))
    away = np.abs(reference) >= 1e-6
    if away.any():
        percent = 100 * np.abs(errors[away] / reference[away])
        figures["mean_relative_percent"] = float(percent.mean())
        figures["max_relative_percent"] = float(percent.max())
        figures["under_5_percent"] = float(np.mean(percent < 5))
    return figures


def heading_figures(errors_rad: Array) -> Figures:
    """RMSE and median of the size of heading errors (N,), in degrees; none where headings are unknown."""
    degrees = np.abs(np.degrees(errors_rad[np.isfinite(errors_rad)]))
    if not len(degrees):
        return {"rmse_deg": None, "median_deg": None}
    return {"rmse_deg": float(np.sqrt(np.mean(degrees**2))), "median_deg": float(np.median(degrees))}


def nees(errors: Array, covariances: Array) -> float | None:
    """Mean of errors' (N, 3) squared Mahalanobis distances, over 3: 1 if the covariances (N, 3, 3) are honest.

    Poses with an unknown covariance do not count (Bar-Shalom, Li, Kirubarajan 2001, section 5.4).
    """
    usable = _positive_definite(covariances) & np.isfinite(errors).all(axis=1)
    if not usable.any():
        return None
    weighted = np.linalg.solve(covariances[usable], errors[usable, :, None])[..., 0]
    return float(np.mean(np.sum(errors[usable] * weighted, axis=1)) / 3)


def _positive_definite(covariances: Array) -> NDArray[np.bool_]:
    finite = np.isfinite(covariances).all(axis=(1, 2))
    positive = np.zeros(len(covariances), dtype=np.bool_)
    positive[finite] = np.all(np.linalg.eigvalsh(covariances[finite]) > 0, axis=1)
    return positive


def relative_pose_error(estimate: Array, reference: Array) -> float | None:
    """RMSE in metres of the motion between successive pairs of poses (N, 3), as evo's RPE with a delta of one pose.

    Sturm et al. 2012, section IV; the translation part.
    """
    if len(estimate) < 2 or not np.isfinite(estimate[:, 2]).all():
        return None
    moved, truly = between(estimate[:-1], estimate[1:]), between(reference[:-1], reference[1:])
    off = between(truly, moved)[:, :2]
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
