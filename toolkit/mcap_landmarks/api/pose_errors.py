"""The errors of a run, pose by pose, beside its figures."""

from dataclasses import dataclass

import numpy as np

from mcap_landmarks.evaluation.evaluate import EvaluatedRun
from mcap_landmarks.evaluation.metrics import Evaluation, score
from mcap_landmarks.evaluation.pose_metrics import pose_errors
from mcap_landmarks.structured import StructuredArray, moments


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class EvaluationResult:
    """`figures` is the document of `evaluate --json`; `errors` has a row per pose that has a truth; see docs/api.md.

    `losses` are what could not be read.
    """

    figures: Evaluation
    errors: StructuredArray
    losses: tuple[str, ...]

    @classmethod
    def of(cls, found: EvaluatedRun, *, aligned: bool) -> "EvaluationResult":
        """The result of a run that was evaluated; `aligned` as it was."""
        scored = score(found.run.trajectory, found.truth, found.pairing, aligned=aligned)
        errors, stamp_ns = pose_errors(scored.estimate, scored.reference), found.run.trajectory.time_ns[scored.rows]
        names = "x_m", "y_m", "heading_rad"
        columns = {
            **{name: scored.estimate[:, i] for i, name in enumerate(names)},
            **{f"true_{name}": scored.reference[:, i] for i, name in enumerate(names)},
            **{f"error_{name}": errors[:, i] for i, name in enumerate(names)},
        }
        distance_m = np.hypot(errors[:, 0], errors[:, 1])
        times = {"stamp_ns": stamp_ns, "time": moments(stamp_ns)}
        return cls(found.figures, StructuredArray.of({**times, **columns, "distance_m": distance_m}), found.losses)

    def __repr__(self) -> str:
        position, scored = self.figures["position"], self.figures["scored"]
        rmse_m = position["rmse_m"]
        off = "nothing to measure" if rmse_m is None else f"RMSE {rmse_m:.3f} m"
        return f"<EvaluationResult: {self.figures['localized']} localized, {scored} scored, {off}>"
