"""Whether networks that never saw the generator's objects recognise them: the stock YOLOv5n, and NanoDet beside it.

python -m tests.benchmark.appearance [--json] [--quick] [--first SEED] [--only CLASS,...]
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap_landmarks.networks.cache import cached
from mcap_landmarks.vision.config import USUAL_CONFIDENCE, DetectConfig
from mcap_landmarks.vision.detection import find, prepare, thresholds
from mcap_landmarks.vision.detector import read_detector
from mcap_landmarks.vision.onnx_session import open_session
from mcap_landmarks_generator.assets.catalog import COCO_ID, HELD_OUT_SEEDS
from mcap_landmarks_generator.optics import Image
from mcap_landmarks_generator.training.scoring import iou

from tests.benchmark.lone_objects import View, views
from tests.benchmark.rows import Row, main
from tests.shared import data_folder

DISTANCES_M = ((2.0, 5.0), (5.0, 10.0), (10.0, 15.0))
GOALS = {
    "person": (0.9, 0.75),
    "fire hydrant": (0.9, 0.75),
    "suitcase": (0.7,),
}
"""Shares of the views to be found, nearest first."""
# On a view that is right in the middle of a share of one half, 200 views leave a standard deviation of 0.035.
VIEWS, QUICK_VIEWS = 200, 40
LEAST_SHARE, OVERLAP = 0.9, 0.5
PEER = "nanodet"


@dataclass(frozen=True, slots=True)
class Said:
    """What a network said of an object: whether it found it, and the class of its surest box there, if any."""

    right: bool
    instead: str | None


class Network:
    """A detector that is asked for everything above a confidence."""

    def __init__(self, path: Path, confidence: float = USUAL_CONFIDENCE) -> None:
        self._config = DetectConfig(confidence=confidence)
        self._model = read_detector(open_session(path, threads=1), None, self._config)
        self._above = thresholds(self._model, self._config)

    def asked(self, image: Image, class_name: str, box_xyxy: np.ndarray) -> Said:
        """Whether it finds an object of a class in its box (4,)."""
        prepared = prepare(image, self._model, self._config)
        outputs = [self._model.run(part.array) for part in prepared]
        found = find(outputs, prepared, self._model, self._above, self._config)
        there = np.flatnonzero(iou(found.boxes_xyxy, box_xyxy[None])[:, 0] > OVERLAP)
        names = [self._model.names[found.class_ids[i]] for i in there]
        return Said(class_name in names, next((name for name in names if name != class_name), None))


def measure(quick: bool, first: int = HELD_OUT_SEEDS.start, only: Sequence[str] = ()) -> Iterator[Row]:
    """Shares of the views found by class and distance, with what was said instead where it was not."""
    data = data_folder()
    if data is None:
        raise SystemExit("no data at ../shared/data; set MCAP_LANDMARKS_DATA to where it lies")
    networks = {"yolov5n": Network(data / "models" / "yolov5n-coco.onnx")}
    if PEER in cached():
        networks[PEER] = Network(cached()[PEER])
    else:
        print(f"no {PEER}: `mcap-landmarks models get {PEER}` fetches it", file=sys.stderr)
    for name in only or COCO_ID:
        for band, (near, far) in enumerate(DISTANCES_M):
            shown = views(name, (near, far), first + band, QUICK_VIEWS if quick else VIEWS, LEAST_SHARE)
            goal = (*GOALS.get(name, ()), None, None, None)[band]
            yield from _rows(f"{name} {near:g}-{far:g} m", goal, shown, networks)


def _rows(name: str, goal: float | None, shown: Iterator[View], networks: dict[str, Network]) -> Iterator[Row]:
    """A row of each network; its peers are the shares of other classes that it saw in the object's place instead."""
    said: dict[str, list[Said]] = defaultdict(list)
    for view in shown:
        for network, asked in networks.items():
            said[network].append(asked.asked(view.image, view.class_name, view.box_xyxy))
    for network, answers in said.items():
        wrong = [answer.instead for answer in answers if answer.instead and not answer.right]
        instead = {other: wrong.count(other) / len(answers) for other in sorted(set(wrong), key=wrong.count)[-3:]}
        value = float(np.mean([answer.right for answer in answers]))
        at_least = goal if network == "yolov5n" else None
        yield Row(f"{network}, {name}", value, at_least=at_least, cases=len(answers), peers=instead)


if __name__ == "__main__":
    OPTIONS = argparse.ArgumentParser(add_help=False)
    OPTIONS.add_argument("--first", type=int, default=HELD_OUT_SEEDS.start, help="seed of the first world and look")
    OPTIONS.add_argument("--only", type=lambda names: names.split(","), default=(), help="classes, with commas")
    sys.exit(main(measure, __doc__ or "", OPTIONS))
