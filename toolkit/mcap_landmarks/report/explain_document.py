"""An explanation as a document: what `explain --json` prints, and what a page shows of a bundle."""

from collections.abc import Sequence
from typing import TypedDict

import numpy as np

from mcap_landmarks.evaluation.explain import Place, Situation
from mcap_landmarks.localization.decision import told
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.match import LandmarkMatch
from mcap_landmarks.report.box_outcomes import LostBox
from mcap_landmarks.report.explain_reading import SensorData

_POSE = ("x_m", "y_m", "heading_deg")

# A class would have to have a field called `class`.
ObjectEntry = TypedDict(
    "ObjectEntry",
    {
        "id": str,
        "class": str,
        "probability": float,
        "x_m": float,
        "y_m": float,
        "yaw_deg": float | None,
        "size_m": list[float] | None,
        "range_m": float,
        "bearing_deg": float,
        "sigma_m": float | None,
        "landmark": str | None,
        "residual_m": float | None,
        "sigmas": float | None,
    },
)


def object_entries(situation: Situation, places: tuple[Place, ...]) -> list[ObjectEntry]:
    """The objects of a bundle, each with the landmark of the best place that it is held for, and how far off it is."""
    scene = situation.scene
    if scene is None:
        return []
    paired: dict[int, tuple[str, float, float | None]] = {}
    for place in places[:1]:
        if place.residual_m is not None:
            sigmas = [None] * len(place.rows) if place.sigmas is None else place.sigmas.tolist()
            off = zip(place.landmark_ids, place.residual_m.tolist(), sigmas, strict=True)
            paired = dict(zip(place.rows.tolist(), off, strict=True))
    found: list[ObjectEntry] = []
    for i, name in enumerate(scene.ids):
        x, y = scene.positions_xy[i].tolist()
        spread = float(np.sqrt(np.linalg.eigvalsh(scene.covariances[i])[-1])) if scene.covariances[i].any() else None
        label, probability = scene.hypotheses[i][0] if scene.hypotheses[i] else ("", 0.0)
        landmark, residual_m, sigmas = paired.get(i, (None, None, None))
        found.append(
            {
                "id": name,
                "class": label,
                "probability": probability,
                "x_m": x,
                "y_m": y,
                "yaw_deg": None if scene.boxes is None else float(np.degrees(scene.boxes.yaws_rad[i])),
                "size_m": None if scene.boxes is None else scene.boxes.sizes_m[i].tolist(),
                "range_m": float(np.hypot(x, y)),
                "bearing_deg": float(np.degrees(np.arctan2(y, x))),
                "sigma_m": spread,
                "landmark": landmark,
                "residual_m": residual_m,
                "sigmas": sigmas,
            }
        )
    return found


def explanation(situation: Situation, places: tuple[Place, ...], view: SensorData) -> dict[str, object]:
    """The document of `explain --json`, as schemas/json/explain.schema.json describes it."""
    match = situation.match
    return {
        "stamp_ns": situation.stamp_ns,
        "status": None if match is None else match.status.name.lower(),
        "bundles_joined": None if match is None else match.bundles_joined,
        "detections": _detections(situation.detections) if situation.detections else None,
        "clusters": None if situation.scan_objects is None else len(situation.scan_objects),
        "lost": None if view.lost is None else _lost(view.lost),
        "objects": None if situation.scene is None else object_entries(situation, places),
        "places": [
            {
                "landmarks": list(place.landmark_ids),
                "share": place.share,
                "pose": None if place.pose is None else dict(zip(_POSE, pose_figures(place), strict=True)),
                "chi2": place.chi2,
                "dof": place.dof,
                "sigma_m": place.sigma_m,
            }
            for place in places
        ],
        "conditions": None if match is None or not match.conditions else _conditions(match),
    }


def _detections(images: Sequence[Detections]) -> list[dict[str, object]]:
    return [
        {"class": hypotheses[0][0], "confidence": hypotheses[0][1], "xyxy": box, "camera": found.frame_id}
        for found in images
        for hypotheses, box in zip(found.hypotheses, found.boxes_xyxy.tolist(), strict=True)
        if hypotheses
    ]


def _lost(boxes: tuple[LostBox, ...]) -> list[dict[str, object]]:
    return [
        {
            "class": one.name,
            "confidence": one.score,
            "xyxy": one.box_xyxy.tolist(),
            "camera": one.camera,
            "reason": one.reason,
        }
        for one in boxes
    ]


def _conditions(match: LandmarkMatch) -> list[dict[str, object]]:
    return [
        {"name": one.name, "value": one.value, "limit": one.limit, "holds": one.held, "words": told(one)}
        for one in match.conditions
    ]


def pose_figures(place: Place) -> tuple[float, float, float]:
    """The pose of a place that has one: x and y in metres, the heading in degrees, not a number where unknown."""
    assert place.pose is not None  # noqa: S101 - callers looked
    x, y, heading = place.pose.tolist()
    return x, y, float(np.degrees(heading))
