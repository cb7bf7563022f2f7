"""What scene objects of road frames are worth: labelled objects that were detected against what they became."""

import contextlib
import io
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap_landmarks.channels import DETECTIONS, SCENE_OBJECTS
from mcap_landmarks.cli.main import run
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.codec import M, decode
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.stage import Channel
from scipy.optimize import linear_sum_assignment

from docs.kitti import CLOUD, base_from_lidar, write_log
from tests.real.roads import Label, Labelled

FITTING = {
    "Car": {"car"},
    "Van": {"car", "truck", "bus"},
    "Truck": {"truck", "bus", "car"},
    "Tram": {"train", "bus"},
    "Pedestrian": {"person"},
    "Person_sitting": {"person"},
    "Cyclist": {"person", "bicycle", "motorcycle", "cyclist"},
}
"""Classes of COCO that a labelled object may have."""
LEAST_IOU, NEAR_M = 0.5, 2.0


@dataclass(frozen=True, slots=True)
class Case:
    """One labelled object that was detected: its class, range from the base in m, how far off in m the scene object
    that it became is (inf if none is near), and that error squared by its covariance (two degrees)."""

    frame: int
    name: str
    range_m: float
    error_m: float
    nees: float


@dataclass(frozen=True, slots=True)
class Judged:
    """The detected objects of some frames, how many scene objects there are, and how many of them stand nowhere near a
    labelled object."""

    cases: tuple[Case, ...]
    objects: int
    wrong: tuple[tuple[int, str, float, float], ...]

    def between(self, low_m: float, high_m: float) -> "Judged":
        """The same of a band of ranges; wrong ones by their own range."""
        wrong = tuple(one for one in self.wrong if low_m <= np.hypot(one[2], one[3]) < high_m)
        return Judged(tuple(one for one in self.cases if low_m <= one.range_m < high_m), self.objects, wrong)

    @property
    def errors_m(self) -> Array:
        """Errors (N,) of those that became scene objects."""
        return np.array([case.error_m for case in self.cases if np.isfinite(case.error_m)])

    @property
    def nees(self) -> float:
        """The mean of errors squared by their covariances; 2 if these are right."""
        known = [case.nees for case in self.cases if np.isfinite(case.nees)]
        return float(np.mean(known)) if known else np.nan

    def within(self, most_m: float) -> int:
        """How many became scene objects that are off by no more."""
        return int((self.errors_m <= most_m).sum())


def judge_frames(data: Path, content: Sequence[Labelled]) -> Judged:
    """Frames through the command line with the stock YOLOv5n of a folder of data, judged."""
    with tempfile.TemporaryDirectory() as folder:
        log, out = Path(folder) / "log.mcap", Path(folder) / "out.mcap"
        write_log(log, content)
        words = ["run", log, "-o", out, "--model", data / "models" / "yolov5n-coco.onnx", "--results-only"]
        words += ["--scan-from", CLOUD.topic, "--stages", "detect,cluster,fuse"]
        with contextlib.redirect_stdout(io.StringIO()):
            try:
                run([str(word) for word in words])
            except SystemExit as done:
                if done.code:
                    raise
        return judge(zip(content, read(out, DETECTIONS), read(out, SCENE_OBJECTS), strict=True))


def read(path: Path, channel: Channel[M]) -> list[M]:
    """All messages of a channel."""
    with open_recording(path) as recording:
        raws = recording.messages(recording.connections(channel.topic))
        return [decode(channel.message, raw.data) for raw in raws]


def judge(content: Iterable[tuple[Labelled, Detections, SceneObjects]]) -> Judged:
    """Hold the detections and scenes of frames against their labels."""
    cases: list[Case] = []
    wrong: list[tuple[int, str, float, float]] = []
    objects = 0
    for frame, detections, scene in content:
        labels = [label for label in frame.labels if label.name != "DontCare"]
        cases += _cases(frame, labels, detections, scene)
        objects += len(scene)
        wrong += _wrong(frame, labels, scene)
    return Judged(tuple(cases), objects, tuple(wrong))


def _cases(frame: Labelled, labels: Sequence[Label], detections: Detections, scene: SceneObjects) -> Iterable[Case]:
    detected = [label for label in labels if label.name in FITTING and _is_detected(label, detections)]
    cost = np.full((len(detected), len(scene)), 1e6)
    for i, label in enumerate(detected):
        off = np.hypot(*(scene.positions_xy - label.centre_m[:2]).T)
        fits = np.array([name in FITTING[label.name] for name in scene.classes], dtype=bool)
        cost[i] = np.where(fits & (off < NEAR_M), off, 1e6)
    rows, columns = linear_sum_assignment(cost)
    became = {int(i): int(j) for i, j in zip(rows, columns, strict=True) if cost[i, j] < NEAR_M}
    for i, label in enumerate(detected):
        range_m, error_m, nees = float(np.hypot(*label.centre_m[:2])), np.inf, np.inf
        if i in became:
            off = scene.positions_xy[became[i]] - label.centre_m[:2]
            error_m = float(np.hypot(*off))
            nees = float(off @ np.linalg.solve(scene.covariances[became[i]], off))
        yield Case(frame.number, label.name, range_m, error_m, nees)


def _is_detected(label: Label, detections: Detections) -> bool:
    names = [options[0][0] for options in detections.hypotheses]
    return any(
        name in FITTING[label.name] and _iou(box, label.box_xyxy) >= LEAST_IOU
        for name, box in zip(names, detections.boxes_xyxy, strict=True)
    )


def _iou(one: Array, other: Array) -> float:
    low, high = np.maximum(one[:2], other[:2]), np.minimum(one[2:], other[2:])
    shared = float(np.prod(np.maximum(high - low, 0.0)))
    return shared / float(np.prod(one[2:] - one[:2]) + np.prod(other[2:] - other[:2]) - shared)


def _wrong(frame: Labelled, labels: Sequence[Label], scene: SceneObjects) -> Iterable[tuple[int, str, float, float]]:
    """Scene objects that are near no labelled object and in no region that nobody labelled."""
    camera_from_base = frame.camera_from_lidar @ frames.inverse(base_from_lidar())
    ignored = [label.box_xyxy for label in frame.labels if label.name == "DontCare"]
    for name, (x, y) in zip(scene.classes, scene.positions_xy.tolist(), strict=True):
        if any(np.hypot(x - label.centre_m[0], y - label.centre_m[1]) < NEAR_M for label in labels):
            continue
        u, v, w = frame.intrinsics @ frames.apply(camera_from_base, np.array([x, y, 0.8]))
        if any(box[0] <= u / w <= box[2] and box[1] <= v / w <= box[3] for box in ignored):
            continue
        yield frame.number, name, x, y
