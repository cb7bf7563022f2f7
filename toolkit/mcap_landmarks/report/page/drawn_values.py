"""What a page draws of a result as JSON values: paths, regions, landmarks, errors."""

from collections import Counter
from collections.abc import Sequence
from itertools import chain

import numpy as np

from mcap_landmarks.evaluation.pose_metrics import pose_errors
from mcap_landmarks.evaluation.trajectory import Trajectory
from mcap_landmarks.geometry.se2 import Array, compose, interpolate, inverse, transform_points
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.report.drawing import breaks, regions_95
from mcap_landmarks.report.page.chosen_bundles import MOST_POINTS, evenly, failures_first
from mcap_landmarks.report.page.paged_result import PagedResult

_OUTLIERS = 300
"""So many points beyond the whiskers of a box are drawn."""
_REGIONS = 150
"""So many regions along a path can be told from each other on a screen."""
Document = dict[str, object]


def paths(result: PagedResult) -> Document:
    """Lines of x and y: as estimated, as it truly was, and by odometry, laid onto the first pose that is known."""
    drawn = result.drawn
    if drawn is None:
        return {}
    lines = {"estimate": breaks(drawn.estimate)}
    if drawn.truth is not None:
        lines["truth"] = breaks(drawn.truth)
    if result.odometry is not None:
        start = drawn.estimate if len(drawn.estimate) else drawn.truth
        lines["odometry"] = _laid(result.odometry, start)
    thin = {name: line[evenly(np.arange(len(line)), MOST_POINTS)] for name, line in lines.items() if len(line)}
    return {name: [listed(line[:, 0], 3), listed(line[:, 1], 3)] for name, line in thin.items()}


def _laid(odometry: Trajectory, onto: Trajectory | None) -> Array:
    """The line of odometry in the map, none where no pose of the map is known while it runs."""
    if onto is None or len(odometry) < 2:
        return np.zeros((0, 2))
    whole = np.isfinite(onto.poses).all(axis=1)
    whole &= (onto.time_ns >= odometry.time_ns[0]) & (onto.time_ns <= odometry.time_ns[-1])
    if not whole.any():
        return np.zeros((0, 2))
    first = int(np.argmax(whole))
    then = interpolate(odometry.time_ns, odometry.poses, onto.time_ns[first : first + 1])[0]
    return transform_points(compose(onto.poses[first], inverse(then)), breaks(odometry))


def pose_regions(result: PagedResult) -> list[list[float | None]]:
    """95 % regions of some poses, evenly along the run: x, y, semi-axes, direction in degrees."""
    drawn = result.drawn
    if drawn is None:
        return []
    spreads = drawn.estimate.covariances[:, :2, :2]
    known = np.flatnonzero(np.isfinite(spreads).all(axis=(1, 2)) & spreads.any(axis=(1, 2)))
    rows = evenly(known, _REGIONS)
    return _ellipses(drawn.estimate.poses[rows, :2], spreads[rows])


def _ellipses(positions_xy: Array, covariances: Array) -> list[list[float | None]]:
    radii, directions_rad = regions_95(covariances)
    return [listed(row, 4) for row in np.column_stack([positions_xy, radii, np.degrees(directions_rad)])]


def landmarks(result: PagedResult) -> list[Document]:
    """The landmarks with their 95 % regions, and how often each was matched."""
    scene = result.drawing.landmarks
    if scene is None:
        return []
    seen = Counter(chain.from_iterable(result.run.seen.values()))
    regions = _ellipses(scene.positions_xy, scene.covariances)
    known = [bool(spread.any()) for spread in scene.covariances]
    return [
        {"id": name, "class": label, "at": region[:2], "region": region if has else None, "matched": seen[name]}
        for name, label, region, has in zip(scene.ids, scene.classes, regions, known, strict=True)
    ]


def objects(scene: SceneObjects | None) -> list[list[object]]:
    """The objects of the truth: x, y, class."""
    if scene is None:
        return []
    return [[*listed(place, 3), label] for place, label in zip(scene.positions_xy, scene.classes, strict=True)]


def errors_of(result: PagedResult, start_ns: int) -> dict[str, list[object]]:
    """Errors over time, thinned, and the boxes of all of them; empty where no pose has a truth."""
    drawn = result.drawn
    if drawn is None or not len(drawn.scored.rows):
        return {}
    errors = pose_errors(drawn.scored.estimate, drawn.scored.reference)
    errors[:, 2] = np.degrees(errors[:, 2])
    far = np.hypot(errors[:, 0], errors[:, 1])
    worst = np.zeros(len(far), dtype=np.bool_)
    worst[np.argsort(-far, kind="stable")[: MOST_POINTS // 10]] = True
    rows = failures_first(worst, np.arange(len(far)), MOST_POINTS)
    times = (drawn.estimate.time_ns[drawn.scored.rows] - start_ns) / 1e9
    return {
        "t": [*listed(times[rows], 3)],
        "x": [*listed(errors[rows, 0], 4)],
        "y": [*listed(errors[rows, 1], 4)],
        "heading": [*listed(errors[rows, 2], 3)],
        "boxes": [_box(errors[:, axis]) for axis in range(3)],
    }


def _box(errors: Array) -> Document | None:
    """A box plot of all errors of an axis: quartiles, whiskers to the last within 1.5 boxes (Tukey 1977), outliers."""
    known = np.sort(errors[np.isfinite(errors)])
    if not len(known):
        return None
    low, middle, high = np.percentile(known, (25, 50, 75)).tolist()
    reach = 1.5 * (high - low)
    inside = known[(known >= low - reach) & (known <= high + reach)]
    outside = known[(known < low - reach) | (known > high + reach)]
    whiskers = (float(inside[0]), float(inside[-1]))
    return {
        "quartiles": listed([low, middle, high], 5),
        "whiskers": listed(whiskers, 5),
        "outliers": listed(outside[evenly(np.arange(len(outside)), _OUTLIERS)], 4),
        "count": len(known),
    }


def listed(values: Array | Sequence[float], digits: int) -> list[float | None]:
    """Numbers of a column or row for JSON: rounded, None where one is none."""
    rounded = np.round(np.asarray(values, dtype=np.float64), digits) + 0.0
    return [number if np.isfinite(number) else None for number in rounded.tolist()]
