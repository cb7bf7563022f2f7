"""How well the bundled detector finds objects: on held-out worlds, and in a whole recording of the generator."""

import tempfile
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from mcap_landmarks import resources
from mcap_landmarks.channels import DETECTIONS, TRUTH_DETECTIONS, TRUTH_OBJECTS, TRUTH_POSE
from mcap_landmarks.messages.codec import decode as decode_message
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.runs.pipeline import run_stages
from mcap_landmarks.runs.plan import Request
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.detection import find, prepare, thresholds
from mcap_landmarks.vision.detector import read_detector
from mcap_landmarks.vision.onnx_session import open_session
from mcap_landmarks_generator.assets.catalog import COCO_ID, HELD_OUT_SEEDS
from mcap_landmarks_generator.camera import Intrinsics
from mcap_landmarks_generator.checks import stage
from mcap_landmarks_generator.loading import load_scenario
from mcap_landmarks_generator.record import record
from mcap_landmarks_generator.sensor_specs import CameraSpec
from mcap_landmarks_generator.training.pictures import Labels, Picture, render
from mcap_landmarks_generator.training.scoring import Found, Scored, iou, joined, score
from mcap_landmarks_generator.training.worlds import THESIS_CLASSES, Kind, judged, scene
from numpy.typing import NDArray

from tests.benchmark.rows import Row

SEED = 10_000
VIEWS = 8
LEAST_SCORE = 0.01
SHIPPED = 1.0
NEAR_TO_FAR_M = ((2.0, 8.0), (8.0, 12.0), (12.0, 15.0))
FINE_M = (2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 15.0)
IMAGES: dict[Kind, int] = {"thesis": 1200, "twelve": 800, "empty": 800}


class Detector:
    """A model of the generator's training, run as the stage runs it."""

    def __init__(self, path: Path) -> None:
        self._config = DetectConfig(confidence=LEAST_SCORE)
        self._model = read_detector(open_session(path), None, self._config)
        self.thresholds = self._model.confidence
        self._shipped = np.array([self.thresholds.get(name, 1.0) for name in self._model.names])
        self._above = thresholds(self._model, self._config)

    def find(self, image: NDArray[np.uint8]) -> Found:
        """What it finds, down to scores far below its thresholds, so that precision has a curve.

        Scores are in units of their class's threshold: `SHIPPED` is where the stage cuts.
        """
        prepared = prepare(image, self._model, self._config)
        outputs = [self._model.run(part.array) for part in prepared]
        found = find(outputs, prepared, self._model, self._above, self._config)
        scores = found.scores.astype(float) / self._shipped[found.class_ids]
        return Found(found.boxes_xyxy, scores, found.class_ids.astype(np.int64))


def measure(quick: bool) -> Iterator[Row]:
    """The rows of step 3 about what is found; worlds, looks and places that no training saw."""
    detector = Detector(resources.detector())
    results: dict[Kind, tuple[list[Found], list[Picture]]] = {}
    for kind, images in IMAGES.items():
        shown = list(_worlds(kind, images // 8 if quick else images))
        results[kind] = [detector.find(picture.image) for picture in shown], shown
    found, shown = results["thesis"]
    labels = [picture.labels for picture in shown]
    by_class = {name: score(found, _at_2_to_15_m(labels), COCO_ID[name]) for name in COCO_ID}
    thesis = joined([by_class[name] for name in THESIS_CLASSES])
    yield _mean_precision("map50_thesis", by_class, THESIS_CLASSES, 0.95)
    for (near, far), goal in zip(NEAR_TO_FAR_M, (0.98, 0.93, 0.85), strict=True):
        cases = int(((thesis.distances_m >= near) & (thesis.distances_m < far)).sum())
        by_kind = {name: by_class[name].recall(SHIPPED, near, far) for name in THESIS_CLASSES}
        value = thesis.recall(SHIPPED, near, far)
        yield Row(f"recall_{near:g}_{far:g}", value, at_least=goal, cases=cases, peers=by_kind)
    empty, _ = results["empty"]
    false = [bool((one.scores > SHIPPED).any()) for one in empty]
    yield Row("false_images", float(np.mean(false)), at_most=0.02, cases=len(false), peers=dict(detector.thresholds))
    everything = joined(list(by_class.values()))
    yield Row("precision", everything.precision(SHIPPED), at_least=0.97, cases=int((everything.scores > SHIPPED).sum()))
    found_12, shown_12 = results["twelve"]
    labels_12 = [picture.labels for picture in shown_12]
    of_twelve = {name: score(found_12, labels_12, COCO_ID[name]) for name in COCO_ID}
    yield _mean_precision("map50_12", of_twelve, tuple(COCO_ID), None)
    yield _bearing_error(found, shown)
    yield from small_log()


def _worlds(kind: Kind, images: int) -> Iterator[Picture]:
    for index in range(images // VIEWS):
        yield from render(scene(judged(kind, HELD_OUT_SEEDS), SEED, index), exposed=True)


def _at_2_to_15_m(labels: Sequence[Labels]) -> list[Labels]:
    """The labels with what is nearer or farther said to be hardly visible: found or not, it does not count."""
    out = []
    for one in labels:
        counts = (one.distances_m >= FINE_M[0]) & (one.distances_m < FINE_M[-1])
        out.append(Labels(one.classes, one.boxes_xyxy, np.where(counts, one.shares, 0.0), one.distances_m))
    return out


def _mean_precision(name: str, by_class: dict[str, Scored], names: Sequence[str], goal: float | None) -> Row:
    values = {one: by_class[one].average_precision() for one in names}
    cases = sum(len(by_class[one].found_at) for one in names)
    return Row(name, float(np.mean(list(values.values()))), at_least=goal, cases=cases, peers=values)


def _bearing_error(found: Sequence[Found], shown: Sequence[Picture]) -> Row:
    """Median of the angle between a box's centre column and the object's centre; all of it visible, by distance."""
    focal_px, middle_px = Intrinsics.of(CameraSpec()).focal_px, CameraSpec().width_px / 2
    thesis_ids = [COCO_ID[name] for name in THESIS_CLASSES]
    errors, distances = [], []
    for one, picture in zip(found, shown, strict=True):
        labels = picture.labels
        overlap = iou(one.boxes_xyxy, labels.boxes_xyxy) * (one.classes[:, None] == labels.classes)
        overlap[one.scores <= SHIPPED] = 0
        for index in np.flatnonzero((labels.shares > 0.95) & np.isin(labels.classes, thesis_ids)):
            best = int(overlap[:, index].argmax()) if len(overlap) else 0
            if len(overlap) and overlap[best, index] > 0.5:
                column = one.boxes_xyxy[best, [0, 2]].mean()
                errors.append(abs(np.rad2deg(np.arctan2(middle_px - column, focal_px) - picture.bearings_rad[index])))
                distances.append(labels.distances_m[index])
    by_distance = {}
    for near, far in pairwise(FINE_M):
        within = (np.array(distances) >= near) & (np.array(distances) < far)
        by_distance[f"{near:g}-{far:g} m"] = float(np.median(np.array(errors)[within]))
    return Row("bearing_error", float(np.median(errors)), "deg", cases=len(errors), peers=by_distance)


def small_log() -> Iterator[Row]:
    """The log `small`: share of its objects found in each image by distance, and the detections that are none."""
    with tempfile.TemporaryDirectory() as folder:
        log, out = Path(folder) / "small.mcap", Path(folder) / "out.mcap"
        record(stage(load_scenario("small", seed=SEED)), log)
        run_stages(Request(log, files={"model": resources.detector()}), out, ["detect"], "detect")
        found, labels = _read(out)
    parts = joined([score(found, labels, coco_id) for coco_id in COCO_ID.values()])
    for near, far in pairwise(FINE_M):
        within = (parts.distances_m >= near) & (parts.distances_m < far)
        cases = int(within.sum())
        if cases:
            yield Row(f"small_recall_{near:g}_{far:g}", parts.recall(0.0, near, far), cases=cases)
    yield Row("small_precision", parts.precision(0.0), cases=len(parts.scores), peers={"images": len(found)})


def _read(path: Path) -> tuple[list[Found], list[Labels]]:
    """Detections and truth of a recording, image by image."""
    with open_recording(path) as recording:
        columns = {
            channel: [
                decode_message(channel.message, raw.data)
                for raw in recording.messages(recording.connections(channel.topic))
            ]
            for channel in (DETECTIONS, TRUTH_DETECTIONS, TRUTH_OBJECTS, TRUTH_POSE)
        }
    objects = columns[TRUTH_OBJECTS][0]
    places = dict(zip(objects.ids, objects.positions_xy, strict=True))
    poses = columns[TRUTH_POSE]
    stamps = np.array([pose.stamp_ns for pose in poses])
    truth = {one.stamp_ns: one for one in columns[TRUTH_DETECTIONS]}
    found, labels = [], []
    for one in columns[DETECTIONS]:
        seen = truth[one.stamp_ns]
        pose = poses[int(np.abs(stamps - one.stamp_ns).argmin())]
        away = np.array([places[name] - pose.position_m[:2] for name in seen.ids]).reshape(-1, 2)
        ids, scores = _best(one.hypotheses), [options[0][1] for options in one.hypotheses]
        found.append(Found(one.boxes_xyxy, np.array(scores), ids))
        shares = np.array([options[0][1] for options in seen.hypotheses])
        labels.append(Labels(_best(seen.hypotheses), seen.boxes_xyxy, shares, np.hypot(away[:, 0], away[:, 1])))
    return found, labels


def _best(hypotheses: Sequence[Sequence[tuple[str, float]]]) -> NDArray[np.int64]:
    return np.array([COCO_ID.get(options[0][0], -1) for options in hypotheses], np.int64)
