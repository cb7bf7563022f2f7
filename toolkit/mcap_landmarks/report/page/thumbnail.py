"""A small map of a result, as pixels for SVG."""

import numpy as np

from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.report.drawing import breaks
from mcap_landmarks.report.page.chosen_bundles import evenly
from mcap_landmarks.report.page.paged_result import PagedResult

_WIDTH, _HEIGHT, _MARGIN = 220.0, 150.0, 8.0
"""A thumbnail, in pixels."""
_POINTS = 200
"""So many points of a path are as many as a thumbnail shows."""


def thumbnail(result: PagedResult) -> dict[str, object]:
    """A small map: the lines of truth and estimate, landmarks, and where bundles failed, in pixels."""
    drawn, landmarks = result.drawn, result.drawing.landmarks
    lines = {"truth": np.zeros((0, 2)), "estimate": np.zeros((0, 2))}
    failed = spots = np.zeros((0, 2))
    if drawn is not None:
        lines["estimate"] = _whole(breaks(drawn.estimate))
        if drawn.truth is not None:
            lines["truth"] = _whole(breaks(drawn.truth))
            bad = result.bundles.stamps_ns[result.bundles.failed]
            place = np.clip(np.searchsorted(drawn.truth.time_ns, bad), 0, len(drawn.truth) - 1)
            failed = drawn.truth.poses[place, :2]
    if landmarks is not None:
        spots = landmarks.positions_xy
    points = np.concatenate([*lines.values(), spots])
    if not len(points):
        return {"lines": {}, "failed": [], "spots": []}
    low, high = points.min(axis=0), points.max(axis=0)
    scale = min((size - 2 * _MARGIN) / max(side, 1.0) for size, side in zip((_WIDTH, _HEIGHT), high - low, strict=True))
    middle = (low + high) / 2

    def pixels(points_xy: Array) -> list[list[float]]:
        level = (points_xy - middle) * scale * [1.0, -1.0] + [_WIDTH / 2, _HEIGHT / 2]
        found: list[list[float]] = np.round(level[evenly(np.arange(len(level)), _POINTS)], 1).tolist()
        return found

    joined = {name: " ".join(f"{x},{y}" for x, y in pixels(line)) for name, line in lines.items() if len(line)}
    return {"lines": joined, "failed": pixels(failed), "spots": pixels(spots)}


def _whole(line: Array) -> Array:
    found: Array = line[np.isfinite(line).all(axis=1)]
    return found
