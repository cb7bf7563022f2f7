"""What whole clouds cost: clustering against a slice of them, and raw log to scene objects against its length.

python -m tests.benchmark.clouds [--json] [--quick]
"""

import os
import resource
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from mcap_landmarks.lidar.clustering import cluster, shapes_of
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.scan_beams import beams_of
from mcap_landmarks.lidar.whole_clouds import points_in_base, whole_cloud
from mcap_landmarks.messages.codec import decode, encode
from mcap_landmarks.messages.points import PointCloud2

from docs import kitti
from tests.benchmark.rows import Row, main
from tests.benchmark.whole import seconds
from tests.real import roads
from tests.shared import data_folder

_POINTS = 120_000
_SLICE_M = (0.5, 1.2)
_WHOLE = roads.DEVELOPED_ON[:-1]
"""The frames that have whole clouds; 2155 is cut to its image."""
_ROUNDS, _REPEATED = 5, 24


def measure(quick: bool) -> Iterator[Row]:
    """The fastest of several rounds: whatever else a machine does only ever takes time."""
    data = data_folder()
    if data is None:
        raise SystemExit("no data at ../shared/data; set MCAP_LANDMARKS_DATA to where it lies")
    content = list(kitti.object_frames(data / "roads" / "kitti_object", _WHOLE))
    yield from _clustering(content, 2 if quick else _ROUNDS)
    yield from _real_time(content, data / "models" / "yolov5n-coco.onnx", 1 if quick else _ROUNDS)


def _clustering(content: Sequence[kitti.Frame], rounds: int) -> Iterator[Row]:
    """Clouds from their bytes to clusters, by the processor time of this thread alone."""
    clouds = [PointCloud2(1, "velodyne", frame.points_m.astype(np.float32)) for frame in content]
    raws, base_from_lidar = [bytes(encode(cloud)) for cloud in clouds], kitti.base_from_lidar()
    sliced = ClusterConfig(slice_m=_SLICE_M)
    shapes = shapes_of(sliced)
    spent = np.full((2, rounds, len(raws)), np.inf)
    for turn in range(rounds):
        for i, raw in enumerate(raws):
            began = time.thread_time()
            cloud = decode(PointCloud2, raw)
            whole_cloud(points_in_base(cloud, 1, base_from_lidar, None), base_from_lidar[:2, 3], ClusterConfig())
            spent[0, turn, i] = time.thread_time() - began
            began = time.thread_time()
            beams = beams_of(decode(PointCloud2, raw), 1, base_from_lidar, None, sliced)
            if beams is not None:
                cluster(beams, shapes, sliced)
            spent[1, turn, i] = time.thread_time() - began
    share = _POINTS / np.mean([len(cloud.points_m) for cloud in clouds])
    whole_ms, slice_ms = (1e3 * share * float(best.min(axis=0).mean()) for best in spent)
    yield Row("whole clouds of 120,000 points", whole_ms, "ms", cases=len(raws), peers={"slice": slice_ms})
    yield Row("whole clouds, times as fast as a slice of them", slice_ms / whole_ms, "", 5.0, cases=len(raws))


def _real_time(content: Sequence[kitti.Frame], model: Path, rounds: int) -> Iterator[Row]:
    """A camera and whole clouds at 10 Hz, each frame several times in a row, on two cores."""
    frames = [
        replace(content[i // _REPEATED], stamp_ns=(i + 1) * 10**8, pose=np.zeros(3))
        for i in range(len(content) * _REPEATED)
    ]
    lasts_s = len(frames) / 10
    with tempfile.TemporaryDirectory() as name, _two_cores():
        log, out = Path(name) / "log.mcap", Path(name) / "out.mcap"
        kitti.write_log(log, frames)
        words = [log, "-o", out, "--results-only", "--force", "--model", model, "--scan-from", kitti.CLOUD.topic]
        best: dict[str, tuple[float, float]] = {}
        for stages in ("detect", "cluster", "detect,cluster,fuse") * rounds:
            before = _worked_s()
            wall_s = seconds("run", *words, "--stages", stages)
            best[stages] = min(best.get(stages, (np.inf, np.inf)), (wall_s, _worked_s() - before))
    wall_s, worked_s = best.pop("detect,cluster,fuse")
    peers = {stages: alone_s / lasts_s for stages, (alone_s, _) in best.items()} | {
        "processor time": worked_s / lasts_s
    }
    name = "raw log of camera and clouds at 10 Hz to scene objects / its length"
    yield Row(name, wall_s / lasts_s, "x real time", at_most=1.0, cases=len(frames), peers=peers)


def _worked_s() -> float:
    """Processor time of all processes that this one started and that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@contextmanager
def _two_cores() -> Iterator[None]:
    """Processes that are started meanwhile have two cores, where there are more."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(before)[:2])
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


if __name__ == "__main__":
    sys.exit(main(measure, "What whole clouds cost."))
