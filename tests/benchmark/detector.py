"""The detection stage's speed against the bare network, the network's by size, and what the bundled one finds."""

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
from mcap_landmarks import resources
from mcap_landmarks.channels import CAMERA_IMAGE
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.runs.pipeline import run_stages
from mcap_landmarks.runs.plan import Request
from mcap_landmarks.vision.letterbox import Colours, fit, tensor
from mcap_landmarks.vision.onnx_session import open_session
from mcap_landmarks.vision.pixels import rgb_from_message
from numpy.typing import NDArray

from tests.benchmark import detections
from tests.benchmark.rows import Row, main
from tests.vision.networks import SIZES, Export, yolov5

NAMES = [f"class {i}" for i in range(80)]
INPUT_PX = (480, 640)
THESIS_CPU_MS = {"n": 45.0, "s": 98.0, "m": 224.0, "l": 430.0, "x": 766.0}
"""Milliseconds per image of 640 x 640 that the thesis gives for its CPU."""


def measure(quick: bool) -> Iterator[Row]:
    """Speed with untrained networks of every size, then what the bundled one finds."""
    with tempfile.TemporaryDirectory() as folder:
        yield from _throughput(Path(folder), rounds=3 if quick else 7)
        yield from _latency(Path(folder), rounds=3 if quick else 10)
    yield from detections.measure(quick)


def _throughput(folder: Path, rounds: int) -> Iterator[Row]:
    """Images per second: the demo's log read, detected and written, over `session.run` on the same tensors."""
    log, tensors = resources.resource("recordings", "demo_map.mcap"), []
    with open_recording(log) as recording:
        for raw in recording.messages(recording.connections(CAMERA_IMAGE.topic)):
            rgb = rgb_from_message(decode(CompressedImage, raw.data))
            tensors.append(tensor(rgb, fit(INPUT_PX, INPUT_PX), INPUT_PX, np.dtype(np.float32), Colours()))
    for name, threads in (("throughput", 0), ("throughput_1_thread", 1)):
        yield _against_bare(name, threads, (resources.detector(), log, folder / "out.mcap"), tensors, rounds)


def _against_bare(
    name: str, threads: int, files: tuple[Path, Path, Path], tensors: list[NDArray[Any]], rounds: int
) -> Row:
    """The stage against onnxruntime as it comes, both with so many threads (0: one per core)."""
    model, log, out = files
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    session = onnxruntime.InferenceSession(str(model), options, providers=["CPUExecutionProvider"])
    request = Request(log, {"detect": {"threads": threads}}, {"model": model}, results_only=True, force=True)

    def bare() -> None:
        for array in tensors:
            session.run(None, {"images": array})

    def stage() -> None:
        run_stages(request, out, ["detect"], "detect")

    alone, whole = _seconds(bare, stage, rounds)
    peers = {"stage images/s": len(tensors) / whole, "session.run images/s": len(tensors) / alone}
    return Row(name, alone / whole, "x", at_least=0.9, cases=len(tensors), peers=peers)


def _latency(folder: Path, rounds: int) -> Iterator[Row]:
    """Milliseconds per run of each size on 640 x 640, one thread and two, beside the thesis's."""
    image = np.random.default_rng(1).random((1, 3, 640, 640), dtype=np.float32)
    for size in SIZES:
        model = folder / f"{size}.onnx"
        yolov5(model, NAMES, size, Export(objectness_bias=-5.0))
        one, two = (partial(open_session(model, threads=threads).run, image) for threads in (1, 2))
        alone, both = _seconds(one, two, rounds)
        peers = {"2 threads": both * 1e3, "thesis's CPU": THESIS_CPU_MS[size]}
        yield Row(f"latency_{size}", alone * 1e3, "ms", cases=rounds, peers=peers)


def _seconds(first: Callable[[], object], second: Callable[[], object], rounds: int) -> tuple[float, float]:
    """Median times of two contestants that take turns, after one round to warm up."""
    taken: list[list[float]] = [[], []]
    for _ in range(rounds + 1):
        for times, run in zip(taken, (first, second), strict=True):
            began = time.perf_counter()
            run()
            times.append(time.perf_counter() - began)
    return float(np.median(taken[0][1:])), float(np.median(taken[1][1:]))


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or ""))
