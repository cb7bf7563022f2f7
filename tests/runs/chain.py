"""A small log with images, scans and odometry, and what counts how often the detector looks."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_landmarks.channels import CAMERA_IMAGE, CAMERA_INFO, ODOMETRY, SCAN, TF_STATIC
from mcap_landmarks.messages.images import CameraInfo, CompressedImage
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Stamped
from mcap_landmarks.vision.onnx_session import NO_CONSTANTS, OnnxSession

from tests.vision.networks import answering

STEP_NS = 200_000_000
STEP_M = 0.02
COUNT = 8


def raw_log(path: Path, count: int = COUNT) -> Path:
    """A robot that creeps towards a person and a fire hydrant, `STEP_M` per image."""
    with create_recording(path) as writer:
        for stamped in raw_messages(count):
            writer.add(stamped)
    return path


def by_others(
    source: Path, target: Path, metadata: Sequence[tuple[str, dict[str, str]]] = (), *, chunk_bytes: int = 1 << 20
) -> Path:
    """A log as the mcap package writes it: all topics in the same chunks, with definitions and channels in these."""
    with source.open("rb") as stream, target.open("wb") as out:
        writer = Writer(out, chunk_size=chunk_bytes)
        writer.start("ros2", "other")
        ids: dict[str, int] = {}
        for schema, channel, message in make_reader(stream).iter_messages():
            if channel.topic not in ids and schema is not None:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                ids[channel.topic] = writer.register_channel(channel.topic, "cdr", schema_id, channel.metadata)
            writer.add_message(ids[channel.topic], message.log_time, message.data, message.publish_time)
        for name, entries in metadata:
            writer.add_metadata(name, entries)
        writer.finish()
    return target


def raw_messages(count: int = COUNT) -> list[Stamped]:
    """Its messages, by time."""
    camera = np.array([[60.0, 0, 32], [0, 60, 36], [0, 0, 1]])
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
            Stamped(ODOMETRY, now, Odometry.planar(now, frames, np.array([STEP_M * i, 0, 0]), np.zeros((3, 3)))),
            Stamped(CAMERA_IMAGE, now, CompressedImage(now, "camera", "jpeg", _picture(i))),
            Stamped(SCAN, now, _scan(now, STEP_M * i)),
        ]
    return found


def _picture(i: int) -> bytes:
    return bytes(cv2.imencode(".jpg", np.full((48, 64, 3), 20 * (i % 12), np.uint8))[1].tobytes())


def _scan(now: int, x_m: float) -> LaserScan:
    bearings = np.arange(180) * np.deg2rad(2)
    ranges = np.full(180, np.inf)
    for centre, radius_m in (((3.0, 0.0), 0.25), ((2.8, 1.03), 0.15)):
        along = (centre[0] - x_m) * np.cos(bearings) + centre[1] * np.sin(bearings)
        beside = (centre[0] - x_m) * np.sin(bearings) - centre[1] * np.cos(bearings)
        hit = (along > 0) & (np.abs(beside) < radius_m)
        ranges[hit] = along[hit] - np.sqrt(radius_m**2 - beside[hit] ** 2)
    step, none = np.deg2rad(2), np.zeros(0, np.float32)
    return LaserScan(now, "base_scan", 0.0, 179 * step, step, 0.0, 0.1, 0.1, 10.0, ranges.astype(np.float32), none)


def two_posts(path: Path) -> Path:
    """A detector that sees a person and a fire hydrant in every image."""
    output = np.zeros((1, 252, 7), np.float32)
    output[0, :2] = (32, 31, 10, 34, 0.9, 1, 0), (10, 40, 7, 16, 0.8, 0, 1)
    return answering(path, {"output0": output}, {"names": "['person', 'fire hydrant']", "stride": "32"})


def counted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """A list that grows by one with every run of a network."""
    looks: list[int] = []
    run = OnnxSession.run

    def counting(
        self: OnnxSession, array: np.ndarray, constants: Mapping[str, np.ndarray] = NO_CONSTANTS
    ) -> list[np.ndarray]:
        looks.append(1)
        return run(self, array, constants)

    monkeypatch.setattr(OnnxSession, "run", counting)
    return looks
