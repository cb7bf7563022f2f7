"""The fusion of images and clouds: the objects of every scan, each with the class that its track has earned."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mcap_landmarks.fusion.camera_view import SeenImage
from mcap_landmarks.fusion.cloud_objects import FoundObject, place_by_camera, place_of
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.object_motions import ObjectMotions
from mcap_landmarks.fusion.scene_building import LEAST_TOLD
from mcap_landmarks.fusion.several_views import ViewedObject, distinct, objects_in
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.rectangles import Rectangle
from mcap_landmarks.messages.boxes import Boxes
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.hypotheses import Hypotheses
from mcap_landmarks.messages.scene import SceneObjects


class CloudFuser:
    """Fuses cloud after cloud. Its state is what each track has been taken for; `motions` tell where they are."""

    def __init__(self, config: FuseConfig, motions: ObjectMotions) -> None:
        self._config, self._motions = config, motions
        self._classes: dict[str, dict[str, float]] = {}

    def add(
        self, cloud: ClusteredCloud, images: Sequence[SeenImage], odometry: Array | None
    ) -> tuple[SceneObjects, int]:
        """The scene of a cloud and the images beside it; also the number of boxes that are in no object of it.

        There is one image of each camera at most. `odometry` is odom_from_base (3,); without it every object is a new
        one.
        """
        if not images:
            return _scene(cloud, (), [], [], np.zeros((0, 2)), np.zeros(0)), 0
        objects = distinct([objects_in(cloud, image, self._config) for image in images])
        seen_as = [views[0].thing.name for views in objects]
        seen = _seen([views[0].found.place for views in objects])
        names = self._motions.names(cloud.stamp_ns, odometry, seen, seen_as)
        classes = [self._learn(name, views) for name, views in zip(names, objects, strict=True)]
        best = [options[0][0] for options in classes]
        places, upright_m = _placed([views[0] for views in objects], best)
        surprises = self._motions.surprises(cloud.stamp_ns, odometry, _seen(places), names)
        scene = _scene(cloud, names, classes, places, upright_m, surprises)
        explained = sum(one.thing.boxes for views in objects for one in views)
        return scene, sum(len(image.detections) for image in images) - explained

    def _learn(self, name: str, views: Sequence[ViewedObject]) -> Hypotheses:
        """The classes of a track with their probabilities, now that boxes of it were seen."""
        told, score = self._classes.setdefault(name, {}), max(one.found.score for one in views)
        for one in views:
            for known, share in one.thing.classes:
                told[known] = told.get(known, 0.0) + share * one.thing.score
        whole = sum(told.values())
        options = sorted(((known, score * weight / whole) for known, weight in told.items()), key=lambda one: -one[1])
        return tuple((known, share) for known, share in options if share >= LEAST_TOLD)


def _placed(objects: Sequence[ViewedObject], names: Sequence[str]) -> tuple[list[Rectangle], Array]:
    """Where objects are, each as one of the class of its track, and the heights (N, 2) of their feet and their own."""
    found = [_as(seen, name) for seen, name in zip(objects, names, strict=True)]
    upright = [seen.look.upright(one, name) for seen, one, name in zip(objects, found, names, strict=True)]
    return [one.place for one in found], np.array(upright).reshape(-1, 2)


def _as(seen: ViewedObject, name: str) -> FoundObject:
    """An object as one of the class of its track."""
    look, thing, found = seen
    if name == thing.name:
        return found
    if len(found.points):
        return replace(found, place=place_of(look, found.box, name, found.points))
    return replace(found, place=place_by_camera(look, found.box, name) or found.place)


def _seen(places: Sequence[Rectangle]) -> tuple[Array, Array]:
    """Centres (N, 2) and covariances (N, 2, 2)."""
    centres = np.array([place.centre_xy for place in places]).reshape(-1, 2)
    return centres, np.array([place.covariance for place in places]).reshape(-1, 2, 2)


def _scene(
    cloud: ClusteredCloud,
    names: tuple[str, ...],
    classes: list[Hypotheses],
    places: list[Rectangle],
    upright_m: Array,
    unsure: Array,
) -> SceneObjects:
    """Objects as a message.

    upright_m (N, 2) are the heights of their feet in the base frame, and their own; covariances are `unsure` (N,) times
    what was fitted.
    """
    centres, covariances = _seen(places)
    sizes = np.array([[place.length_m, place.width_m] for place in places]).reshape(-1, 2)
    return SceneObjects(
        cloud.stamp_ns,
        cloud.frame_id,
        names,
        tuple(classes),
        centres,
        unsure[:, None, None] * covariances,
        sizes[:, 0] / 2,
        Boxes(
            np.column_stack([centres, upright_m[:, 0] + upright_m[:, 1] / 2]),
            np.column_stack([sizes, upright_m[:, 1]]),
            np.array([place.yaw_rad for place in places], dtype=np.float64),
        ),
    )
