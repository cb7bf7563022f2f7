"""The evaluation of a run: what it localized, how far off, and how good its map is."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from mcap_landmarks.evaluation.landmark_metrics import landmark_figures
from mcap_landmarks.evaluation.pose_alignment import PoseAlignment, align_poses
from mcap_landmarks.evaluation.pose_metrics import (
    Figures,
    align,
    axis_figures,
    false_figures,
    heading_figures,
    nees,
    pose_errors,
    position_figures,
    relative_pose_error,
)
from mcap_landmarks.evaluation.trajectory import Indices, PosePairs, Trajectory
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.scene import SceneObjects

Pairing = Callable[[Trajectory, Trajectory], PosePairs]
NOWHERE = Trajectory.of(np.zeros(0, dtype=np.int64), np.zeros((0, 3)))


@dataclass(frozen=True, slots=True, eq=False)
class RunResult:
    """What a run gave: poses, bundles in all and by status, the map it used or made; None where it has none.

    eligible: how many of the bundles hold two distinct objects or more. seen: ids of the matched landmarks by time.
    continuous: whether the poses are one path rather than each of its own. drawn: the landmarks as markers show them,
    where a map was made of the log: they have no covariances, and tentative ones are not among them. residuals_m (K,):
    how far matched objects lie from their landmarks.
    """

    trajectory: Trajectory
    bundles: int
    eligible: int | None = None
    statuses: Mapping[str, int] | None = None
    landmarks: SceneObjects | None = None
    seen: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    continuous: bool = False
    drawn: SceneObjects | None = None
    residuals_m: Array = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """The truth: the robot's poses and the objects of its world, None where unknown."""

    trajectory: Trajectory | None = None
    objects: SceneObjects | None = None

    def over(self, other: "Reference") -> "Reference":
        """This truth, and what it lacks from another."""
        return Reference(self.trajectory or other.trajectory, self.objects or other.objects)


@dataclass(frozen=True, slots=True, eq=False)
class ScoredPoses:
    """K estimated poses that have a reference (K, 3), after the `alignment` if there is one.

    rows (K,) are their places in the estimate.
    """

    rows: Indices
    estimate: Array
    covariances: Array
    reference: Array
    alignment: PoseAlignment | None


def score(estimate: Trajectory, reference: Reference, pairing: Pairing, *, aligned: bool) -> ScoredPoses:
    """Pair poses with the reference in time; `aligned` moves them by the one SE(2) that fits them best.

    Raises:
        UsageError: they cannot be aligned; see `align_poses`.
    """
    rows, truth = pairing(estimate, reference.trajectory or NOWHERE)
    poses, covariances = estimate.poses[rows], estimate.covariances[rows]
    alignment = align_poses(poses, truth) if aligned and len(rows) else None
    if alignment is not None:
        poses, covariances = align(alignment.reference_from_estimate, poses, covariances)
    return ScoredPoses(rows, poses, covariances, truth, alignment)


def frame_note(position: Figures, *, aligned: bool) -> str | None:
    """What to say where most poses lie in another frame than the truth, as those in a map of one's own do."""
    median_m = position["median_m"]
    if aligned or median_m is None or median_m <= 1:
        return None
    return "most poses are over 1 m off; where the map has a frame of its own, --align moves them onto the truth"


class Evaluation(TypedDict):
    """The document of `evaluate --json`, as schemas/json/evaluate.schema.json describes it."""

    bundles: int
    eligible: int | None
    localized: int
    scored: int
    statuses: Mapping[str, int] | None
    false: Figures
    position: Figures
    axis: dict[str, Figures]
    heading: Figures
    nees: float | None
    rpe: float | None
    map: Figures | None
    alignment: dict[str, float | str | None] | None


def evaluate(run: RunResult, reference: Reference, pairing: Pairing, *, aligned: bool = False) -> Evaluation:
    """How good a run and its map are.

    Figures are over scored poses: those that have a reference; figures and shares of nothing are None.

    Raises:
        UsageError: the poses cannot be `aligned`.
    """
    scored = score(run.trajectory, reference, pairing, aligned=aligned)
    errors = pose_errors(scored.estimate, scored.reference)
    landmarks, objects = run.landmarks, reference.objects
    return {
        "bundles": run.bundles,
        "eligible": run.eligible,
        "localized": len(run.trajectory) if run.statuses is None else run.statuses["localized"],
        "scored": len(errors),
        "statuses": run.statuses,
        "false": false_figures(errors),
        "position": position_figures(errors),
        "axis": {
            "x": axis_figures(errors[:, 0], scored.reference[:, 0]),
            "y": axis_figures(errors[:, 1], scored.reference[:, 1]),
        },
        "heading": heading_figures(errors[:, 2]),
        "nees": nees(errors, scored.covariances),
        "rpe": relative_pose_error(scored.estimate, scored.reference),
        "map": None if landmarks is None or objects is None else landmark_figures(landmarks, objects),
        "alignment": scored.alignment.document() if scored.alignment is not None else None,
    }
