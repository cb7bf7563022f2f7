"""Whether exports of Ultralytics are recognised: networks of random weights, in an environment that has the package.

python -m tests.benchmark.exporters
"""

import importlib
import os
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from mcap_landmarks.errors import ModelError, UsageError
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.detector import read_detector
from mcap_landmarks.vision.onnx_session import open_session

from tests.benchmark.rows import Row, main

PLAIN: Mapping[str, object] = {}
EXPORTS: tuple[tuple[str, Mapping[str, object], str], ...] = (
    *((name, PLAIN, "yolov8") for name in ("yolov5n", "yolov8n", "yolo11n", "yolo12n")),
    ("yolov8n", {"dynamic": True}, "yolov8"),
    ("yolov8n", {"half": True}, "yolov8"),
    # Without NMS means with their own end, which needs none.
    *((name, {"nms": False}, "nms_in_graph") for name in ("yolov10n", "yolo26n")),
    ("yolo26n", {"nms": False, "dynamic": True}, "nms_in_graph"),
    ("rtdetr-l", PLAIN, "detr"),
    ("rtdetr-l", {"dynamic": True}, "detr"),
)
"""A network, how it is exported, and the family that it must be of."""


def measure(quick: bool) -> Iterator[Row]:
    """One row per export; `quick` leaves out the large networks."""
    ultralytics = importlib.import_module("ultralytics")
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # where the exporter writes
        for name, options, family in EXPORTS:
            if not (quick and name.startswith("rtdetr")):
                model = (ultralytics.RTDETR if name.startswith("rtdetr") else ultralytics.YOLO)(f"{name}.yaml")
                path = Path(model.export(format="onnx", simplify=False, verbose=False, **options))
                words = " ".join(f"{key}={value}" for key, value in options.items())
                yield Row(f"{name} {words}".strip(), float(_family(path) == family), at_least=1.0)
        os.chdir(before)


def _family(path: Path) -> str:
    try:
        return read_detector(open_session(path, threads=1), None, DetectConfig()).family.name
    except (ModelError, UsageError) as error:
        return str(error)


if __name__ == "__main__":
    sys.exit(main(measure, "Whether exports of Ultralytics are recognised."))
