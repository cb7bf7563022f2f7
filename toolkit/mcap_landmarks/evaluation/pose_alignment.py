"""The one SE(2) that brings estimated poses onto the truth, and whether their positions or headings tell its turn."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.special import ndtri, stdtrit

from mcap_landmarks.errors import UsageError
from mcap_landmarks.evaluation.alignment import fit, transform_document
from mcap_landmarks.evaluation.pose_metrics import FALSE_DEG
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array, rotation, transform_points

_SURE_RAD = float(np.radians(1.0))
"""Positions that tell the rotation this well are enough, as for evo: a twentieth of what makes a heading false."""
_OPEN_RAD = float(np.radians(FALSE_DEG / 3))
"""With a larger sigma than this the alignment itself, within three of them, could make every heading false."""


class RotationFrom(StrEnum):
    """What told the rotation of an alignment."""

    POSITIONS = "positions"
    HEADINGS = "headings"


@dataclass(frozen=True, slots=True, eq=False)
class PoseAlignment:
    """reference_from_estimate (3,), what its rotation comes from, and how surely: NaN where one pose alone tells it."""

    reference_from_estimate: Array
    rotation_from: RotationFrom
    rotation_sigma_rad: float

    def document(self) -> dict[str, float | str | None]:
        """The field `alignment` of an evaluation, in metres and degrees."""
        sigma = float(np.degrees(self.rotation_sigma_rad))
        return {
            **transform_document(self.reference_from_estimate),
            "rotation_from": self.rotation_from.value,
            "rotation_sigma_deg": sigma if np.isfinite(sigma) else None,
        }


def align_poses(estimate: Array, reference: Array) -> PoseAlignment:
    """The alignment of poses (N, 3), one or more, with those that belong to them (N, 3).

    It fits the positions best (Umeyama 1991, without scale) where they tell the rotation to a degree. Where they hardly
    move in comparison with their errors, headings tell it, if they do so better: by their circular mean (Mardia and
    Jupp 2000, section 2.2).

    Raises:
        UsageError: neither tells the rotation.
    """
    transform, sigma = _by_positions(estimate[:, :2], reference[:, :2])
    if sigma <= _SURE_RAD:
        return PoseAlignment(transform, RotationFrom.POSITIONS, sigma)
    turn, heading_sigma = _by_headings(estimate[:, 2], reference[:, 2])
    if np.isfinite(turn) and not heading_sigma > min(sigma, _OPEN_RAD):
        middle = reference[:, :2].mean(axis=0) - rotation(turn) @ estimate[:, :2].mean(axis=0)
        return PoseAlignment(np.array([*middle, turn]), RotationFrom.HEADINGS, heading_sigma)
    if sigma <= _OPEN_RAD:
        return PoseAlignment(transform, RotationFrom.POSITIONS, sigma)
    raise UsageError(_refusal(estimate, reference))


def _by_positions(estimate_xy: Array, reference_xy: Array) -> tuple[Array, float]:
    """The best fit and the sigma of its rotation, of linear least squares around it.

    The squared residuals' sum R over the 2 N - 3 degrees of freedom is the variance of a coordinate's error. Turning
    the points by a small angle a adds C a^2 to R, where C is the sum over the points of the products of what is known
    of them on both sides, from their middle on: their spread. So the variance of the rotation is R / (2 N - 3) / C.
    Of few points the errors' size is hardly known: the sigma is as much larger as Student's t is wider than the normal
    distribution, where each holds 95 %.
    """
    transform = fit(estimate_xy, reference_xy)
    residual = reference_xy - transform_points(transform, estimate_xy)
    turned = transform_points(np.array([0, 0, transform[2]]), estimate_xy - estimate_xy.mean(axis=0))
    spread = float(np.sum(turned * (reference_xy - reference_xy.mean(axis=0))))
    freedom = 2 * len(estimate_xy) - 3
    # What floating point leaves of points that coincide is no spread.
    if freedom < 1 or spread <= len(estimate_xy) * (1e-12 * (1 + float(np.abs(reference_xy).max()))) ** 2:
        return transform, np.inf
    sigma = np.sqrt(np.sum(residual**2) / freedom / spread)
    return transform, float(sigma * stdtrit(freedom, 0.975) / ndtri(0.975))


def _by_headings(estimate_rad: Array, reference_rad: Array) -> tuple[float, float]:
    """The rotation that headings tell and its sigma, NaN of one heading; both NaN where none are known."""
    apart = reference_rad - estimate_rad
    apart = apart[np.isfinite(apart)]
    if not len(apart):
        return np.nan, np.nan
    turn = float(np.arctan2(np.sin(apart).mean(), np.cos(apart).mean()))
    if len(apart) == 1:
        return turn, np.nan
    return turn, float(np.sqrt(np.sum(wrap(apart - turn) ** 2) / (len(apart) - 1) / len(apart)))


def _refusal(estimate: Array, reference: Array) -> str:
    truth, found = (float(np.sqrt(poses[:, :2].var(axis=0).sum())) for poses in (reference, estimate))
    headings = np.isfinite(estimate[:, 2] - reference[:, 2]).any()
    return (
        f"the {len(estimate)} poses hardly move in comparison with their errors (by {truth:.3g} m around their middle "
        f"in truth, by {found:.3g} m as estimated): their positions leave the rotation of --align open, and "
        f"{'their headings tell too many' if headings else 'no headings are known'}; go without --align, or take more "
        "of a drive"
    )
