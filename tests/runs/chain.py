"""A small log with images, scans and odometry, and what counts how often the detector looks."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.vision.networks import answering
from toolkit.channels import CAMERA_IMAGE, CAMERA_INFO, ODOMETRY, SCAN, TF_STATIC
from toolkit.messages.images import CameraInfo, CompressedImage
from toolkit.messages.poses import Odometry
from toolkit.messages.scan import LaserScan
from toolkit.messages.transforms import TFMessage, Transform
from toolkit.recording.writer import create_recording
from toolkit.stage import Stamped
from toolkit.vision.session import Session

STEP_NS = 200_000_000
COUNT = 8


def raw_log(path: Path, count: int = COUNT) -> Path:
    """A robot that drives past two posts, 0.1 m per image."""
    with create_recording(path) as writer:
        for stamped in raw_messages(count):
            writer.add(stamped)
    return path


def raw_messages(count: int = COUNT) -> list[Stamped]:
    """Its messages, by time."""
    camera = np.array([[60.0, 0, 32], [0, 60, 24], [0, 0, 1]])
    info = CameraInfo(1, "camera", 48, 64, "plumb_bob", np.zeros(5), camera, np.eye(3), np.eye(3, 4))
    optical = np.array([-0.5, 0.5, -0.5, 0.5])
    transforms = (
        Transform.planar(1, ("base_footprint", "base_scan"), (0, 0, 0)),
        Transform(1, "base_footprint", "camera", np.array([0.0, 0.0, 0.2]), optical),
    )
    found = [Stamped(TF_STATIC, 1, TFMessage(transforms)), Stamped(CAMERA_INFO, 1, info)]
    for i in range(count):
        now = (i + 1) * STEP_NS
        frames = ("odom", "base_footprint")
        found += [
            Stamped(ODOMETRY, now, Odometry.planar(now, frames, np.array([0.1 * i, 0, 0]), np.zeros((3, 3)))),
            Stamped(CAMERA_IMAGE, now, CompressedImage(now, "camera", "jpeg", _picture(i))),
            Stamped(SCAN, now, _scan(now)),
        ]
    return found


def _picture(i: int) -> bytes:
    return bytes(cv2.imencode(".jpg", np.full((48, 64, 3), 20 * (i % 12), np.uint8))[1].tobytes())


def _scan(now: int) -> LaserScan:
    ranges = np.full(90, np.inf, np.float32)
    ranges[[0, 1, 89]], ranges[[6, 7]] = 2.0, 3.0
    step = 2 * np.pi / 90
    return LaserScan(now, "base_scan", 0.0, 89 * step, step, 0.0, 0.1, 0.1, 10.0, ranges, np.zeros(0, np.float32))


def two_posts(path: Path) -> Path:
    """A detector that sees a person and a fire hydrant in every image."""
    output = np.zeros((1, 252, 7), np.float32)
    output[0, :2] = (32, 32, 12, 40, 0.9, 1, 0), (10, 32, 8, 20, 0.8, 0, 1)
    return answering(path, {"output0": output}, {"names": "['person', 'fire hydrant']", "stride": "32"})


def counted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """A list that grows by one with every run of a network."""
    looks: list[int] = []
    run = Session.run

    def counting(self: Session, array: np.ndarray) -> list[np.ndarray]:
        looks.append(1)
        return run(self, array)

    monkeypatch.setattr(Session, "run", counting)
    return looks
