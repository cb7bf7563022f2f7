"""Diff two results of an hour: `python -m tests.benchmark.diff [--json] [--quick]`.

Each has 36,000 bundles at 10 Hz with scene objects, matches, poses, transforms and truth; every one of the candidate's
poses and objects is moved a little, and one in a hundred is gone. The diff runs in a process of its own.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from mcap_landmarks import channels
from mcap_landmarks.messages.match import LandmarkMatch, Status
from mcap_landmarks.messages.poses import PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Stamped

from tests.benchmark.rows import Row, main

BUNDLES, STEP_NS, START_NS = 36_000, 10**8, 1_700_000_000 * 10**9
OBJECTS, LANDMARKS = 4, 60
_CHILD = """
import json, resource, sys, time
from mcap_landmarks.cli.main import run
start = time.perf_counter()
try:
    run(["diff", *sys.argv[1:], "--json"])
finally:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(json.dumps([time.perf_counter() - start, peak / 1024]), file=sys.stderr)
"""


def messages(bundles: int, moved_m: float, lost: int) -> Iterator[Stamped]:
    """One run: truth, and results that err by `moved_m`; of every `lost` bundles one is not localized."""
    rng = np.random.default_rng(7)
    objects, others = rng.uniform(-8, 8, (LANDMARKS, 2)), ((("person", 0.7), ("bench", 0.3)), (("bench", 1.0),))
    spread = np.tile(np.diag([0.01, 0.02]), (OBJECTS, 1, 1))
    landmarks = tuple(f"l{i}" for i in range(LANDMARKS))
    for i in range(bundles):
        time_ns, pose = START_NS + i * STEP_NS, np.array([np.cos(i / 500) * 20, np.sin(i / 500) * 20, i / 500 % 6])
        seen = (np.arange(OBJECTS) * 7 + i // 50) % LANDMARKS
        ids = tuple(f"t{row}" for row in seen.tolist())
        scene = SceneObjects(
            time_ns, "base_footprint", ids, (others[0], others[1]) * 2, objects[seen] + moved_m, spread, np.full(4, 0.2)
        )
        yield Stamped(channels.TRUTH_POSE, time_ns, PoseStamped.planar(time_ns, "map", pose))
        yield Stamped(channels.SCENE_OBJECTS, time_ns, scene)
        status = Status.NO_MATCH if lost and i % lost == 0 else Status.LOCALIZED
        matched = tuple(landmarks[row] for row in seen.tolist())
        residual = np.full(OBJECTS, 0.01 + moved_m)
        match = LandmarkMatch(time_ns, "base_footprint", status, ids, matched, residual, ("a",), np.ones(1))
        yield Stamped(channels.MATCH, time_ns, match)
        if status is Status.LOCALIZED:
            there = pose + np.array([moved_m, 0, moved_m / 10])
            covariance = np.diag([0.01, 0.01, 0.001]) + moved_m / 100
            yield Stamped(channels.POSE, time_ns, PoseStamped.planar(time_ns, "map", there))
            estimate = PoseWithCovarianceStamped.planar(time_ns, "map", there, covariance)
            yield Stamped(channels.POSE_COVARIANCE, time_ns, estimate)
            yield Stamped(channels.TF, time_ns, TFMessage((Transform.planar(time_ns, ("map", "odom"), there),)))


def measure(quick: bool) -> Iterator[Row]:
    """Seconds and peak memory of one diff; quick: of a tenth of the bundles, with the goal of the whole hour."""
    bundles = BUNDLES // 10 if quick else BUNDLES
    with tempfile.TemporaryDirectory() as name:
        paths = [Path(name) / "baseline.mcap", Path(name) / "candidate.mcap"]
        for path, moved_m, lost in zip(paths, (0.0, 0.01), (0, 100), strict=True):
            with create_recording(path) as writer:
                for stamped in messages(bundles, moved_m, lost):
                    writer.add(stamped, "localize")
        command = [sys.executable, "-c", _CHILD, *map(str, paths)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 1:
        raise RuntimeError(f"diff ended with {done.returncode}: {done.stderr[-500:]}")
    counts = json.loads(done.stdout)["channels"]["/landmarks/pose"]
    if (counts["changed"], counts["removed"]) != (bundles - bundles // 100, bundles // 100):
        raise RuntimeError(f"diff counted {counts}")
    seconds, peak_mb = json.loads(done.stderr.splitlines()[-1])
    yield Row("diff of two one-hour results", seconds, "s", at_most=20, cases=bundles)
    yield Row("diff: peak memory", peak_mb, "MB", at_most=1000, cases=bundles)


if __name__ == "__main__":
    sys.exit(main(measure, "Diff two results of an hour."))
