"""A camera and a LiDAR among upright cylinders: scan objects and boxes as they should be, to spoil and to fuse."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mcap_landmarks.channels import CAMERA_INFO, DETECTIONS, SCAN_OBJECTS, SCENE_OBJECTS, TF_STATIC
from mcap_landmarks.fusion.camera_view import CameraView
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.tracks import TrackTable
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.camera import CameraModel
from mcap_landmarks.geometry.se2 import Array, exp, inverse, transform_points
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.stage import Bundle, OdometryAt, Omission
from mcap_landmarks.stages.fuse import process

SIZE_PX = (640, 480)
K = np.array([[530.5, 0.0, 320.0], [0.0, 530.5, 240.0], [0.0, 0.0, 1.0]])
FORWARDS = np.array([-0.5, 0.5, -0.5, 0.5])
KNOWN = {"fire hydrant": (0.15, 0.8), "person": (0.25, 1.75), "suitcase": (0.25, 0.7), "cone": (0.15, 0.7)}
"""Radius and height by class; the cone is of no class that the scan knows."""
SCANNED = ("fire hydrant", "person", "suitcase")


@dataclass(frozen=True, slots=True)
class Thing:
    """A cylinder on the ground, its centre at x, y in the base frame."""

    name: str
    x: float
    y: float

    @property
    def radius_m(self) -> float:
        return KNOWN.get(self.name, (0.2, 1.0))[0]

    @property
    def height_m(self) -> float:
        return KNOWN.get(self.name, (0.2, 1.0))[1]


THREE = (Thing("fire hydrant", 5.0, 1.0), Thing("person", 6.0, -0.2), Thing("suitcase", 4.0, -1.2))
NAMES = [thing.name for thing in THREE]
SECOND = 10**9


def mounted(camera_m: float = 0.2) -> TFMessage:
    """A camera on the robot, looking forwards."""
    return TFMessage((Transform(0, "base_footprint", "/camera", np.array([0.1, 0.0, camera_m]), FORWARDS),))


def information(name: str = "plumb_bob", distortion: Sequence[float] = ()) -> CameraInfo:
    """The camera's calibration."""
    whole = np.zeros(5)
    whole[: len(distortion)] = distortion
    return CameraInfo(1, "camera", SIZE_PX[1], SIZE_PX[0], name, whole, K, np.eye(3), np.column_stack([K, np.zeros(3)]))


def scanned(things: Sequence[Thing], stamp_ns: int, ids: Sequence[str] | None = None) -> ScanObjects:
    """Scan objects with a centre under every class that the scan knows, none more likely than the others."""
    positions, covariances, hypotheses = [], [], []
    for thing in things:
        centre = np.array([thing.x, thing.y])
        ahead = centre / np.hypot(*centre)
        surface = centre - thing.radius_m * ahead
        positions.append(np.array([*(surface + KNOWN[name][0] * ahead for name in SCANNED), surface]))
        covariances.append(np.tile(1e-4 * np.eye(2), (len(SCANNED) + 1, 1, 1)))
        hypotheses.append(tuple((name, 0.25) for name in (*SCANNED, "")))
    return ScanObjects(
        stamp_ns,
        "base_footprint",
        tuple(ids or (f"{i}" for i in range(len(things)))),
        tuple(hypotheses),
        tuple(positions),
        tuple(covariances),
        np.array([thing.radius_m for thing in things]),
    )


def camera_view(camera_m: float = 0.2, velocity: Sequence[float] = (0.0, 0.0, 0.0), late_s: float = 0.0) -> CameraView:
    """The camera, with an image taken so much later than the scan at a velocity of the base."""
    model, step = CameraModel.of("", SIZE_PX, K, np.zeros(0)), mounted(camera_m).transforms[0]
    base_from_camera = frames.rigid(step.translation_m, step.rotation_xyzw)
    return CameraView.at(model, base_from_camera, np.asarray(velocity, dtype=np.float64), late_s)


def boxes(things: Sequence[Thing], camera_m: float = 0.2, model: CameraModel | None = None) -> Array:
    """Boxes (N, 4) around cylinders, cut by the image's edges; not a number where nothing shows."""
    model = model or CameraModel.of("", SIZE_PX, K, np.zeros(0))
    step = mounted(camera_m).transforms[0]
    camera_from_base = frames.inverse(frames.rigid(step.translation_m, step.rotation_xyzw))
    turn = np.linspace(0, 2 * np.pi, 60)
    found = []
    for thing in things:
        rim = thing.radius_m * np.column_stack([np.cos(turn), np.sin(turn), 0 * turn]) + [thing.x, thing.y, 0.0]
        pixels = model.project(
            frames.apply(camera_from_base, np.concatenate([rim, rim + np.array([0, 0, thing.height_m])]))
        )
        low, high = np.clip(pixels.min(axis=0), 0, SIZE_PX), np.clip(pixels.max(axis=0), 0, SIZE_PX)
        found.append([*low, *high] if (high > low).all() else [np.nan] * 4)
    return np.array(found, dtype=np.float64).reshape(-1, 4)


def detected(names: Sequence[str], boxes_xyxy: Array, stamp_ns: int, score: float = 0.8) -> Detections:
    """Detections of the boxes that there are."""
    shown = np.flatnonzero(np.isfinite(boxes_xyxy).all(axis=1))
    hypotheses = tuple(((names[i], score),) for i in shown)
    return Detections(stamp_ns, "camera", ("",) * len(shown), hypotheses, boxes_xyxy[shown])


INFORMATION, MOUNTED = information(), mounted()


def bundle(
    objects: ScanObjects,
    detections: Detections | None = None,
    velocity: Sequence[float] = (0.0, 0.0, 0.0),
    info: CameraInfo | None = INFORMATION,
    transforms: TFMessage | None = MOUNTED,
) -> Bundle:
    """What belongs to a scan."""
    messages: dict[Any, Any] = {SCAN_OBJECTS: objects}
    found: Mapping[Any, Any] = {
        DETECTIONS: detections,
        CAMERA_INFO: info,
        TF_STATIC: transforms,
    }
    messages.update({channel: message for channel, message in found.items() if message is not None})
    odometry = OdometryAt("odom", np.zeros(3), np.zeros((3, 3)), 0.0, 0.0, np.asarray(velocity, dtype=np.float64))
    return Bundle(objects.stamp_ns, objects.stamp_ns, messages, odometry)


def moved(things: Sequence[Thing], velocity: Sequence[float], time_s: float) -> list[Thing]:
    """The things as the base has them after driving on for a time."""
    step = inverse(exp(np.asarray(velocity) * time_s))
    places = [transform_points(step, np.array([thing.x, thing.y])).tolist() for thing in things]
    return [Thing(thing.name, x, y) for thing, (x, y) in zip(things, places, strict=True)]


def tracked(objects: ScanObjects, config: FuseConfig | None = None) -> TrackTable:
    """Tracks of a first scan's objects, of which nothing is known yet."""
    table = TrackTable(config or FuseConfig())
    table.see(objects, alone=False)
    return table


def believe(table: TrackTable, track: str, name: str, share: float = 0.99) -> None:
    """Make a track believe that it is of a class."""
    table[track].belief.log_odds = {name: float(np.log(share / (1 - share)))}


def fused(
    bundles: Sequence[Bundle], config: FuseConfig | None = None, resources: Mapping[str, Any] | None = None
) -> tuple[list[SceneObjects], list[str]]:
    """The scenes of bundles, and the reasons of what was left out."""
    results = list(process(bundles, config or FuseConfig(), resources or {}))
    scenes = [entry.message for entry in results if not isinstance(entry, Omission) and entry.channel == SCENE_OBJECTS]
    return scenes, [entry.reason for entry in results if isinstance(entry, Omission)]


def plain(stamp_ns: int = SECOND, things: Sequence[Thing] = THREE) -> Bundle:
    """A scan of some things and the boxes around them, both as they should be."""
    return bundle(scanned(things, stamp_ns), detected([t.name for t in things], boxes(things), stamp_ns))


def check(scene: SceneObjects, things: Sequence[Thing]) -> None:
    """The scene holds these things where they stand, in their order."""
    assert scene.classes == tuple(thing.name for thing in things)
    np.testing.assert_allclose(scene.positions_xy, [[thing.x, thing.y] for thing in things], atol=1e-9)
