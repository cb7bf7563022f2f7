"""The fusion of images and clouds: the objects of every scan, each with the class that its track has earned."""

from dataclasses import replace

import numpy as np

from mcap_landmarks.fusion.box_geometry import box_geometry
from mcap_landmarks.fusion.camera_view import CameraView
from mcap_landmarks.fusion.cloud_objects import FoundObject, Look, find, place_by_camera, place_of
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.frustum import CloudView
from mcap_landmarks.fusion.object_motions import ObjectMotions
from mcap_landmarks.fusion.seen_things import Seen, seen_things
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.rectangles import Rectangle
from mcap_landmarks.messages.boxes import Boxes
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.hypotheses import Hypotheses
from mcap_landmarks.messages.scene import SceneObjects

_LEAST_TOLD = 0.005


class CloudFuser:
    """Fuses cloud after cloud. Its state is what each track has been taken for; `motions` tell where they are."""

    def __init__(self, config: FuseConfig, motions: ObjectMotions) -> None:
        self._config, self._motions = config, motions
        self._classes: dict[str, dict[str, float]] = {}

    def add(
        self, cloud: ClusteredCloud, detections: Detections | None, view: CameraView | None, odometry: Array | None
    ) -> tuple[SceneObjects, int]:
        """The scene of a cloud and the image beside it; also the number of boxes that are in no object of it.

        `odometry` is odom_from_base (3,); without it every object is a new one.
        """
        if detections is None or view is None:
            return _scene(cloud, (), [], [], np.zeros((0, 2))), 0
        things = seen_things(detections)
        boxes = box_geometry(view, np.array([thing.box_xyxy for thing in things]).reshape(-1, 4), self._config)
        look = Look(view, CloudView.of(cloud, view), boxes, self._config)
        found = [one for one in find(look, things) if one.score >= self._config.min_probability]
        found = _distinct(found)
        centres = np.array([one.place.centre_xy for one in found]).reshape(-1, 2)
        spreads = np.array([one.place.covariance for one in found]).reshape(-1, 2, 2)
        seen_as = [things[one.box].name for one in found]
        names = self._motions.names(cloud.stamp_ns, odometry, (centres, spreads), seen_as)
        classes = [self._learn(name, things[one.box], one.score) for name, one in zip(names, found, strict=True)]
        placed = [_as(look, one, things[one.box], options[0][0]) for one, options in zip(found, classes, strict=True)]
        explained = sum(things[one.box].boxes for one in found)
        upright = np.array([look.upright(one, options[0][0]) for one, options in zip(placed, classes, strict=True)])
        scene = _scene(cloud, names, classes, [one.place for one in placed], upright.reshape(-1, 2))
        return scene, len(detections) - explained

    def _learn(self, name: str, thing: Seen, score: float) -> Hypotheses:
        """The classes of a track with their probabilities, now that a box of it was seen."""
        told = self._classes.setdefault(name, {})
        for known, share in thing.classes:
            told[known] = told.get(known, 0.0) + share * thing.score
        whole = sum(told.values())
        options = sorted(((known, score * weight / whole) for known, weight in told.items()), key=lambda one: -one[1])
        return tuple((known, share) for known, share in options if share >= _LEAST_TOLD)


def _as(look: Look, found: FoundObject, thing: Seen, name: str) -> FoundObject:
    """An object as one of the class of its track."""
    if name == thing.name:
        return found
    if len(found.points):
        return replace(found, place=place_of(look, found.box, name, found.points))
    return replace(found, place=place_by_camera(look, found.box, name) or found.place)


def _distinct(found: list[FoundObject]) -> list[FoundObject]:
    """Objects without those that stand in another, surer one."""
    kept: list[FoundObject] = []
    for one in sorted(found, key=lambda entry: (len(entry.points) == 0, -entry.score)):
        if not any(_is_in(one.place, other.place) or _is_in(other.place, one.place) for other in kept):
            kept.append(one)
    return sorted(kept, key=lambda entry: entry.box)


def _is_in(one: Rectangle, other: Rectangle) -> bool:
    """Whether the middle of one is in the other."""
    return bool(other.holds(one.centre_xy[None], 0.0)[0])


def _scene(
    cloud: ClusteredCloud, names: tuple[str, ...], classes: list[Hypotheses], places: list[Rectangle], upright_m: Array
) -> SceneObjects:
    """Objects as a message; upright_m (N, 2) are the heights of their feet in the base frame, and their own."""
    centres = np.array([place.centre_xy for place in places]).reshape(-1, 2)
    sizes = np.array([[place.length_m, place.width_m] for place in places]).reshape(-1, 2)
    return SceneObjects(
        cloud.stamp_ns,
        cloud.frame_id,
        names,
        tuple(classes),
        centres,
        np.array([place.covariance for place in places]).reshape(-1, 2, 2),
        sizes[:, 0] / 2,
        Boxes(
            np.column_stack([centres, upright_m[:, 0] + upright_m[:, 1] / 2]),
            np.column_stack([sizes, upright_m[:, 1]]),
            np.array([place.yaw_rad for place in places], dtype=np.float64),
        ),
    )
