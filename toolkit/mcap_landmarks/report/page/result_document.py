"""What the page of a result draws, as JSON values: bundles, paths, landmarks, errors, and what was thinned."""

from typing import NamedTuple, TypedDict

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.evaluation.pose_metrics import pose_errors
from mcap_landmarks.evaluation.trajectory import Indices, Trajectory
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.report.drawing import PAIRING
from mcap_landmarks.report.explain_reading import Situations
from mcap_landmarks.report.page.bundle_details import PictureStore, bundle_detail
from mcap_landmarks.report.page.bundle_table import STATUSES
from mcap_landmarks.report.page.chosen_bundles import MOST_DETAILS, MOST_MARKS, MOST_POINTS, failures_first
from mcap_landmarks.report.page.drawn_values import (
    Document,
    errors_of,
    landmarks,
    listed,
    objects,
    paths,
    pose_regions,
)
from mcap_landmarks.report.page.paged_result import PagedResult
from mcap_landmarks.wording import counted

_PICTURES_BYTES = 4_500_000
"""Room for all pictures of a page: as base64 6 MB, which leaves 9 MB of 15 to the plotting library and the rest."""


class KeptCounts(TypedDict):
    """How many bundles a result has, how many are on the page, how many with their scan and match; and its images."""

    all: int
    shown: int
    detailed: int
    pictures: int


class DrawnResult(NamedTuple):
    """The values that the page draws of a result, how much of it they hold, and what was thinned, in words."""

    document: Document
    counts: KeptCounts
    thinned: list[str]


def result_document(result: PagedResult, wanted_ns: Indices | None = None, share: float = 1.0) -> DrawnResult:
    """What a page draws of one result.

    `wanted_ns` are stamps of bundles that count as failures do, as where two runs differ; `share` is the part of the
    room on the page that this result may take.
    """
    table = result.bundles
    first = table.failed if wanted_ns is None else np.isin(table.stamps_ns, wanted_ns)
    shown = failures_first(first, np.arange(len(table)), MOST_MARKS)
    kept = failures_first(first, shown, round(share * MOST_DETAILS))
    details, store = _details(result, kept, share) if result.is_log else ([], PictureStore(0))
    start_ns, errors = _start(result), errors_of(result, _start(result))
    counts: KeptCounts = {
        "all": len(table),
        "shown": len(shown),
        "detailed": len(details),
        "pictures": len(store.urls),
    }
    document: Document = {
        "name": result.name,
        "start_ns": str(start_ns),
        "counts": np.bincount(table.statuses, minlength=len(STATUSES)).tolist(),
        "bundles": _bundles(result, shown, kept, start_ns),
        "paths": paths(result),
        "regions": pose_regions(result),
        "landmarks": landmarks(result),
        "objects": objects(result.drawing.objects),
        "errors": errors,
        "detector": _detector(result),
        "details": details,
        "pictures": store.urls,
    }
    return DrawnResult(document, counts, _thinned(result, counts, len(errors.get("t", ()))))


def _start(result: PagedResult) -> int:
    drawn = result.drawn
    tracks = [] if drawn is None else [drawn.estimate, *([drawn.truth] if drawn.truth else [])]
    times = [result.bundles.stamps_ns, *(track.time_ns for track in tracks)]
    return min((int(found[0]) for found in times if len(found)), default=0)


def _details(result: PagedResult, kept: Indices, share: float) -> tuple[list[Document], PictureStore]:
    table = result.bundles
    store = PictureStore(round(share * _PICTURES_BYTES / max(1, len(kept))))
    with open_recording(result.path) as recording:
        situations = Situations(recording)
        pairs = zip(table.stamps_ns[kept].tolist(), table.logged_ns[kept].tolist(), strict=True)
        return [bundle_detail(*situations.of(*pair), store) for pair in pairs], store


def _bundles(result: PagedResult, shown: Indices, kept: Indices, start_ns: int) -> Document:
    """A column per figure of the bundles that are shown; `detail` is the place of one's details, if it has any."""
    table, drawn = result.bundles, result.drawn
    stamps = table.stamps_ns[shown]
    poses, placed = np.full((len(shown), 3), np.nan), np.full(len(shown), "", dtype=object)
    off_m, off_deg, truth_x, truth_y = np.full((4, len(shown)), np.nan)
    if drawn is not None:
        known, has = _at(drawn.estimate.time_ns, stamps)
        poses[has] = drawn.estimate.poses[known[has]]
        placed[has] = "pose"
        _place(drawn.estimate, drawn.truth, stamps, poses, placed)
        errors = pose_errors(drawn.scored.estimate, drawn.scored.reference)
        row, scored = _at(drawn.estimate.time_ns[drawn.scored.rows], stamps)
        off_m[scored] = np.hypot(errors[row[scored], 0], errors[row[scored], 1])
        off_deg[scored] = np.degrees(errors[row[scored], 2])
        truth_x[scored], truth_y[scored] = drawn.scored.reference[row[scored], :2].T
    detail = dict(zip(kept.tolist(), range(len(kept)), strict=True))
    return {
        "stamp": [str(stamp) for stamp in stamps.tolist()],
        "t": listed((stamps - start_ns) / 1e9, 3),
        "status": table.statuses[shown].tolist(),
        "x": listed(poses[:, 0], 3),
        "y": listed(poses[:, 1], 3),
        "heading_deg": listed(np.degrees(poses[:, 2]), 2),
        "placed": placed.tolist(),
        "truth_x": listed(truth_x, 3),
        "truth_y": listed(truth_y, 3),
        "off_m": listed(off_m, 4),
        "off_deg": listed(off_deg, 3),
        "detail": [detail.get(row) for row in shown.tolist()] if result.is_log else [None] * len(shown),
    }


def _place(
    estimate: Trajectory, truth: Trajectory | None, stamps: Indices, poses: Array, placed: NDArray[np.object_]
) -> None:
    """Put bundles without a pose where the truth says, else between their neighbours in time that have one."""
    without = np.flatnonzero(placed == "")
    if truth is not None and len(without):
        asked = Trajectory.of(stamps[without], np.zeros((len(without), 3)))
        found = PAIRING(asked, truth)
        poses[without[found.estimate]] = found.reference
        placed[without[found.estimate]] = "truth"
    without = np.flatnonzero(placed == "")
    if len(estimate) and len(without):
        seconds, known = (stamps[without] - estimate.time_ns[0]) / 1e9, (estimate.time_ns - estimate.time_ns[0]) / 1e9
        for axis in (0, 1):
            poses[without, axis] = np.interp(seconds, known, estimate.poses[:, axis])
        placed[without] = "between"


def _at(known_ns: Indices, asked_ns: Indices) -> tuple[Indices, NDArray[np.bool_]]:
    """Where each asked time is among known ones, which rise, and whether it is there."""
    if not len(known_ns):
        return np.zeros(len(asked_ns), dtype=np.int64), np.zeros(len(asked_ns), dtype=np.bool_)
    place = np.clip(np.searchsorted(known_ns, asked_ns), 0, len(known_ns) - 1)
    return place, known_ns[place] == asked_ns


def _thinned(result: PagedResult, counts: KeptCounts, errors: int) -> list[str]:
    """What is not all on the page, in words; counts and figures are always over everything."""
    said, whole = [], len(result.bundles)
    if counts["shown"] != whole:
        said.append(
            f"Of {counted(whole, 'bundle')} the page shows {counts['shown']}: failures first, the others evenly."
        )
    if result.is_log and counts["detailed"] != whole:
        said.append(
            f"Image, scan and match are kept of {counts['detailed']} bundles: failures first, the others evenly."
        )
    drawn = result.drawn
    if drawn is not None:
        tracks = [drawn.estimate, drawn.truth, result.odometry]
        if any(track is not None and len(track) > MOST_POINTS for track in tracks):
            said.append(f"Paths are drawn with at most {MOST_POINTS} points.")
        if errors < len(drawn.scored.rows):
            said.append(
                f"Errors over time are drawn at {errors} of {len(drawn.scored.rows)} poses, the worst among them."
            )
    if said:
        said.append("Counts, figures and box plots are over everything.")
    return said


def _detector(result: PagedResult) -> list[Document]:
    if result.detector is None:
        return []
    return [{"name": one.name, "histogram": list(one.histogram)} for one in result.detector.classes]
