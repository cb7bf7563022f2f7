"""Scored positions as the thesis writes its results (Appendix D)."""

import numpy as np

from mcap_landmarks.evaluation.metrics import RunResult, ScoredPoses
from mcap_landmarks.geometry.se2 import inverse, transform_points
from mcap_landmarks.maps.exchange_thesis import Results


def results_of(run: RunResult, scored: ScoredPoses) -> Results:
    """The scored poses with the classes of the landmarks that each was matched to, left to right.

    Poses without a known match, as those of a trajectory, have the class `unknown`.
    """
    classes = []
    for row in scored.rows.tolist():
        seen = run.seen.get(int(run.trajectory.time_ns[row]), ())
        classes.append(_left_to_right(run, seen, row) or ("unknown",))
    return Results(tuple(classes), scored.reference[:, :2], scored.estimate[:, :2])


def _left_to_right(run: RunResult, seen: tuple[str, ...], row: int) -> tuple[str, ...]:
    if run.landmarks is None:
        return ()
    landmarks = [run.landmarks.ids.index(identity) for identity in seen if identity in run.landmarks.ids]
    positions = run.landmarks.positions_xy[landmarks].reshape(-1, 2)
    points = transform_points(inverse(run.trajectory.poses[row]), positions)
    names = run.landmarks.classes
    return tuple(names[landmarks[i]] for i in np.argsort(-np.arctan2(points[:, 1], points[:, 0]), kind="stable"))
