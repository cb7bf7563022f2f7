"""A street of parked cars, every other frame mapped and the rest localized, through the command line; and judged."""

import contextlib
import csv
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap_landmarks.channels import POSE_COVARIANCE
from mcap_landmarks.cli.main import run
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.maps.database import read_map

from docs.kitti import CLOUD, write_log
from tests.real import roads
from tests.real.roads_judge import read

OFTEN, NEAR_M, THERE_M = 6, 0.35, 0.2
"""Cars that are seen so often count; landmarks and poses that are so near are right."""


@dataclass(frozen=True, slots=True, eq=False)
class Street:
    """What came of it: how far each parked car that is seen often is from the nearest confirmed landmark, and each
    landmark from the nearest labelled car, in m; of F frames that were to be localized the errors of those that were,
    in m, with these squared by their covariances (three degrees)."""

    cars_off_m: Array
    landmarks_off_m: Array
    frames: int
    poses_off_m: Array
    poses_nees: Array


def drive_street(data: Path, folder: Path, *options: str) -> Street:
    """Map the even frames in a folder, localize the odd ones; the map begins where the truth does."""
    source, model = data / "roads" / "kitti_tracking_0001", data / "models" / "yolov5n-coco.onnx"
    odd = roads.drive_frames(source, roads.DRIVE[1::2])
    write_log(folder / "even.mcap", roads.drive_frames(source, roads.DRIVE[::2]))
    write_log(folder / "odd.mcap", odd)
    words = ["--map", folder / "street.db", "--scan-from", CLOUD.topic, "--model", model, *options]
    _call("map", folder / "even.mcap", *words)
    _call("localize", folder / "odd.mcap", *words, "-o", folder / "out.mcap")
    landmarks = read_map(folder / "street.db")
    places = landmarks.positions_xy[~landmarks.tentative]
    with (source / "landmarks_tracks_DERIVED.csv").open() as stream:
        tracks = [(float(row["x_m"]), float(row["y_m"]), int(row["frames"])) for row in csv.DictReader(stream)]
    cars, often = np.array(tracks)[:, :2], np.array([frames >= OFTEN for *_, frames in tracks])
    away = np.hypot(*(places[:, None] - cars[None]).transpose(2, 0, 1))
    truth = {frame.stamp_ns: frame.pose for frame in odd}
    errors, nees = [], []
    for message in read(folder / "out.mcap", POSE_COVARIANCE):
        pose = truth[message.stamp_ns]
        assert pose is not None
        off = message.pose - pose
        off[2] = wrap(off[2])
        errors.append(float(np.hypot(*off[:2])))
        nees.append(float(off @ np.linalg.solve(message.planar_covariance, off)))
    return Street(away.min(axis=0)[often], away.min(axis=1), len(odd), np.array(errors), np.array(nees))


def _call(*words: object) -> None:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        try:
            run([str(word) for word in words])
        except SystemExit as done:
            if done.code:
                raise
