"""Fusion when detections err: objects and positions from truth's boxes, spoilt as a poor detector would."""

import dataclasses
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap_landmarks.channels import (
    CAMERA_IMAGE,
    DETECTIONS,
    MATCH,
    SCAN,
    SCENE_OBJECTS,
    TRUTH_DETECTIONS,
    TRUTH_OBJECTS,
    TRUTH_POSE,
)
from mcap_landmarks.geometry.se2 import Array, interpolate, inverse, transform_points
from mcap_landmarks.messages.codec import M, decode
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.match import Status
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.recording.reader import Recording, open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Channel, Stamped
from mcap_landmarks_generator.robot import SCAN_IN_BASE_M

from tests.benchmark.rows import Row
from tests.benchmark.thesis_runs import call

SEED = 10_000
WIDTH_PX, HEIGHT_PX = 640, 480
LEAST_SHARE, LEAST_HEIGHT_PX = 0.3, 10.0
NEAR_M = 0.35
LARGE_M = {"car": 1.0, "bench": 0.5, "bicycle": 0.5}
"""How far off an object's centre may be and still be that object's; large ones some more."""
REACH_M = 12.0
MET_M, LEAST_HITS = 0.12, 2
"""A beam meets an object if it ends so near its outline, which the robot's way during the scan blurs."""


@dataclass(frozen=True, slots=True)
class Spoiling:
    """What is wrong with detections: shares that are dropped and misnamed, and boxes of nothing per image."""

    dropped: float = 0.0
    misnamed: float = 0.0
    spurious: int = 0


POOR = Spoiling(0.1, 0.05, 1)


@dataclass(frozen=True, slots=True)
class Tally:
    """Scene objects that are right and wrong, and objects that had been named, are within reach, and are missing.

    Of those `met` are the ones that the scan itself meets, with two hits or more: no scan tells of the others, which
    stand behind something or between two beams.
    """

    right: int
    wrong: int
    missed: int
    met: int


def rows(quick: bool) -> Iterator[Row]:
    """Positions from spoilt detections, and what a cluttered street does to scenes."""
    with tempfile.TemporaryDirectory() as folder:
        yield from spoilt_positions(Path(folder), 4 if quick else 17)
        if not quick:
            yield from cluttered_scenes(Path(folder))


def spoilt_positions(folder: Path, repeats: int) -> Iterator[Row]:
    """The log `small` localized again and again in the map of another one, both from spoilt detections."""
    logs = [scanned(folder, "small", SEED + i) for i in (0, 1)]
    mapped, database = folder / "mapped.mcap", folder / "map.db"
    spoil(logs[0], mapped, POOR, SEED)
    call("map", mapped, "--map", database)
    bundles = false = seeing = localized = 0
    for repeat in range(repeats):
        spoilt, out = folder / "spoilt.mcap", folder / "localized.mcap"
        spoil(logs[1], spoilt, POOR, SEED + 1 + repeat)
        document = call("localize", spoilt, "--map", database, "-o", out, "--overwrite", "--force")
        bundles += document["bundles"]
        false += call("evaluate", out, "--align")["false"]["count"]
        more, found = _localized_of_seeing(out)
        seeing, localized = seeing + more, localized + found
    yield Row("spoilt detections: false positions", false, "", at_most=0, cases=bundles)
    share = localized / max(seeing, 1)
    yield Row("spoilt detections: localized of those that see three", share, "", at_least=0.85, cases=seeing)


def cluttered_scenes(folder: Path) -> Iterator[Row]:
    """Scene objects of the log `cluttered` with truth's boxes, and with spoilt ones; the thesis's method beside."""
    log = scanned(folder, "cluttered", SEED)
    for label, spoiling in (("", Spoiling()), (", spoilt detections", POOR)):
        given, out = folder / "given.mcap", folder / "fused.mcap"
        spoil(log, given, spoiling, SEED)
        call("fuse", given, "-o", out, "--overwrite", "--force")
        found = tally(out)
        thesis_way = ("--stages", "cluster,fuse", "--method", "thesis", "--overwrite", "--force")
        call("run", given, "-o", out, *thesis_way)
        thesis = tally(out)
        peers = {
            f"{whose}{key}": float(value)
            for whose, counted in (("", found), ("thesis ", thesis))
            for key, value in dataclasses.asdict(counted).items()
        }
        whole = max(found.right + found.wrong, 1)
        yield Row(f"cluttered{label}: scene objects that are right", found.right / whole, "", cases=whole, peers=peers)


def scanned(folder: Path, name: str, seed: int) -> Path:
    """A generated log with scan objects."""
    raw, log = folder / f"{name}_{seed}_raw.mcap", folder / f"{name}_{seed}.mcap"
    call("generate", name, "-o", raw, "--seed", seed, "--workers", 1)
    call("cluster", raw, "-o", log)
    raw.unlink()
    return log


def spoil(log: Path, target: Path, spoiling: Spoiling, seed: int) -> None:
    """Write a log with detections made of its true ones, and without its images."""
    rng = np.random.default_rng(seed)
    with open_recording(log) as recording, create_recording(target, recording.metadata) as writer:
        classes = sorted({*_first(recording, TRUTH_OBJECTS).classes})
        gone = {CAMERA_IMAGE.topic, DETECTIONS.topic}
        kept = [entry.connection for entry in recording.channels if entry.connection.topic not in gone]
        for connection in kept:
            writer.declare(connection)
        for raw in recording.messages(kept):
            writer.write(raw)
            if raw.connection.topic == TRUTH_DETECTIONS.topic:
                truth = decode(Detections, raw.data)
                writer.add(Stamped(DETECTIONS, raw.log_time_ns, _spoilt(truth, spoiling, classes, rng)))


def _spoilt(truth: Detections, spoiling: Spoiling, classes: list[str], rng: np.random.Generator) -> Detections:
    boxes: list[Array] = []
    options: list[tuple[tuple[str, float], ...]] = []
    for ((name, share),), box in zip(truth.hypotheses, truth.boxes_xyxy, strict=True):
        size = np.array([box[2] - box[0], box[3] - box[1]] * 2)
        seen = share >= LEAST_SHARE and size[1] >= LEAST_HEIGHT_PX and rng.random() >= spoiling.dropped
        moved = np.clip(box + rng.normal(0, 1, 4) * np.hypot(0.03 * size, 1.0), 0, [WIDTH_PX, HEIGHT_PX] * 2)
        if not seen or (moved[2:] - moved[:2]).min() < 2:
            continue
        others = [other for other in classes if other != name]
        wrong = rng.random() < spoiling.misnamed
        boxes.append(moved)
        options.append(((str(rng.choice(others)) if wrong else name, float(rng.uniform(0.5, 0.95))),))
    for _ in range(spoiling.spurious):
        size = rng.uniform([15, 20], [200, 250])
        corner = rng.uniform([0, 0], [WIDTH_PX, HEIGHT_PX] - size)
        boxes.append(np.concatenate([corner, corner + size]))
        options.append(((str(rng.choice(classes)), float(rng.uniform(0.3, 0.9))),))
    return dataclasses.replace(
        truth, ids=("",) * len(boxes), hypotheses=tuple(options), boxes_xyxy=np.array(boxes).reshape(-1, 4)
    )


def tally(log: Path) -> Tally:
    """Scene objects against the truth; an object counts as missing from its first scene on, within reach."""
    right = wrong = missed = met = 0
    named: set[str] = set()
    scans = hits_by_stamp(log)
    for scene, truth, places in scenes_with_truth(log):
        pairs = matched(scene, truth, places)
        right, wrong = right + len(pairs), wrong + len(scene) - len(pairs)
        found = {*pairs.values()}
        named |= {truth.ids[i] for i in found}
        missing = [
            i
            for i, place in enumerate(places)
            if truth.ids[i] in named and i not in found and np.hypot(*place) < REACH_M
        ]
        away = np.hypot(*(scans[scene.stamp_ns][:, None] - places[missing]).transpose(2, 0, 1))
        hits = (away < truth.radii_m[missing] + MET_M).sum(axis=0)
        missed, met = missed + len(missing), met + int((hits >= LEAST_HITS).sum())
    return Tally(right, wrong, missed, met)


def hits_by_stamp(log: Path) -> dict[int, Array]:
    """What the beams of each scan meet (N, 2) in the base frame, as if the robot stood meanwhile."""
    found = {}
    with open_recording(log) as recording:
        for scan in _all(recording, SCAN):
            angles = scan.angle_min_rad + np.arange(len(scan.ranges_m)) * scan.angle_increment_rad
            is_hit = (scan.ranges_m > scan.range_min_m) & (scan.ranges_m < scan.range_max_m)
            along = np.column_stack([np.cos(angles), np.sin(angles)])[is_hit]
            found[scan.stamp_ns] = scan.ranges_m[is_hit, None] * along + SCAN_IN_BASE_M[:2]
    return found


def matched(scene: SceneObjects, truth: SceneObjects, places: Array) -> dict[int, int]:
    """Scene objects and the true ones, at places (N, 2) in the base frame, that they are."""
    pairs: dict[int, int] = {}
    for k, name in enumerate(scene.classes):
        free = [i for i, own in enumerate(truth.classes) if own == name and i not in pairs.values()]
        away = np.hypot(*(places[free] - scene.positions_xy[k]).T)
        if free and away.min() < NEAR_M + LARGE_M.get(name, 0.0):
            pairs[k] = free[int(away.argmin())]
    return pairs


def scenes_with_truth(log: Path) -> Iterator[tuple[SceneObjects, SceneObjects, Array]]:
    """Every scene with the true objects and their places (N, 2) in the base frame, where the true pose is known."""
    with open_recording(log) as recording:
        poses, truths = _all(recording, TRUTH_POSE), _all(recording, TRUTH_OBJECTS)
        times = np.array([pose.stamp_ns for pose in poses], dtype=np.int64)
        path = np.array([pose.pose for pose in poses])
        starts = np.array([truth.stamp_ns for truth in truths], dtype=np.int64)
        for scene in _all(recording, SCENE_OBJECTS):
            if times[0] <= scene.stamp_ns <= times[-1]:
                truth = truths[max(0, int(np.searchsorted(starts, scene.stamp_ns, side="right")) - 1)]
                map_from_base = interpolate(times, path, np.array([scene.stamp_ns], dtype=np.int64))[0]
                yield scene, truth, transform_points(inverse(map_from_base), truth.positions_xy)


def _localized_of_seeing(log: Path) -> tuple[int, int]:
    """Bundles whose scene has at least three of the map's objects, and how many of them were localized."""
    with open_recording(log) as recording:
        status = {match.stamp_ns: match.status for match in _all(recording, MATCH)}
    seeing = [scene.stamp_ns for scene, *truth in scenes_with_truth(log) if len(matched(scene, *truth)) >= 3]
    return len(seeing), sum(status[stamp_ns] == Status.LOCALIZED for stamp_ns in seeing)


def _all(recording: Recording, channel: Channel[M]) -> list[M]:
    return [decode(channel.message, raw.data) for raw in recording.messages(recording.connections(channel.topic))]


def _first(recording: Recording, channel: Channel[M]) -> M:
    return decode(channel.message, next(recording.messages(recording.connections(channel.topic))).data)
