"""What the bundled network makes of photographs, which it was never trained on: false boxes, and what it finds.

python -m tests.benchmark.photographs [--json] [--quick] [--model FILE.onnx]

Thresholds are chosen, and training is judged, on the street of 31 frames alone; the other images are reported only.
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import cv2
import numpy as np
from mcap_landmarks import resources
from mcap_landmarks_generator.assets.catalog import COCO_ID
from mcap_landmarks_generator.training.scoring import Found, iou
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tests.benchmark.detections import SHIPPED, Detector
from tests.benchmark.rows import Row, main
from tests.real import roads
from tests.real.roads_judge import FITTING, LEAST_IOU
from tests.shared import data_folder

Boxes = NDArray[np.float64]

NAMES = {coco_id: name for name, coco_id in COCO_ID.items()}
# Of a box that lies by more than half in a region without labels nobody knows whether it is right.
INSIDE = 0.5
BY_HAND = {
    "dog.jpg": [("bicycle", (123, 115, 572, 420)), ("truck", (468, 76, 687, 171))],
    "person.jpg": [("person", (190, 98, 272, 381))],
    "horses.jpg": [],
}
"""Classes of COCO and boxes in pixels, labelled by hand, of what the network knows (and of a truck that may pass for a
car)."""
CAMPUS = {"Car": "Car", "Truck": "Truck", "Bus": "Truck", "Pedestrian": "Pedestrian", "Rider": "Cyclist"}
"""Labels of the campus gate as KITTI's; its parked motorcycles are no class of the network."""
FAR_M = 60.0
"""Labels of the campus gate reach farther than a camera shows."""


@dataclass(frozen=True, slots=True, eq=False)
class Photograph:
    """An image (H, W, 3) in RGB, its N labels (the classes of COCO that fit, and boxes (N, 4)), and regions (M, 4) that
    nobody labelled."""

    image: NDArray[np.uint8]
    fitting: Sequence[set[str]]
    boxes_xyxy: Boxes
    unlabelled_xyxy: Boxes


def street(data: Path) -> Iterator[Photograph]:
    """The 31 frames of a street of parked cars: what is developed on."""
    for frame in roads.drive_frames(data / "roads" / "kitti_tracking_0001", roads.DRIVE):
        yield _of_kitti(frame)


def reported(data: Path) -> Iterator[tuple[str, Photograph]]:
    """The images that are reported only, with the name of their set."""
    for frame in roads.single_frames(data / "roads" / "kitti_object", roads.SINGLE):
        yield "KITTI", _of_kitti(frame)
    for camera, number in product(("front", "left", "right"), (965, 970, 975)):
        yield "campus", _of_campus(data / "roads" / "sustech_road", camera, f"{number:06d}")
    for name, labels in BY_HAND.items():
        fitting = [{name, "car"} if name == "truck" else {name} for name, _ in labels]
        boxes = np.array([box for _, box in labels], float).reshape(-1, 4)
        yield "photos", Photograph(_read(data / "photos" / name), fitting, boxes, np.zeros((0, 4)))


def _of_kitti(frame: roads.Labelled) -> Photograph:
    image = cv2.imdecode(np.frombuffer(frame.picture, np.uint8), cv2.IMREAD_COLOR)
    labels = [label for label in frame.labels if label.name in FITTING]
    others = [label.box_xyxy for label in frame.labels if label.name not in FITTING]
    return Photograph(
        np.asarray(image[..., ::-1], np.uint8),
        [FITTING[label.name] for label in labels],
        np.array([label.box_xyxy for label in labels]).reshape(-1, 4),
        np.array(others).reshape(-1, 4),
    )


def _of_campus(folder: Path, camera: str, number: str) -> Photograph:
    """A camera's image at the campus gate; its boxes are those of the labelled cuboids' projections."""
    image = _read(folder / "camera" / camera / f"{number}.jpg")
    calibration = json.loads((folder / "calib" / f"{camera}.json").read_text())
    camera_from_lidar = np.reshape(calibration["extrinsic"], (4, 4))
    intrinsics = np.reshape(calibration["intrinsic"], (3, 3))
    fitting, boxes, others = [], [], []
    for label in json.loads((folder / "label" / f"{number}.json").read_text()):
        place, scale, turn = (np.array([label["psr"][key][axis] for axis in "xyz"]) for key in _CUBOID)
        corners = np.array(list(product((-0.5, 0.5), repeat=3))) * scale
        points = corners @ Rotation.from_euler("xyz", turn).as_matrix().T + place
        local = points @ camera_from_lidar[:3, :3].T + camera_from_lidar[:3, 3]
        if local[:, 2].min() < 0.1:
            continue
        pixels = (local @ intrinsics.T)[:, :2] / local[:, 2:]
        size = [image.shape[1], image.shape[0]]
        low, high = (np.clip(limit, 0, size) for limit in (pixels.min(axis=0), pixels.max(axis=0)))
        if (high - low).min() > 1:
            name = CAMPUS.get(label["obj_type"])
            known = name is not None and np.hypot(place[0], place[1]) < FAR_M
            (boxes if known else others).append([*low, *high])
            fitting += [FITTING[name]] if known and name is not None else []
    return Photograph(image, fitting, np.array(boxes).reshape(-1, 4), np.array(others).reshape(-1, 4))


_CUBOID = ("position", "scale", "rotation")


def _read(path: Path) -> NDArray[np.uint8]:
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_COLOR)[..., ::-1], np.uint8)


@dataclass(frozen=True, slots=True)
class Told:
    """What became of the boxes in some photographs: false ones by class, and the labelled and the found by class."""

    images: int
    false: Counter[str]
    labelled: Counter[str]
    found: Counter[str]


def judge(detector: Detector, shown: Sequence[Photograph]) -> Told:
    """Hold what a network finds above its thresholds against the labels."""
    false, labelled, found = Counter[str](), Counter[str](), Counter[str]()
    for photograph in shown:
        _judge_one(detector.find(photograph.image), photograph, false, labelled, found)
    return Told(len(shown), false, labelled, found)


def _judge_one(
    one: Found, photograph: Photograph, false: Counter[str], labelled: Counter[str], found: Counter[str]
) -> None:
    above = one.scores > SHIPPED
    boxes, names = one.boxes_xyxy[above], [NAMES[int(coco_id)] for coco_id in one.classes[above]]
    overlap = iou(boxes, photograph.boxes_xyxy)
    fits = np.array([[name in options for options in photograph.fitting] for name in names], bool)
    right = (overlap >= LEAST_IOU) & fits.reshape(overlap.shape)
    unknown = _inside(boxes, photograph.unlabelled_xyxy) > INSIDE
    for name, hit, excused in zip(names, right.any(axis=1), unknown.any(axis=1), strict=True):
        false[name] += not hit and not excused
    for options, hit in zip(photograph.fitting, right.any(axis=0), strict=True):
        name = "car" if "car" in options else "cyclist" if "cyclist" in options else min(options)
        labelled[name] += 1
        found[name] += bool(hit)


def _inside(boxes: Boxes, regions: Boxes) -> Boxes:
    """Share (N, M) of each box that lies in each region."""
    low, high = np.maximum(boxes[:, None, :2], regions[:, :2]), np.minimum(boxes[:, None, 2:], regions[:, 2:])
    return np.clip(high - low, 0, None).prod(axis=2) / (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)[:, None]


def measure(quick: bool, model: Path | None = None) -> Iterator[Row]:
    """False boxes per image and what is found: the street that is developed on, then what is reported."""
    data = data_folder()
    if data is None:
        raise SystemExit("no data at ../shared/data; set MCAP_LANDMARKS_DATA to where it lies")
    detector = Detector(model or resources.detector())
    developed = list(street(data))[:: 4 if quick else 1]
    yield from _rows("street, developed on", judge(detector, developed), goal=False)
    held = list(reported(data))
    for of in ("KITTI", "campus", "photos"):
        yield from _rows(of, judge(detector, [photograph for name, photograph in held if name == of]), goal=False)
    yield from _rows("reported", judge(detector, [photograph for _, photograph in held]), goal=True)


def _rows(label: str, told: Told, goal: bool) -> Iterator[Row]:
    by_class = {name: float(count) for name, count in told.false.most_common() if count}
    false = told.false.total() / told.images
    yield Row(
        f"{label}: false boxes per image", false, at_most=0.5 if goal else None, cases=told.images, peers=by_class
    )
    for name, count in sorted(told.labelled.items()):
        yield Row(f"{label}: {name} found", told.found[name] / count, cases=count)


if __name__ == "__main__":
    other = argparse.ArgumentParser(add_help=False)
    other.add_argument("--model", type=Path, help="another network than the bundled one")
    sys.exit(main(measure, "What the bundled network makes of photographs.", other))
