"""What became of the boxes of an image beside a cloud: which object each is, and why some are none."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from mcap_landmarks.fusion.camera_view import CameraView
from mcap_landmarks.fusion.cloud_objects import FEWEST, MARGIN_M
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.frustum import CloudView, core
from mcap_landmarks.fusion.seen_things import Seen, intersection_over_union, seen_things
from mcap_landmarks.fusion.selection import wanted
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.rectangles import Rectangle
from mcap_landmarks.messages.boxes import Boxes
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.scene import SceneObjects

_STEPS = 16
"""Points along an edge of a cuboid: what of it is behind the camera is not drawn, to a sixteenth of its length."""
_LEAST_IOU = 0.1
"""A box and the outline of its object overlap at least so much: of what is hidden, a box shows a part only."""
_SIDES = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_EDGES = [(i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit]


@dataclass(frozen=True, slots=True, eq=False)
class LostBox:
    """A box that is no object: what the detector said, the box (4,) in pixels of a camera's image, and why, in words.

    The camera is told by its frame.
    """

    name: str
    score: float
    box_xyxy: Array
    camera: str
    reason: str


def corners_of(boxes: Boxes, i: int) -> Array:
    """The corners (8, 3) of a box."""
    c, s = np.cos(boxes.yaws_rad[i]), np.sin(boxes.yaws_rad[i])
    turned: Array = (_SIDES * boxes.sizes_m[i]) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    corners: Array = turned + boxes.centres_m[i]
    return corners


def edges_in_image(view: CameraView, boxes: Boxes, i: int) -> Array:
    """The edges of a box as lines of pixels (12, steps, 2), not a number where they are behind the camera."""
    corners, share = corners_of(boxes, i), np.linspace(0.0, 1.0, _STEPS)[:, None]
    lines = np.stack([corners[a] + share * (corners[b] - corners[a]) for a, b in _EDGES])
    level = view.from_camera(lines[..., :2].reshape(-1, 2)) + view.base_from_camera[:2, 3]
    then = np.column_stack([level, lines[..., 2].reshape(-1)])
    pixels = view.camera.project(frames.apply(frames.inverse(view.base_from_camera), then))
    return pixels.reshape(len(_EDGES), _STEPS, 2)


def lost_boxes(
    detections: Detections, scene: SceneObjects, cloud: ClusteredCloud, view: CameraView, config: FuseConfig
) -> tuple[LostBox, ...]:
    """The boxes of one camera that are in no object of a scene; several boxes of one thing are told once.

    Which box an object was made of is not in a log: it is the one that its outline in the image overlaps most, of a
    class that it could have.
    """
    kept, _ = wanted(detections, config)
    things = seen_things(kept)
    lost = [things[i] for i in _without_object(things, scene, view)]
    seen = CloudView.of(cloud, view)
    camera = detections.frame_id
    told = [LostBox(one.name, one.score, one.box_xyxy, camera, _reason(one, seen, scene, config)) for one in lost]
    return (*told, *_unwanted(detections, kept))


def _unwanted(detections: Detections, kept: Detections) -> list[LostBox]:
    """Boxes that the settings leave out."""
    return [
        LostBox(*options[0], box, detections.frame_id, "it is no landmark by the settings")
        for options, box in zip(detections.hypotheses, detections.boxes_xyxy, strict=True)
        if options and np.isfinite(box).all() and not (kept.boxes_xyxy == box).all(axis=1).any()
    ]


def _without_object(things: Sequence[Seen], scene: SceneObjects, view: CameraView) -> list[int]:
    shared = np.zeros((len(things), len(scene)))
    for j, options in enumerate(scene.hypotheses):
        outline, names = _outline(scene, j, view), {name for name, _ in options}
        for i, thing in enumerate(things):
            if outline is not None and names & {name for name, _ in thing.classes}:
                shared[i, j] = intersection_over_union(thing.box_xyxy, outline)
    rows, columns = linear_sum_assignment(-shared)
    matched = {int(i) for i, j in zip(rows, columns, strict=True) if shared[i, j] >= _LEAST_IOU}
    return [i for i in range(len(things)) if i not in matched]


def _outline(scene: SceneObjects, i: int, view: CameraView) -> Array | None:
    """The box (4,) around an object in the image, None if it is not in it."""
    if scene.boxes is None:
        return None
    pixels = edges_in_image(view, scene.boxes, i).reshape(-1, 2)
    pixels = np.clip(pixels[np.isfinite(pixels).all(axis=1)], 0, view.camera.size_px)
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)]) if len(pixels) else None


def _reason(thing: Seen, cloud: CloudView, scene: SceneObjects, config: FuseConfig) -> str:
    """Why a thing is no object, as far as its points tell."""
    points = cloud.points_xy[cloud.within(core(thing.box_xyxy))]
    if len(points) < FEWEST:
        met = f"the LiDAR meets fewer than {FEWEST} points of it" if len(points) else "the LiDAR meets nothing of it"
        return f"{met}, and the image tells its range less surely than to {config.camera_sigma_m:g} m"
    for i, name in enumerate(scene.ids):
        if _rectangle(scene, i).holds(points, MARGIN_M).mean() > 1 / 2:
            return f"most of its points are of object {name}"
    return f"its {len(points)} points fit no {thing.name} well enough for a probability of {config.min_probability:g}"


def _rectangle(scene: SceneObjects, i: int) -> Rectangle:
    assert scene.boxes is not None  # noqa: S101 - scenes of clouds have them
    length, width, _ = scene.boxes.sizes_m[i].tolist()
    return Rectangle(scene.positions_xy[i], length, width, float(scene.boxes.yaws_rad[i]), scene.covariances[i])
