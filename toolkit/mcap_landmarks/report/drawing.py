"""What a plot shows, gathered from files: one map, and any number of runs in it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.evaluation.alignment import fit
from mcap_landmarks.evaluation.landmark_metrics import associate
from mcap_landmarks.evaluation.metrics import Reference, RunResult, ScoredPoses, score
from mcap_landmarks.evaluation.pose_metrics import align
from mcap_landmarks.evaluation.read import read_run
from mcap_landmarks.evaluation.trajectory import Trajectory, interpolated
from mcap_landmarks.geometry.se2 import Array, compose, rotation, transform_points
from mcap_landmarks.locations import Location
from mcap_landmarks.maps.database import read_map
from mcap_landmarks.maps.model import Group
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.progress import Progress

PAIRING = partial(interpolated, max_gap_ns=5 * 10**8)
"""The truth is interpolated over gaps up to half a second, as `evaluate` does by default."""
_RADII_95 = 2.4477
"""An ellipse of so many sigmas holds 95 % of a normal distribution of the plane."""


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One run: its poses, a path (`continuous`) or each of its own, the truth, and the poses that have a truth."""

    name: str
    estimate: Trajectory
    continuous: bool
    truth: Trajectory | None
    scored: ScoredPoses


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """Everything that a plot shows, in one frame: landmarks, their groups, the objects of the truth, runs."""

    landmarks: SceneObjects | None = None
    groups: tuple[Group, ...] = ()
    objects: SceneObjects | None = None
    runs: tuple[Run, ...] = ()


def gather(paths: Sequence[Location], *, aligned: bool, progress: Progress | None = None) -> tuple[Drawing, list[str]]:
    """The drawing of maps, logs with results, or results as in Appendix D, and what of them could not be read.

    The first input that has a map gives the landmarks. `aligned` moves each run by the SE(2) that fits its poses best
    to its truth, and the landmarks with the first run, or by their own fit if no run has poses with a truth.

    Raises:
        ToolkitError: an input cannot be read, or none has anything to draw.
    """
    drawing = Drawing()
    losses: list[str] = []
    for path in paths:
        result, reference, problems = read_run(path, progress)
        losses.extend(f"{path}: {problem}" for problem in problems)
        groups = read_map(path).groups if not result.bundles and result.landmarks is not None else ()
        try:
            drawing = with_run(drawing, path.stem, result, reference, groups, aligned=aligned)
        except UsageError as error:
            raise UsageError(f"{path}: {error}") from error
    if drawing.landmarks is None and drawing.objects is None and not drawing.runs:
        raise RecordingError(f"{paths[0]}: has neither poses nor landmarks to draw; run map or localize first")
    if aligned and not any(len(run.scored.rows) for run in drawing.runs):
        drawing = _onto_objects(drawing)
    return drawing, losses


def with_run(
    drawing: Drawing, name: str, result: RunResult, reference: Reference, groups: tuple[Group, ...], *, aligned: bool
) -> Drawing:
    """The drawing with one more run: its poses, the landmarks and objects that the drawing still lacks.

    Raises:
        UsageError: the poses cannot be `aligned`.
    """
    landmarks = result.drawn if result.landmarks is None else result.landmarks
    if drawing.landmarks is None and landmarks is not None:
        drawing = replace(drawing, landmarks=landmarks, groups=groups)
    if drawing.objects is None:
        drawing = replace(drawing, objects=reference.objects)
    if not len(result.trajectory) and reference.trajectory is None:
        return drawing
    scored = score(result.trajectory, reference, PAIRING, aligned=aligned)
    estimate = result.trajectory
    if scored.alignment is not None:
        transform = scored.alignment.reference_from_estimate
        estimate = Trajectory(estimate.time_ns, *align(transform, estimate.poses, estimate.covariances))
        if not drawing.runs:
            drawing = _moved(drawing, transform)
    run = Run(name, estimate, result.continuous, reference.trajectory, scored)
    return replace(drawing, runs=(*drawing.runs, run))


def _onto_objects(drawing: Drawing) -> Drawing:
    """The drawing with its landmarks moved onto the objects of the truth, if it has both."""
    landmarks, objects = drawing.landmarks, drawing.objects
    if landmarks is None or objects is None:
        return drawing
    mine, theirs = associate(landmarks, objects)
    return _moved(drawing, fit(landmarks.positions_xy[mine], objects.positions_xy[theirs]))


def _moved(drawing: Drawing, reference_from_map: Array) -> Drawing:
    """The drawing with its map moved into the frame of the reference."""
    turn = rotation(reference_from_map[2])
    groups = tuple(
        Group(group.landmark_ids, compose(reference_from_map, group.map_from_base)) for group in drawing.groups
    )
    landmarks = drawing.landmarks
    if landmarks is not None:
        landmarks = replace(
            landmarks,
            positions_xy=transform_points(reference_from_map, landmarks.positions_xy),
            covariances=turn @ landmarks.covariances @ turn.T,
        )
    return replace(drawing, landmarks=landmarks, groups=groups)


def regions_95(covariances: Array) -> tuple[Array, Array]:
    """Semi-axes (N, 2), the larger one first, and its directions (N,) in rad of 95 % regions; covariances (N, 2, 2)."""
    variance, axis = np.linalg.eigh(covariances)
    radii: Array = _RADII_95 * np.sqrt(np.maximum(variance[:, ::-1], 0.0))
    return radii, np.arctan2(axis[:, 1, 1], axis[:, 0, 1])


def breaks(trajectory: Trajectory, gap_ns: int = 2 * 10**9) -> Array:
    """Positions (M, 2) of a trajectory to draw as a line, with NaN where it pauses for longer than `gap_ns`.

    Nothing if it does nothing but pause.
    """
    after = np.flatnonzero(np.diff(trajectory.time_ns) > gap_ns) + 1
    if len(after) >= len(trajectory) - 1:
        return np.zeros((0, 2))
    return np.insert(trajectory.poses[:, :2], after, np.nan, axis=0)


def follows(trajectory: Trajectory) -> bool:
    """Whether its poses follow one another, so that the first is a start and the last an end."""
    return len(breaks(trajectory)) > 0


def waypoints(trajectory: Trajectory, most: int) -> Array:
    """At most so many poses (K, 3) with a heading, evenly along the way; none of a path without headings."""
    known = trajectory.poses[np.isfinite(trajectory.poses).all(axis=1)]
    if not len(known):
        return known
    steps = np.linalg.norm(np.diff(known[:, :2], axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    rows = np.searchsorted(way, (np.arange(most) + 0.5) / most * way[-1])
    chosen: Array = known[np.unique(rows)]
    return chosen
