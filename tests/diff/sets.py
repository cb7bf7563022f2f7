"""Folders of small logs with results, for tests of the diff of two sets of runs."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from mcap_landmarks.channels import MATCH, POSE, POSE_COVARIANCE, SCENE_OBJECTS, TRUTH_POSE
from mcap_landmarks.messages.match import LandmarkMatch, Status
from mcap_landmarks.messages.poses import PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Stamped

from tests.evaluation.scenes import scene

START_NS, STEP_NS, BUNDLES = 1_700_000_000 * 10**9, 10**8, 12


def result(path: Path, drive: int, error_m: float = 0.05, *, lost: int = 0, truth: bool = True) -> Path:
    """A log of a drive with results that are `error_m` off in turning directions; the last `lost` are not localized."""
    rng = np.random.default_rng(drive)
    with create_recording(path) as writer:
        for i in range(BUNDLES):
            time_ns = START_NS + i * STEP_NS
            pose = np.append(rng.uniform(-5, 5, 2), 0.1)
            if truth:
                writer.add(Stamped(TRUTH_POSE, time_ns, PoseStamped.planar(time_ns, "map", pose)))
            places = rng.uniform(-3, 3, (2, 2))
            writer.add(Stamped(SCENE_OBJECTS, time_ns, scene(["person", "bench"], places, time_ns)))
            status = Status.NO_MATCH if i >= BUNDLES - lost else Status.LOCALIZED
            match = LandmarkMatch(time_ns, "base_footprint", status, residual_m=np.full(2, error_m))
            writer.add(Stamped(MATCH, time_ns, match), "localize")
            if status is Status.LOCALIZED:
                off = pose + np.array([error_m * np.cos(i), error_m * np.sin(i), error_m / 10])
                writer.add(Stamped(POSE, time_ns, PoseStamped.planar(time_ns, "map", off)), "localize")
                spread = np.diag([error_m**2, error_m**2, 1e-4])
                estimate = PoseWithCovarianceStamped.planar(time_ns, "map", off, spread)
                writer.add(Stamped(POSE_COVARIANCE, time_ns, estimate), "localize")
    return path


def folder(path: Path, errors_m: Mapping[str, float]) -> Path:
    """A folder of logs by name, each of a drive of its own."""
    path.mkdir()
    for drive, (name, error_m) in enumerate(errors_m.items()):
        result(path / f"{name}.mcap", drive, error_m)
    return path
