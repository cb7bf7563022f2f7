"""Whether an image without a box of an object speaks against it: only where it would show the object."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from mcap_landmarks.fusion.box_geometry import BoxGeometry
from mcap_landmarks.fusion.camera_view import CameraView
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.tracks import TrackTable
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.scan_objects import ScanObjects

_SMALLER = 0.8
"""What a box holds is at least as far away as its class's least height has it, but for such a share: boxes err."""
_TALL, _LEAST_M = 1e-3, 0.1
"""Divided by: no box is less tall, as height over distance, and no object nearer to the camera."""


def nearness_of(
    objects: ScanObjects,
    pairs: Iterable[tuple[int, int]],
    view: CameraView,
    boxes: BoxGeometry,
    names: Sequence[str],
    config: FuseConfig,
) -> Array:
    """How far from the camera what is in the boxes (M,) is; at least, where that goes by height only."""
    tall = np.array([config.size(name).least_tall_m for name in names])
    nearness: Array = _SMALLER * tall / np.maximum(boxes.top - boxes.bottom, _TALL)
    for box, i in pairs:
        nearness[box] = np.hypot(*view.from_camera(objects.positions_xy[i][-1:])[0])
    return nearness


def is_missed(
    objects: ScanObjects, i: int, tracks: TrackTable, view: CameraView, boxes: BoxGeometry, nearness: Array
) -> bool:
    """Whether the image would show an object, large enough, and has no box that it could be in or behind."""
    class_name, _ = tracks[objects.ids[i]].belief.best()
    size = tracks.config.size(class_name)
    middle_m = (size.foot_m[0] + size.top_m[0]) / 2
    point, _ = tracks.centre(objects, i, class_name)
    place = view.from_camera(point[None])[0]
    distance, half_width = float(np.hypot(*place)), size.width_m[0] / 2
    height_px = size.least_tall_m / max(distance, _LEAST_M) * view.camera.intrinsics[1, 1]
    if height_px < tracks.config.min_height_px or not view.shows(point, half_width, middle_m):
        return False
    return not boxes.covers(math.atan2(place[1], place[0]), half_width / distance, nearness < distance)
