"""A drive along a street of parked cars, among others that drive and people who walk: what its sensors record."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from mcap_landmarks.channels import CAMERA_INFO, DETECTIONS, ODOMETRY, TF_STATIC
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Channel, Stamped

from tests.fusion.test_cloud_fuser import BASE_FROM_CAMERA, CAMERA, SIZE_PX, box_of
from tests.lidar.clouds import LIDAR_M, Solid, cloud, rays

CLOUD = Channel("/points", PointCloud2)
PERIOD_S, SPEED_MPS = 0.1, 8.0
BEAMS = rays(np.arange(-60.0, 60.0, 0.35), np.arange(-25.0, 3.0, 0.6))
LEAST_POINTS, LEAST_PX = 12, 15
SIGMA_PX, LOST = 1.5, 0.1
"""How far the edges of boxes are off, and how many are lost."""


@dataclass(frozen=True, slots=True)
class Actor:
    """Something of a class: where it is in the world at first, and its velocity in m/s."""

    name: str
    solid: Solid
    velocity_mps: tuple[float, float] = (0.0, 0.0)

    def at(self, time_s: float) -> Solid:
        """Where it is after a while."""
        vx, vy = self.velocity_mps
        return replace(self.solid, x=self.solid.x + vx * time_s, y=self.solid.y + vy * time_s)


PARKED = tuple(
    Actor("car", Solid(x, y, 4.2, 1.75, 1.5, yaw))
    for x, y, yaw in ((12, -4, 0.0), (19, -4.1, 0.03), (33, -4, 0.0), (22, 5, 0.0), (40, 5.2, -0.04), (47, 5, 0.0))
)
DRIVING = (
    Actor("car", Solid(18.0, 0.0, 4.4, 1.8, 1.5), (8.0, 0.0)),
    Actor("truck", Solid(75.0, 2.6, 7.5, 2.4, 2.9), (-11.0, 0.0)),
    Actor("person", Solid(20.0, -6.5, 0.45, 0.45, 1.75), (1.4, 0.0)),
)
HOUSE = Solid(40.0, 14.0, 90.0, 6.0, 7.0)


def base_at(time_s: float) -> Array:
    """Where the base is after a while, (3,): straight ahead."""
    return np.array([SPEED_MPS * time_s, 0.0, 0.0])


def write_street(path: Path, actors: tuple[Actor, ...], seconds: float, seed: int = 3) -> None:
    """The recording of a drive: odometry, clouds at 10 Hz, boxes of all that is seen, calibration and mounting."""
    with create_recording(path) as writer:
        for stamped in _recorded(actors, seconds, np.random.default_rng(seed)):
            writer.add(stamped)


def _recorded(actors: tuple[Actor, ...], seconds: float, rng: np.random.Generator) -> Iterator[Stamped]:
    upright, forwards = np.array([0.0, 0.0, 0.0, 1.0]), np.array([-0.5, 0.5, -0.5, 0.5])
    lidar = Transform(10**9, "base_link", "lidar", np.array([0.0, 0.0, LIDAR_M]), upright)
    camera = Transform(10**9, "base_link", "camera", BASE_FROM_CAMERA[:3, 3], forwards)
    yield Stamped(TF_STATIC, 10**9, TFMessage((lidar, camera)))
    for frame in range(round(seconds / PERIOD_S)):
        time_s, stamp_ns = frame * PERIOD_S, 10**9 + frame * int(PERIOD_S * 1e9)
        base = base_at(time_s)
        solids = [actor.at(time_s) for actor in actors] + [HOUSE]
        solids = [replace(solid, x=solid.x - base[0], y=solid.y - base[1]) for solid in solids]
        points, owner = cloud(solids, BEAMS, seed=frame)
        yield Stamped(ODOMETRY, stamp_ns, Odometry.planar(stamp_ns, ("odom", "base_link"), base, np.zeros((3, 3))))
        yield Stamped(CAMERA_INFO, stamp_ns, _calibration(stamp_ns))
        seen = [i for i in range(len(actors)) if np.count_nonzero(owner == i) >= LEAST_POINTS]
        told = [(actors[i].name, box_of(solids[i])) for i in seen]
        yield Stamped(DETECTIONS, stamp_ns, _detected(told, stamp_ns, rng))
        lifted = (points - [0.0, 0.0, LIDAR_M]).astype(np.float32)
        yield Stamped(CLOUD, stamp_ns, PointCloud2(stamp_ns, "lidar", lifted))


def _calibration(stamp_ns: int) -> CameraInfo:
    projection = np.column_stack([CAMERA.intrinsics, np.zeros(3)])
    width, height = SIZE_PX
    return CameraInfo(stamp_ns, "camera", height, width, "", np.zeros(0), CAMERA.intrinsics, np.eye(3), projection)


def _detected(told: list[tuple[str, Array]], stamp_ns: int, rng: np.random.Generator) -> Detections:
    """Boxes as a network gives them: some are lost, and none fits to the pixel."""
    kept = [(name, box) for name, box in told if (box[2:] - box[:2]).min() >= LEAST_PX and rng.random() > LOST]
    boxes = np.array([box + rng.normal(0.0, SIGMA_PX, 4) for _, box in kept]).reshape(-1, 4)
    names = tuple(((name, 0.7),) for name, _ in kept)
    return Detections(stamp_ns, "camera", ("",) * len(kept), names, boxes)
