"""The thesis's experiment on one seed: two drives, both ways to map and localize, and what came of the stops."""

import contextlib
import heapq
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from mcap_landmarks.channels import ODOMETRY, SCAN, TF
from mcap_landmarks.cli.console import run_command
from mcap_landmarks.cli.main import build
from mcap_landmarks.evaluation.metrics import ScoredPoses, score
from mcap_landmarks.evaluation.pose_metrics import false_figures, pose_errors
from mcap_landmarks.evaluation.read import read_reference, read_run
from mcap_landmarks.evaluation.trajectory import Trajectory, interpolated
from mcap_landmarks.geometry.se2 import between
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.report.drawing import Drawing, Run, gather
from numpy.typing import NDArray

Array = NDArray[np.float64]
Stops = NDArray[np.int64]

IMAGES_HZ = 2
STOPS = 20
# The robot's odometry is known to be perfect; what build_map assumes otherwise is that of wheels.
PERFECT = [
    "--set=build_map.odometry_position_m=1e-4",
    "--set=build_map.odometry_heading_rad=1e-5",
    "--set=build_map.odometry_turning_rad=1e-5",
]
THESIS = [f"--set={stage}.method=thesis" for stage in ("cluster", "fuse", "build_map", "localize")]
_STILL_M, _STILL_RAD, _STILL_NS = 2e-4, 1e-4, 2_500_000_000
_MAPPED_M = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Positions:
    """What one run computed: true positions at the stops (K, 2), from one scan and from all scans of each stop.

    `one_scan`, `stop` (K, 2) are NaN where nothing was computed. `false` of all `poses` of the run are far off.
    """

    truth: Array
    one_scan: Array
    stop: Array
    false: int
    poses: int

    @classmethod
    def pooled(cls, runs: "Sequence[Positions]") -> "Positions":
        """Several runs as one."""
        truth, one_scan, stop = (
            np.concatenate([getattr(run, name) for run in runs]) for name in ("truth", "one_scan", "stop")
        )
        return cls(truth, one_scan, stop, sum(run.false for run in runs), sum(run.poses for run in runs))


def call(verb: str, *words: object) -> dict[str, Any]:
    """The JSON document of a verb, as the command line gives it.

    Raises:
        RuntimeError: the verb did not end well.
    """
    ended = attempt(verb, *words)
    if ended.code:
        raise RuntimeError(f"{verb} {' '.join(map(str, words))} ended with {ended.code}: {ended.told}")
    return ended.document


@dataclass(frozen=True, slots=True)
class Ended:
    """How a verb ended: its exit code, its JSON document, empty where there is none, and what it told on stderr."""

    code: int
    document: dict[str, Any]
    told: str


def attempt(verb: str, *words: object) -> Ended:
    """Run a verb as the command line does, however it ends."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run_command(build(verb), [verb, *map(str, words), "--json"])
    return Ended(code, json.loads(out.getvalue() or "{}"), err.getvalue())


def record_map(folder: Path, seed: int, model: list[str]) -> tuple[Path, Path]:
    """The drive `thesis_map`, with scans at its stops only as in the thesis, and `thesis_map_drift` with all scans."""
    seen = record(folder, "thesis_map", seed, model)
    target = folder / "map.mcap"
    cut(seen, seen, stops_of(seen), target)
    seen.unlink()
    return target, record(folder, "thesis_map_drift", seed, model)


def record_localize(folder: Path, seed: int, model: list[str]) -> tuple[Path, Path]:
    """The drive `thesis_localize` with perfect odometry and scans at its stops only, and with drift and all scans.

    Both have the same images and scans, since a seed's draws do not depend on each other.
    """
    seen, drifting = record(folder, "thesis_localize", seed, model), folder / "odometry.mcap"
    call("generate", "thesis_localize_drift", "-o", drifting, "--seed", seed, "--workers", 1, "--set=camera.when=never")
    perfect, with_drift = folder / "localize.mcap", folder / "localize_drift.mcap"
    cut(seen, seen, stops_of(seen), perfect)
    cut(seen, drifting, None, with_drift)
    seen.unlink()
    drifting.unlink()
    return perfect, with_drift


def record(folder: Path, scenario: str, seed: int, model: list[str]) -> Path:
    """The drive of a scenario with what the detector finds in its images."""
    raw, seen = folder / f"{scenario}_raw.mcap", folder / f"{scenario}.mcap"
    images = ("--set", f"camera.rate_hz={IMAGES_HZ}")
    call("generate", scenario, "-o", raw, "--seed", seed, "--workers", 1, *images)
    call("detect", raw, "-o", seen, *model)
    raw.unlink()
    return seen


def cut(log: Path, drive: Path, stops: Stops | None, target: Path) -> None:
    """Write a log with the odometry of a drive, and with its scans at some stops only, where these are given."""
    odometry = {ODOMETRY.topic, TF.topic}
    with open_recording(log) as recording, open_recording(drive) as driven, create_recording(target) as writer:
        kept = [entry.connection for entry in recording.channels if entry.connection.topic not in odometry]
        taken = [entry.connection for entry in driven.channels if entry.connection.topic in odometry]
        for connection in (*kept, *taken):
            writer.declare(connection)
        both = recording.messages(kept), driven.messages(taken)
        for raw in heapq.merge(*both, key=attrgetter("log_time_ns")):
            if stops is None or raw.connection.topic != SCAN.topic or _within(stops, raw.log_time_ns):
                writer.write(raw)


def _within(stops: Stops, time_ns: int) -> bool:
    return bool(((stops[:, 0] <= time_ns) & (time_ns <= stops[:, 1])).any())


def stops_of(log: Path) -> Stops:
    """First and last time (K, 2) of each stop, from the truth."""
    truth = read_reference(log)[0].trajectory
    assert truth is not None
    steps = np.abs(between(truth.poses[:-1], truth.poses[1:]))
    still = (np.hypot(steps[:, 0], steps[:, 1]) < _STILL_M) & (steps[:, 2] < _STILL_RAD)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    spans = truth.time_ns[edges.reshape(-1, 2)]
    return spans[spans[:, 1] - spans[:, 0] > _STILL_NS]


def at_stops(result: Path, stops: Stops, *, aligned: bool) -> Positions:
    """What a localized log has at the stops: of each the scan in its middle, and the mean over its scans."""
    outcome, reference, _ = read_run(result)
    scored = score(outcome.trajectory, reference, partial(interpolated, max_gap_ns=500_000_000), aligned=aligned)
    times = outcome.trajectory.time_ns[scored.rows]
    bundles = np.array(sorted(outcome.seen))
    truth, one_scan, stop = (np.full((len(stops), 2), np.nan) for _ in range(3))
    assert reference.trajectory is not None
    for i, (first, last) in enumerate(stops):
        here = np.flatnonzero((times >= first) & (times <= last))
        middle = Trajectory.of(np.array([(first + last) // 2]), np.zeros((1, 3)))
        truth[i] = interpolated(middle, reference.trajectory, 500_000_000).reference[0, :2]
        scan = bundles[np.argmin(np.abs(bundles - middle.time_ns[0]))]
        if scan in times:
            one_scan[i] = scored.estimate[np.flatnonzero(times == scan)[0], :2]
        if len(here):
            stop[i] = scored.estimate[here, :2].mean(axis=0)
    errors = pose_errors(scored.estimate, scored.reference)
    return Positions(truth, one_scan, stop, int(false_figures(errors)["count"] or 0), len(errors))


def groups_mapped(database: Path, truth: Path, *, aligned: bool) -> int:
    """How many of the thesis's groups have all three objects in a map, each of its class within half a metre."""
    drawing, _ = gather([database, truth], aligned=aligned)
    landmarks, objects = drawing.landmarks, drawing.objects
    assert landmarks is not None
    assert objects is not None
    apart = np.linalg.norm(objects.positions_xy[:, None] - landmarks.positions_xy, axis=-1)
    same = np.array(objects.classes)[:, None] == np.array(landmarks.classes)
    found = ((apart < _MAPPED_M) & same).any(axis=1)
    return int(found.reshape(-1, 3).all(axis=1).sum())


def drawing_of(name: str, positions: Positions) -> Drawing:
    """Positions computed from one scan each, to be drawn."""
    computed = np.flatnonzero(np.isfinite(positions.one_scan[:, 0]))
    unknown = np.full((len(computed), 1), np.nan)
    estimate = np.hstack([positions.one_scan[computed], unknown])
    truth = np.hstack([positions.truth[computed], unknown])
    trajectory = Trajectory.of(computed * 10**10, estimate)
    scored = ScoredPoses(np.arange(len(computed)), estimate, trajectory.covariances, truth, None)
    return Drawing(runs=(Run(name, trajectory, False, None, scored),))
