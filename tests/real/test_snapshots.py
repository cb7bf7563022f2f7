"""Real snapshots of landmarks (UTIAS MRCLAM by way of the TriangulationToolbox), as logs that `localize` reads."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import SCENE_OBJECTS, TRUTH_POSE
from mcap_landmarks.cli.main import run
from mcap_landmarks.estimation.polar import points_from_polar
from mcap_landmarks.evaluation.metrics import score
from mcap_landmarks.evaluation.read import read_run
from mcap_landmarks.evaluation.trajectory import nearest
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.maps.model import LandmarkMap, MapSource
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Stamped
from scipy.io import loadmat

pytestmark = pytest.mark.slow

STEP_NS, STRIDE = 10**8, 16
POLAR = np.diag([0.12**2, 0.03**2])


def write_snapshots(source: Path, log: Path, database: Path) -> None:
    """Every sixteenth snapshot as a bundle with its true pose, and the surveyed map of its landmarks."""
    content = loadmat(source)
    names = tuple(f"landmark_{int(row[0])}" for row in content["landmark"])
    write_map(database, LandmarkMap.surveyed(names, names, content["landmark"][:, 1:], MapSource("reference", "mat")))
    seen = content["measurement"][np.argsort(content["measurement"][:, 0], kind="stable")]
    first = np.searchsorted(seen[:, 0], np.arange(1, len(content["groundtruth"]) + 2))
    with create_recording(log) as writer:
        for i in range(0, len(content["groundtruth"]), STRIDE):
            rows, now = seen[first[i] : first[i + 1]], 1 + i * STEP_NS
            points, covariances = points_from_polar(rows[:, 2], rows[:, 3], POLAR)
            options = tuple(((f"landmark_{int(row[1])}", 1.0),) for row in rows)
            ids = tuple(str(k) for k in range(len(rows)))
            scene = SceneObjects(now, "base_footprint", ids, options, points, covariances, np.zeros(len(rows)))
            writer.add(Stamped(SCENE_OBJECTS, now, scene))
            writer.add(Stamped(TRUTH_POSE, now, PoseStamped.planar(now, "map", content["groundtruth"][i, 1:])))


def errors_m(result: Path) -> Array:
    """Distance of every localized snapshot from its true position."""
    outcome, truth, losses = read_run(result)
    assert not losses
    assert len(outcome.trajectory) > 0.99 * (outcome.eligible or 0)
    scored = score(outcome.trajectory, truth, partial(nearest, max_difference_ns=1), aligned=False)
    return np.linalg.norm(scored.estimate[:, :2] - scored.reference[:, :2], axis=1)


def test_snapshots(shared_data: Path, tmp_path: Path) -> None:
    log, database, out = tmp_path / "log.mcap", tmp_path / "map.db", tmp_path / "out.mcap"
    words = ["localize", str(log), "--map", str(database), "-o", str(out), "--overwrite"]
    for setting in ("robust_dof=3", "max_sigma_m=10", "max_sigma_deg=180", "consistency=0"):
        words += ["--set", f"localize.{setting}"]
    found = []
    for number in (1, 2, 3, 4):
        write_snapshots(shared_data / "mrclam" / f"mrclam{number}.mat", log, database)
        with pytest.raises(SystemExit) as stop:
            run(words)
        assert not stop.value.code
        found.append(errors_m(out))
    pooled = np.concatenate(found)
    assert len(pooled) > 4000
    assert np.median(pooled) <= 0.045
    assert (pooled < 0.2).mean() >= 0.96
