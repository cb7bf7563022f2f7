"""What of detections and scan objects is fused at all."""

from collections import Counter

import numpy as np

from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects

UNWANTED = "detections of {}, which is no landmark by the settings"
TOO_FEW = "objects of scenes with fewer than {}: {}"
NO_BOX = "detections without a class or a box"


def usable(objects: ScanObjects) -> ScanObjects:
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


def wanted(detections: Detections, config: FuseConfig) -> tuple[Detections, Counter[str]]:
    """The detections that are boxes of what may be a landmark, and how many others there are, by reason."""
    classes = [options[0][0] if options else "" for options in detections.hypotheses]
    boxes = detections.boxes_xyxy
    whole = np.asarray(np.isfinite(boxes).all(axis=1) & (boxes[:, 2:] > boxes[:, :2]).all(axis=1))
    keep, left_out = [], Counter[str]()
    for i, name in enumerate(classes):
        if not (name and whole[i]):
            left_out[NO_BOX] += 1
        elif name in config.ignore_classes or (config.landmark_classes and name not in config.landmark_classes):
            left_out[UNWANTED.format(name)] += 1
        else:
            keep.append(i)
    kept = Detections(
        detections.stamp_ns,
        detections.frame_id,
        tuple(detections.ids[i] for i in keep),
        tuple(detections.hypotheses[i] for i in keep),
        boxes[keep].reshape(-1, 4),
    )
    return kept, left_out


def at_least(scene: SceneObjects, count: int) -> tuple[SceneObjects, Counter[str]]:
    """A scene, if it has so many objects, else an empty one; and how many were left out, by reason."""
    if len(scene) >= count:
        return scene, Counter()
    empty = SceneObjects(scene.stamp_ns, scene.frame_id, (), (), np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0))
    return empty, Counter(TOO_FEW.format(count, name) for name in scene.classes)
