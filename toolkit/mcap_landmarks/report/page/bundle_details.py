"""What a page shows of one bundle: image with boxes, scan or cloud with clusters, match, and the decision."""

import base64
from dataclasses import dataclass, field

import numpy as np

from mcap_landmarks.evaluation.explain import Place, Situation, places_of
from mcap_landmarks.geometry.se2 import Array, inverse, transform_points
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.report.drawing import regions_95
from mcap_landmarks.report.explain_document import explanation
from mcap_landmarks.report.explain_reading import Picture, SensorData
from mcap_landmarks.report.explain_words import beside_the_scan, sensed_lines
from mcap_landmarks.report.page.chosen_bundles import evenly
from mcap_landmarks.report.page.jpeg_pictures import data_url

_MOST_POINTS = 1200
"""So many points of a cloud are enough to see what stands where, and take 10 KB."""
_AROUND_M = 3.0
"""Landmarks are drawn so far beyond what the bundle saw."""
_LARGEST_M = 327.0
"""Points are carried as centimetres of 16 bits."""


@dataclass(slots=True)
class PictureStore:
    """The pictures of a page, each once: several bundles may have the same image. Each may take `most_bytes`."""

    most_bytes: int
    urls: list[str] = field(default_factory=list)
    _places: dict[str, int] = field(default_factory=dict)
    _first: int = 0

    def add(self, picture: Picture) -> int | None:
        """The place of a picture in `urls`; None where there is no image."""
        if picture.pixels is None:
            return None
        url, step = data_url(picture.pixels, self.most_bytes, self._first)
        self._first = max(0, step - 1)
        place = self._places.setdefault(url, len(self.urls))
        if place == len(self.urls):
            self.urls.append(url)
        return place


def bundle_detail(situation: Situation, view: SensorData, store: PictureStore) -> dict[str, object]:
    """One bundle as JSON values; its pictures go to the store."""
    places = places_of(situation)
    told = explanation(situation, places, view)
    scene = situation.scene
    return {
        "lines": sensed_lines(situation, view),
        "joined": told["bundles_joined"],
        "objects": told["objects"],
        "places": told["places"],
        "conditions": told["conditions"],
        "pictures": [_picture(one, situation.stamp_ns, store) for one in view.pictures],
        "regions": [] if scene is None else _regions(scene),
        "clusters": _clusters(situation),
        "landmarks": _landmarks(situation, places[0]) if places else [],
        **_points(view),
    }


def _picture(picture: Picture, scan_ns: int, store: PictureStore) -> dict[str, object]:
    found, pixels = picture.detections, picture.pixels
    boxes: list[list[object]] = []
    if found is not None:
        for box, options in zip(found.boxes_xyxy, found.hypotheses, strict=True):
            name, score = options[0] if options else ("", 0.0)
            boxes.append([*np.round(box, 1).tolist(), name, score])
    return {
        "place": store.add(picture),
        "size": None if pixels is None else [pixels.shape[1], pixels.shape[0]],
        "camera": "" if found is None else found.frame_id,
        "when": "" if found is None else beside_the_scan(found.stamp_ns, scan_ns),
        "boxes": boxes if found is not None else None,
        "lost": [np.round(one.box_xyxy, 1).tolist() for one in picture.lost or ()],
    }


def _regions(scene: SceneObjects) -> list[list[float] | None]:
    """The 95 % regions of objects: semi-axes and direction; None where the covariance is unknown."""
    radii, directions_rad = regions_95(scene.covariances)
    known = [bool(spread.any()) for spread in scene.covariances]
    rows = np.column_stack([radii, np.degrees(directions_rad)]).tolist()
    return [row if is_known else None for row, is_known in zip(rows, known, strict=True)]


def _clusters(situation: Situation) -> list[list[object]]:
    """Of each cluster the middle, the extent and what it is rather, empty where none of the known shapes."""
    found = situation.scan_objects
    if found is None:
        return []
    return [
        [*points[-1].tolist(), extent_m, options[0][0] if options else ""]
        for points, extent_m, options in zip(
            found.positions_xy, found.extents_m.tolist(), found.hypotheses, strict=True
        )
        if len(points)
    ]


def _landmarks(situation: Situation, place: Place) -> list[list[object]]:
    """Landmarks as they stand around the robot at a place: x, y, id, class, and whether it was matched."""
    landmarks, scene, pose = situation.landmarks, situation.scene, place.pose
    if landmarks is None or scene is None or pose is None or not np.isfinite(pose).all():
        return []
    around_xy = transform_points(inverse(pose), landmarks.positions_xy)
    reach_m = _AROUND_M + np.abs(scene.positions_xy).max(initial=0.0)
    near = np.flatnonzero(np.linalg.norm(around_xy, axis=1) <= reach_m).tolist()
    return [
        [*around_xy[i].tolist(), landmarks.ids[i], landmarks.classes[i], landmarks.ids[i] in place.landmark_ids]
        for i in near
    ]


def _points(view: SensorData) -> dict[str, object]:
    """Where beams ended, as centimetres in 16 bits and base64; of a cloud also the cluster of each point."""
    if view.cloud is not None:
        rows = evenly(np.arange(len(view.cloud.clusters)), _MOST_POINTS)
        points = view.cloud.points_m[rows, :2].astype(np.float64)
        return {"points": _packed(points), "point_clusters": _packed(view.cloud.clusters[rows] % 1000 / 100)}
    return {} if view.scan_xy is None else {"points": _packed(view.scan_xy)}


def _packed(values: Array) -> str:
    centimetres = np.rint(100 * np.clip(np.nan_to_num(values), -_LARGEST_M, _LARGEST_M)).astype("<i2")
    return base64.b64encode(centimetres.tobytes()).decode()
