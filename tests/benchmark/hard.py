"""What each fault of the sensors alone, and all together, do to detections and positions on a short drive.

python -m tests.benchmark.hard [--json] [--quick]

The map is of a drive of `small` without faults; other drives, each with one of the faults of the scenario `hard`, are
localized in it. A row's value is the error of the positions. Beside it stand the recall and precision of detections,
the share of bundles that were localized, how many positions are farther off than three times what they claim (the
99.73 % of their ellipse), and the worst.
"""

import json
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap_landmarks import open_log
from mcap_landmarks.evaluation.alignment import fit
from mcap_landmarks.geometry.se2 import Array, rotation, transform_points
from mcap_landmarks.locations import location
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.report.page.detector_statistics import detector_statistics
from mcap_landmarks_generator.bundled import FOLDER
from scipy.stats import chi2

from tests.benchmark.rows import Row, main
from tests.benchmark.thesis_runs import call

SEED = 10_000
DRIVES = 3
CLEAN, ALL = "none", "all"
CAMERA = {"rate_hz": 2}
"""Over `small`: fewer images."""
EFFECTS: Mapping[str, tuple[str, ...]] = {
    "lens distortion": ("camera.distortion",),
    "rolling shutter": ("camera.rolling_shutter_s",),
    "motion blur": ("camera.exposure_s",),
    "vignetting": ("camera.vignetting",),
    "dirt on the lens": ("camera.dirt",),
    "exposure that hunts": ("camera.exposure_hunt",),
    "white balance that hunts": ("camera.white_balance_hunt",),
    "noise and compression": ("camera.noise", "camera.jpeg_quality"),
    "clock of the camera": ("camera.clock_offset_s", "camera.clock_drift_ppm", "camera.jitter_s"),
    "lost and late messages": (
        *(f"{sensor}.{key}" for sensor in ("camera", "lidar") for key in ("dropped", "late", "late_s")),
    ),
    "noise of the LiDAR": ("lidar.sigma_m", "lidar.dropout"),
    "wheels and slip": tuple(
        f"odometry.{key}" for key in ("radius_error", "baseline_error", "distance_slip", "heading_slip_deg")
    ),
    "frames that come late": ("robot.frames_after_s",),
    "panes of glass": ("objects",),
    "a second camera": ("cameras",),
}
BESIDE = ("ring_lidar", "imu")
"""Sensors of `hard` that localizing by camera and planar LiDAR does not read: a row of their own would say nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """What came of one drive: bundles, positions (N, 2) with covariances (N, 2, 2), true ones (N, 2) beside them, and
    detections that were judged, that are true, and that are missing."""

    bundles: int
    positions_xy: Array
    covariances: Array
    truth_xy: Array
    judged: int
    true: int
    missed: int


def measure(quick: bool) -> Iterator[Row]:
    """A row per fault."""
    hard = tomllib.loads((FOLDER / "hard.toml").read_text())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log, database = folder / "mapped.mcap", folder / "map.db"
        scenario(folder / "clean.toml", {})
        call("generate", folder / "clean.toml", "-o", log, "--seed", SEED)
        call("map", log, "--map", database)
        seeds = range(SEED + 1, SEED + 1 + (1 if quick else DRIVES))
        world_from_map = np.zeros(3)
        for effect, keys in ((CLEAN, ()), *EFFECTS.items(), (ALL, None)):
            path = folder / "drive.toml"
            scenario(path, taken(hard, keys))
            drives = [driven(path, seed, database, folder) for seed in seeds]
            if effect == CLEAN:
                estimates, truths = (
                    np.concatenate([getattr(drive, name) for drive in drives]) for name in ("positions_xy", "truth_xy")
                )
                world_from_map = fit(estimates, truths)
            yield row(effect, drives, world_from_map)


def taken(hard: Mapping[str, Any], keys: tuple[str, ...] | None) -> dict[str, Any]:
    """The settings of `hard` by dotted name, all of them without names."""
    if keys is None:
        return {name: value for name, value in hard.items() if name not in {"extends", "description"}}
    found: dict[str, Any] = {}
    for key in keys:
        table, _, name = key.partition(".")
        if name:
            found.setdefault(table, {})[name] = hard[table][name]
        else:
            found[table] = hard[table]
    return found


def scenario(path: Path, settings: Mapping[str, Any]) -> None:
    """Write a scenario with some settings over those of `small`."""
    laid = {**settings, "camera": {**settings.get("camera", {}), **CAMERA}}
    if "cameras" in settings:
        laid["cameras"] = [{**camera, **CAMERA} for camera in settings["cameras"]]
    lines = ['extends = "small"', *(f"{key} = {toml(value)}" for key, value in laid.items())]
    path.write_text("\n".join(lines) + "\n")


def toml(value: object) -> str:
    """A value of TOML on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {toml(inner)}" for key, inner in value.items()) + " }"
    return "[" + ", ".join(map(toml, value)) + "]" if isinstance(value, list) else json.dumps(value)


def driven(path: Path, seed: int, database: Path, folder: Path) -> Drive:
    """Generate a drive, localize it, and hold it against its truth."""
    log, out = folder / "drive.mcap", folder / "localized.mcap"
    call("generate", path, "-o", log, "--seed", seed, "--overwrite")
    bundles = call("localize", log, "--map", database, "--image", "all", "-o", out, "--overwrite")["bundles"]
    with open_recording(location(str(out))) as recording:
        found = detector_statistics(recording)
    judged, true, missed = (
        sum(getattr(one, name) for one in found.classes) if found is not None else 0
        for name in ("judged", "true", "missed")
    )
    with open_log(out) as read:
        truth = read.ground_truth()
        poses = read.poses("/landmarks/pose_cov")
    times = poses["stamp_ns"]
    truth_xy = np.column_stack([np.interp(times, truth["stamp_ns"], truth[axis]) for axis in ("x_m", "y_m")])
    covariances = np.array([[poses["var_x_m2"], poses["cov_xy_m2"]], [poses["cov_xy_m2"], poses["var_y_m2"]]])
    positions = np.column_stack([poses["x_m"], poses["y_m"]])
    return Drive(bundles, positions, np.moveaxis(covariances, -1, 0), truth_xy, judged, true, missed)


def row(effect: str, drives: list[Drive], world_from_map: Array) -> Row:
    """The figures of all drives with one fault."""
    bundles, judged, true, missed = (
        sum(getattr(drive, name) for drive in drives) for name in ("bundles", "judged", "true", "missed")
    )
    positions, covariances, truth = (
        np.concatenate([getattr(drive, name) for drive in drives])
        for name in ("positions_xy", "covariances", "truth_xy")
    )
    turn = rotation(world_from_map[2])
    off = transform_points(world_from_map, positions) - truth
    spread = turn @ covariances @ turn.T
    apart = np.einsum("ni,nij,nj->n", off, np.linalg.inv(spread), off)
    errors_m = np.hypot(*off.T)
    peers = {
        "recall": true / max(true + missed, 1),
        "precision": true / max(judged, 1),
        "localized": len(positions) / max(bundles, 1),
        "sure and wrong": float(np.count_nonzero(apart > chi2.ppf(0.9973, 2))),
        "worst_m": float(errors_m.max(initial=0.0)),
    }
    rmse_m = float(np.sqrt((errors_m**2).mean())) if len(errors_m) else float("nan")
    return Row(effect, rmse_m, "m RMSE", cases=len(positions), peers=peers)


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or ""))
