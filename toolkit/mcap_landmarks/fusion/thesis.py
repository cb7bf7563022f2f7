"""The thesis's fusion (section 4.4, Algorithm 3): both sensors' objects from left to right, if they count the same."""

import numpy as np

from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects

OBJECTS = 3
"""A scene of the thesis has exactly so many."""


def fuse_in_order(objects: ScanObjects, detections: Detections | None, centre_px: float) -> tuple[SceneObjects, int]:
    """The scene of a scan and an image that have exactly three objects each, else an empty one.

    Boxes left of `centre_px` come first, then those right of it, each from left to right; objects at 0 to 30 degrees
    before those at 330 to 360, the middle beam of each as its place. Also returns the number of boxes left over.
    """
    found = 0 if detections is None else len(detections)
    pairs: list[tuple[int, int]] = []
    if detections is not None and found == len(objects) == OBJECTS:
        middles = (detections.boxes_xyxy[:, 0] + detections.boxes_xyxy[:, 2]) / 2
        surfaces = np.array([positions[-1] for positions in objects.positions_xy])
        bearings = np.arctan2(surfaces[:, 1], surfaces[:, 0])
        pairs = list(zip(_by_side(middles - centre_px), _by_side(-bearings), strict=True))
    rows = [i for _, i in pairs]
    scene = SceneObjects(
        objects.stamp_ns,
        objects.frame_id,
        tuple(objects.ids[i] for i in rows),
        tuple(detections.hypotheses[box] for box, _ in pairs) if detections is not None else (),
        np.array([objects.positions_xy[i][-1] for i in rows]).reshape(-1, 2),
        np.zeros((len(rows), 2, 2)),
        np.zeros(len(rows)),
    )
    return scene, found - len(pairs)


def _by_side(rightwards: Array) -> list[int]:
    order = [int(i) for i in np.argsort(rightwards, kind="stable")]
    return [i for i in order if rightwards[i] <= 0] + [i for i in order if rightwards[i] > 0]
