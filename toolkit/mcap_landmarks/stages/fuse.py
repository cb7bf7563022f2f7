"""Fuse detections in images with objects in scans to scene objects, which have a class and a place."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from mcap_landmarks.channels import (
    CAMERA_INFO,
    DETECTIONS,
    ODOMETRY,
    SCAN_OBJECTS,
    SCENE_MARKERS,
    SCENE_OBJECTS,
    TF_STATIC,
)
from mcap_landmarks.classes import CLASSES, Size
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.fusion.box_geometry import BoxError, View
from mcap_landmarks.fusion.class_belief import Weighing
from mcap_landmarks.fusion.fuser import Fuser, Rules
from mcap_landmarks.fusion.markers import markers_from_scene
from mcap_landmarks.fusion.thesis import fuse_in_order
from mcap_landmarks.geometry.camera import CameraModel
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.mounting import Mounting
from mcap_landmarks.stage import Bundle, Omission, Stage, Stamped

Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0)]

_UNEXPLAINED = "detections where the scan has no object that fits"
_UNWANTED = "detections of {}, which is no landmark by the settings"
_NO_BOX = "detections without a class or a box"
_UNUSABLE = "scan objects without a finite place"


@dataclass(frozen=True, slots=True)
class FuseConfig:
    """How detections and scan objects become scene objects.

    Only detections of `landmark_classes` count (all, if empty), and those of `ignore_classes` never. An object is in
    the scene if its most probable class has `min_probability`, and a scene has at least `min_objects`, else none.
    `sizes` add to the built-in ones, by class: what heights and widths of a box are plausible, and the radius at the
    LiDAR's height; a class without gets its radius from the width of its boxes. A box and an object belong together if
    the chi-squares of their bearing and of its height and width are below `bearing_gate` and `size_gate`. Boxes are
    sure to `edge_px` and `edge_share` of their size, bearings to `bearing_sigma_deg`, and an object's parts that the
    LiDAR meets lie within `lateral_m` of its middle. `prior_odds`, `hit_odds`, `confusion`, `miss_odds`, `max_odds` say
    how evidence adds up along a track: its odds of being of a class at first (`prior_odds_alone` without odometry,
    where every scan is on its own), the most that one detection multiplies them by, the share of that for every other
    class, what an image without it leaves of them if it would be `min_height_px` high there, and the most that they
    get. `rectified` images have no distortion and the projection matrix of CameraInfo. The thesis (Algorithm 3) sorts
    boxes about `image_centre_px`.
    """

    method: Literal["default", "thesis"] = "default"
    landmark_classes: tuple[str, ...] = ()
    ignore_classes: tuple[str, ...] = ()
    min_probability: Share = 0.5
    min_objects: Annotated[int, Field(ge=1)] = 2
    sizes: dict[str, Size] = field(default_factory=dict)
    bearing_gate: Positive = 7.0
    size_gate: Positive = 4.0
    edge_px: Positive = 2.0
    edge_share: Share = 0.04
    bearing_sigma_deg: Positive = 0.3
    lateral_m: Positive = 0.05
    prior_odds: Positive = 0.03
    prior_odds_alone: Positive = 0.3
    hit_odds: Positive = 200.0
    confusion: Share = 0.05
    miss_odds: Share = 0.2
    max_odds: Positive = 1e3
    min_height_px: Positive = 20.0
    rectified: bool = False
    image_centre_px: float = 320.5


def process(
    bundles: Iterable[Bundle], config: FuseConfig, resources: Mapping[str, Path]
) -> Iterator[Stamped | Omission]:
    """A scene of every scan, with markers; detections that come to nothing are omissions.

    Raises:
        RecordingError: no detections lie beside the scans, the camera is unknown, or transforms are missing.
    """
    fuser, mounting = Fuser(_rules(config)), Mounting(resources.get("extrinsics"))
    scans = images = 0
    for bundle in bundles:
        found = bundle.get(SCAN_OBJECTS)
        if found is None:
            continue
        objects, given, left_out = _usable(found), bundle.get(DETECTIONS), Counter[str]()
        scans, images = scans + 1, images + (given is not None)
        detections = None if given is None else _wanted(given, config, left_out)
        if config.method == "thesis":
            scene, unexplained = fuse_in_order(objects, detections, config.image_centre_px)
        else:
            view = None if detections is None else _view(bundle, detections, objects, mounting, config)
            odometry = None if bundle.odometry is None else bundle.odometry.odom_from_base
            scene, unexplained = fuser.add(objects, detections, view, odometry)
        if len(scene) < config.min_objects:
            scene = _nothing(scene)
        yield Stamped(SCENE_OBJECTS, bundle.log_time_ns, scene)
        yield Stamped(SCENE_MARKERS, bundle.log_time_ns, markers_from_scene(scene))
        left_out.update({_UNEXPLAINED: unexplained, _UNUSABLE: len(found) - len(objects)})
        yield from (Omission(bundle.log_time_ns, reason) for reason in left_out.elements())
    if scans and not images:
        raise RecordingError(
            f"no {DETECTIONS.topic} lie beside any of {scans} scans; run mcap-landmarks detect first, or read others "
            f"with --remap TOPIC={DETECTIONS.topic}"
        )


def _rules(config: FuseConfig) -> Rules:
    bearing_rad = float(np.deg2rad(config.bearing_sigma_deg))
    return Rules(
        sizes={**{name: known.size for name, known in CLASSES.items()}, **config.sizes},
        error=BoxError(config.edge_px, config.edge_share, bearing_rad, config.lateral_m),
        weighing=_weighing(config),
        bearing_gate=config.bearing_gate,
        size_gate=config.size_gate,
        least_probability=config.min_probability,
        least_height_px=config.min_height_px,
    )


def _weighing(config: FuseConfig) -> Weighing:
    return Weighing(
        prior=config.prior_odds,
        prior_alone=config.prior_odds_alone,
        gain=config.hit_odds,
        confusion=config.confusion,
        missed=config.miss_odds,
        most=config.max_odds,
    )


def _usable(objects: ScanObjects) -> ScanObjects:
    """The scan objects that are somewhere."""
    places = zip(objects.positions_xy, objects.covariances, strict=True)
    keep = [
        i for i, (xy, spread) in enumerate(places) if len(xy) and np.isfinite(xy).all() and np.isfinite(spread).all()
    ]
    return ScanObjects(
        objects.stamp_ns,
        objects.frame_id,
        tuple(objects.ids[i] for i in keep),
        tuple(objects.hypotheses[i] for i in keep),
        tuple(objects.positions_xy[i] for i in keep),
        tuple(objects.covariances[i] for i in keep),
        objects.extents_m[keep],
    )


def _wanted(detections: Detections, config: FuseConfig, left_out: Counter[str]) -> Detections:
    """The detections that are boxes of what may be a landmark; the others are counted as left out."""
    classes = [options[0][0] if options else "" for options in detections.hypotheses]
    boxes = detections.boxes_xyxy
    whole = np.flatnonzero(np.isfinite(boxes).all(axis=1) & (boxes[:, 2:] > boxes[:, :2]).all(axis=1)).tolist()
    keep = []
    for i, name in enumerate(classes):
        if not (name and i in whole):
            left_out[_NO_BOX] += 1
        elif name in config.ignore_classes or name not in (config.landmark_classes or classes):
            left_out[_UNWANTED.format(name)] += 1
        else:
            keep.append(i)
    return Detections(
        detections.stamp_ns,
        detections.frame_id,
        tuple(detections.ids[i] for i in keep),
        tuple(detections.hypotheses[i] for i in keep),
        boxes[keep].reshape(-1, 4),
    )


def _view(bundle: Bundle, detections: Detections, objects: ScanObjects, mounting: Mounting, config: FuseConfig) -> View:
    info = bundle.get(CAMERA_INFO)
    if info is None:
        raise RecordingError(
            f"there is no {CameraInfo.ROS_TYPE} for the camera of {DETECTIONS.topic}; record the camera's, or read "
            f"another topic as it with --remap TOPIC={CAMERA_INFO.topic}"
        )
    base_from_camera = mounting.lookup(bundle, objects.frame_id, info.frame_id or detections.frame_id)
    velocity = np.zeros(3) if bundle.odometry is None else bundle.odometry.velocity
    late_s = ((detections.stamp_ns or bundle.stamp_ns) - bundle.stamp_ns) / 1e9
    return View.at(_camera(info, config), base_from_camera, velocity, late_s)


def _camera(info: CameraInfo, config: FuseConfig) -> CameraModel:
    width, height = info.width_px or 2 * info.intrinsics[0, 2], info.height_px or 2 * info.intrinsics[1, 2]
    size = (int(width), int(height))
    if config.rectified:
        return CameraModel.of("", size, info.projection[:, :3], np.zeros(0))
    return CameraModel.of(info.distortion_model, size, info.intrinsics, info.distortion)


def _nothing(scene: SceneObjects) -> SceneObjects:
    return SceneObjects(scene.stamp_ns, scene.frame_id, (), (), np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0))


STAGE = Stage(
    "fuse",
    reads=(SCAN_OBJECTS, DETECTIONS, CAMERA_INFO, TF_STATIC, ODOMETRY),
    writes=(SCENE_OBJECTS, SCENE_MARKERS),
    config=FuseConfig,
    process=process,
    options=("extrinsics",),
    tolerance={
        "position_m": 1e-6,
        "others.position_m": 1e-6,
        "covariance": 1e-8,
        "others.covariance": 1e-8,
        "score": 1e-6,
        "others.score": 1e-6,
        "size_m": 2e-6,
    },
)
