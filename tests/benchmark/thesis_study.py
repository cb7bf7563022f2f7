"""The thesis's section 5.2 as a study: how the LiDAR's resolution and an object's shape limit centres and positions.

Clusters get the class of the true object that they lie at, as from a perfect detector, so that only the LiDAR counts.
"""

import tempfile
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from mcap_landmarks.channels import SCAN_OBJECTS, SCENE_OBJECTS
from mcap_landmarks.evaluation.pose_metrics import position_figures
from mcap_landmarks.evaluation.read import read_reference
from mcap_landmarks.evaluation.trajectory import Trajectory, interpolated
from mcap_landmarks.geometry.se2 import inverse, transform_points
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Stamped
from mcap_landmarks_generator.bundled import FOLDER

from tests.benchmark.rows import Row
from tests.benchmark.thesis_runs import Array, at_stops, call, cut, stops_of

RESOLUTIONS = {"1_deg": 360, "0_5_deg": 720, "0_25_deg": 1440}
SHAPES = {"fire hydrant": "disc", "person": "legs", "suitcase": "box"}
_SAME_M, _NEAR_M, _FAR_M = 0.5, 2.0, 10.0
_GAP_NS = 500_000_000
Errors = dict[str, list[tuple[float, float]]]


def study_rows(seed: int, quick: bool) -> Iterator[Row]:
    """Median error of the centre of disc, legs and box from one scan at 2 to 10 m, and of positions, by resolution.

    Beside the centre's error stands that of the middle of the surface that the scan sees, as the thesis takes it.
    """
    for name, beams in list(RESOLUTIONS.items())[: 1 if quick else None]:
        with tempfile.TemporaryDirectory() as folder:
            errors, position = _study(Path(folder), seed, beams)
        for shape in SHAPES.values():
            centre, surface = np.array(errors[shape]).reshape(-1, 2).T
            peers = {"near surface": float(np.median(surface))}
            yield Row(f"centre_{shape}_{name}", float(np.median(centre)), "m", cases=len(centre), peers=peers)
        yield Row(f"position_{name}", position[0], "m", cases=position[1])


def _study(folder: Path, seed: int, beams: int) -> tuple[Errors, tuple[float, int]]:
    """Errors of centre and surface in metres by shape; RMSE of positions from one scan each, and how many there are."""
    names = ("log", "standing", "seen", "labelled", "result")
    log, standing, seen, labelled, result = (folder / f"{name}.mcap" for name in names)
    settings = [f"--set=lidar.beams={beams}", "--set=camera.when=never"]
    call("generate", _on_legs(folder), "-o", log, "--seed", seed, "--workers", 1, *settings)
    stops = stops_of(log)
    cut(log, log, stops, standing)
    call("cluster", standing, "-o", seen)
    errors = _label(seen, labelled)
    call("map", labelled, "--from-reference", "--map", folder / "map.db")
    call("localize", labelled, "--map", folder / "map.db", "-o", result, "--set", "localize.join_m=0")
    positions = at_stops(result, stops, aligned=False)
    found = np.isfinite(positions.one_scan[:, 0])
    off = np.column_stack([(positions.one_scan - positions.truth)[found], np.zeros(int(found.sum()))])
    rmse_m = position_figures(off)["rmse_m"]
    return errors, (float("nan") if rmse_m is None else rmse_m, int(found.sum()))


def _on_legs(folder: Path) -> Path:
    """The scenario thesis_localize with people on legs, which in the bundled one wear coats."""
    world = (FOLDER / "thesis_map.toml").read_text()
    (folder / "world.toml").write_text(world.replace('class = "person",', 'class = "person", variant = "legs",'))
    drive = (FOLDER / "thesis_localize.toml").read_text()
    scenario = folder / "study.toml"
    scenario.write_text(drive.replace('extends = "thesis_map"', 'extends = "world.toml"'))
    return scenario


def _label(log: Path, target: Path) -> Errors:
    """Write the log with the clusters at true objects as scene objects; give the errors of each shape's centres."""
    truth, _ = read_reference(log)
    assert truth.trajectory is not None
    assert truth.objects is not None
    errors: Errors = defaultdict(list)
    with open_recording(log) as recording, create_recording(target) as writer:
        for entry in recording.channels:
            writer.declare(entry.connection)
        for raw in recording.messages():
            writer.write(raw)
            if raw.connection.topic == SCAN_OBJECTS.topic:
                scan = decode(SCAN_OBJECTS.message, raw.data)
                at = Trajectory.of(np.array([scan.stamp_ns]), np.zeros((1, 3)))
                pose = interpolated(at, truth.trajectory, _GAP_NS).reference
                if len(pose):
                    scene = _scene(scan, truth.objects, pose[0], errors)
                    writer.add(Stamped(SCENE_OBJECTS, raw.log_time_ns, scene))
    return errors


def _scene(scan: ScanObjects, objects: SceneObjects, map_from_base: Array, errors: Errors) -> SceneObjects:
    places = transform_points(inverse(map_from_base), objects.positions_xy)
    ids, hypotheses, positions, covariances = [], [], [], []
    for i, options in enumerate(scan.hypotheses):
        names = [name for name, _ in options]
        surface = scan.positions_xy[i][-1]
        nearest = int(np.argmin(np.linalg.norm(places - surface, axis=1)))
        name, off_m = objects.classes[nearest], float(np.linalg.norm(places[nearest] - surface))
        if off_m > _SAME_M or name not in names:
            continue
        row = names.index(name)
        centre = scan.positions_xy[i][row]
        if _NEAR_M <= np.linalg.norm(places[nearest]) <= _FAR_M:
            errors[SHAPES[name]].append((float(np.linalg.norm(centre - places[nearest])), off_m))
        ids.append(scan.ids[i])
        hypotheses.append(((name, 1.0),))
        positions.append(centre)
        covariances.append(scan.covariances[i][row])
    return SceneObjects(
        scan.stamp_ns,
        scan.frame_id,
        tuple(ids),
        tuple(hypotheses),
        np.array(positions).reshape(-1, 2),
        np.array(covariances).reshape(-1, 2, 2),
        np.zeros(len(ids)),
    )
