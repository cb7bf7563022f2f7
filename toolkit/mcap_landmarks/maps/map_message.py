"""A landmark map as the objects of a message, and back."""

import numpy as np

from mcap_landmarks.errors import MapError
from mcap_landmarks.maps.model import LandmarkMap, MapSource
from mcap_landmarks.messages.scene import SceneObjects


def scene_from_map(landmark_map: LandmarkMap, stamp_ns: int) -> SceneObjects:
    """The confirmed landmarks as scene objects in the map's frame."""
    keep = np.flatnonzero(~landmark_map.tentative)
    return SceneObjects(
        stamp_ns,
        landmark_map.frame,
        tuple(landmark_map.ids[i] for i in keep),
        tuple(((landmark_map.classes[i], 1.0),) for i in keep),
        landmark_map.positions_xy[keep],
        landmark_map.covariances[keep],
        landmark_map.radii_m[keep],
    )


def map_from_scene(scene: SceneObjects, source: MapSource) -> LandmarkMap:
    """A surveyed map from a message such as `/ground_truth/objects`; no landmark counts as sighted.

    Raises:
        MapError: an object without class, ids that are not unique, impossible numbers.
    """
    if not len(scene):
        raise MapError("the message of reference objects is empty; a map needs landmarks")
    n = len(scene)
    return LandmarkMap(
        scene.ids,
        scene.classes,
        scene.positions_xy,
        scene.covariances,
        scene.radii_m,
        np.zeros(n, dtype=np.int64),
        np.zeros(n, dtype=np.bool_),
        sources=(source,),
        frame=scene.frame_id or "map",
    )
