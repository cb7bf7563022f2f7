"""Fuse detections in images with objects in scans to scene objects, which have a class and a place."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mcap_landmarks.channels import (
    CAMERA_INFO,
    CLUSTERED_CLOUD,
    DETECTIONS,
    ODOMETRY,
    SCAN_OBJECTS,
    SCENE_MARKERS,
    SCENE_OBJECTS,
    SCENE_VELOCITIES,
    TF_STATIC,
)
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.fusion.camera_info import NO_INFO
from mcap_landmarks.fusion.camera_view import CameraView, SeenImage, camera_from_info
from mcap_landmarks.fusion.cloud_fuser import CloudFuser
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.fuser import Fuser
from mcap_landmarks.fusion.object_motions import ObjectMotions
from mcap_landmarks.fusion.scene_markers import markers_from_scene
from mcap_landmarks.fusion.selection import at_least, usable, wanted
from mcap_landmarks.fusion.thesis import fuse_in_order
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.lidar.object_tracks import PieceChange
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.mounting import Mounting
from mcap_landmarks.stage import Bundle, Omission, Stage, Stamped

_UNEXPLAINED = "detections where the scan has no object that fits"
_UNUSABLE = "scan objects without a finite place"


def process(
    bundles: Iterable[Bundle], config: FuseConfig, resources: Mapping[str, Location]
) -> Iterator[Stamped | Omission]:
    """A scene of every scan, with markers and velocities; detections that come to nothing are omissions.

    Raises:
        RecordingError: no detections lie beside the scans, the camera is unknown, or transforms are missing.
    """
    motions = ObjectMotions()
    fusers = _Fusers(config, Fuser(config), CloudFuser(config, motions))
    anew = PieceChange()
    scans, cameras = 0, _Cameras(config, Mounting(resources.get("extrinsics")))
    for bundle in bundles:
        found = bundle.get(SCAN_OBJECTS)
        if found is None:
            continue
        objects, scans = usable(found), scans + 1
        if anew.at(bundle.odometry.piece if bundle.odometry else None):
            motions.forget()
            fusers = replace(fusers, planar=Fuser(config))
        detections, left_out = list[Detections](), Counter[str]()
        for given in bundle.each(DETECTIONS):
            cameras.frames.add(plain(given.frame_id))
            kept, reasons = wanted(given, config)
            detections.append(kept)
            left_out += reasons
        scene, unexplained = _fused(bundle, objects, detections, fusers, cameras)
        scene, too_few = at_least(scene, config.min_objects)
        yield Stamped(SCENE_OBJECTS, bundle.log_time_ns, scene)
        yield Stamped(SCENE_MARKERS, bundle.log_time_ns, markers_from_scene(scene))
        velocities = motions.add(scene, bundle.odometry)
        if velocities is not None:
            yield Stamped(SCENE_VELOCITIES, bundle.log_time_ns, velocities)
        left_out.update(too_few)
        left_out.update({_UNEXPLAINED: unexplained, _UNUSABLE: len(found) - len(objects)})
        yield from (Omission(bundle.log_time_ns, reason) for reason in left_out.elements())
    if scans and not cameras.frames:
        raise RecordingError(
            f"no {DETECTIONS.topic} lie beside any of {scans} scans; run mcap-landmarks detect first, or read others "
            f"with --remap TOPIC={DETECTIONS.topic}"
        )


@dataclass(frozen=True, slots=True)
class _Fusers:
    """The ways to fuse, by what the scans are."""

    config: FuseConfig
    planar: Fuser
    clouds: CloudFuser


@dataclass(frozen=True, slots=True)
class _Cameras:
    """The cameras on the robot; `frames` are those that there were detections of so far."""

    config: FuseConfig
    mounting: Mounting
    frames: set[str] = field(default_factory=set)

    def seen(self, bundle: Bundle, detections: Detections, base: str) -> SeenImage:
        """Detections with the view of their camera."""
        info = self._info(bundle, detections.frame_id)
        base_from_camera = self.mounting.lookup(bundle, base, info.frame_id or detections.frame_id)
        velocity = np.zeros(3) if bundle.odometry is None else bundle.odometry.velocity
        late_s = ((detections.stamp_ns or bundle.stamp_ns) - bundle.stamp_ns) / 1e9
        camera = camera_from_info(info, rectified=self.config.rectified)
        return SeenImage(detections, CameraView.at(camera, base_from_camera, velocity, late_s))

    def _info(self, bundle: Bundle, frame_id: str) -> CameraInfo:
        """The CameraInfo of a frame; one camera's may be of another than its images."""
        infos = bundle.each(CAMERA_INFO)
        if not infos:
            raise RecordingError(NO_INFO)
        own = [info for info in infos if plain(info.frame_id) == plain(frame_id)]
        if not own and (len(infos) > 1 or len(self.frames) > 1):
            frames = " and ".join(info.frame_id for info in infos)
            raise RecordingError(
                f"no {CameraInfo.ROS_TYPE} is of the frame {frame_id!r}, which boxes on {DETECTIONS.topic} are of, but "
                f"of {frames}; record that camera's, or choose others with --image TOPIC"
            )
        return (own or infos)[0]


def _fused(
    bundle: Bundle, objects: ScanObjects, detections: Sequence[Detections], fusers: _Fusers, cameras: _Cameras
) -> tuple[SceneObjects, int]:
    """The scene of a bundle, and the number of its boxes that come to nothing."""
    config, cloud = fusers.config, bundle.get(CLUSTERED_CLOUD)
    if config.method == "thesis":
        if len(cameras.frames) > 1:
            raise UsageError("the thesis's method has one camera; choose it with --image TOPIC")
        return fuse_in_order(objects, next(iter(detections), None), config.image_centre_px)
    images = [cameras.seen(bundle, one, objects.frame_id) for one in detections]
    odometry = None if bundle.odometry is None else bundle.odometry.odom_from_base
    if cloud is not None and cloud.stamp_ns == objects.stamp_ns:
        return fusers.clouds.add(cloud, images, odometry)
    return fusers.planar.add(objects, images, odometry)


STAGE = Stage(
    "fuse",
    reads=(SCAN_OBJECTS, CLUSTERED_CLOUD, DETECTIONS, CAMERA_INFO, TF_STATIC, ODOMETRY),
    writes=(SCENE_OBJECTS, SCENE_MARKERS, SCENE_VELOCITIES),
    config=FuseConfig,
    process=process,
    optional=(CLUSTERED_CLOUD,),
    options=("extrinsics",),
    tolerance={
        "position_m": 1e-6,
        "others.position_m": 1e-6,
        "covariance": 1e-8,
        "others.covariance": 1e-8,
        "score": 1e-6,
        "others.score": 1e-6,
        "size_m": 2e-6,
        "velocities.twist.linear": 1e-4,  # places that are a micrometre apart, over a tenth of a second
        "velocities.covariance": 1e-5,
        "moving": 1e-3,
    },
)
