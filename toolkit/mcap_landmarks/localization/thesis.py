"""The thesis's way to localize (Algorithms 5 and 6): ordered class triples, the last match wins, range-only LM."""

from collections.abc import Sequence

import numpy as np

from mcap_landmarks.estimation.thesis import solve_position
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.decision import of_triple
from mcap_landmarks.localization.match import Match
from mcap_landmarks.maps.model import Group, LandmarkMap
from mcap_landmarks.messages.match import LandmarkMatch
from mcap_landmarks.messages.scene import SceneObjects


def locate_as_in_the_thesis(
    scenes: Sequence[SceneObjects], landmark_map: LandmarkMap, config: LocalizeConfig
) -> list[Match]:
    """Position of each scene of exactly three objects whose ordered classes are those of a group; it has no heading."""
    class_of = dict(zip(landmark_map.ids, landmark_map.classes, strict=True))
    last = {tuple(class_of[name] for name in group.landmark_ids): group for group in landmark_map.groups}
    position_of = dict(zip(landmark_map.ids, landmark_map.positions_xy, strict=True))
    return [_locate(scene, last, position_of, config) for scene in scenes]


def _locate(
    scene: SceneObjects,
    groups: dict[tuple[str, ...], Group],
    position_of: dict[str, np.ndarray],
    config: LocalizeConfig,
) -> Match:
    if len(scene) != 3:
        made = of_triple(len(scene))
        return Match(LandmarkMatch(scene.stamp_ns, scene.frame_id, made.status, conditions=made.conditions))
    bearings = np.arctan2(scene.positions_xy[:, 1], scene.positions_xy[:, 0])
    order = np.argsort(-bearings, kind="stable")
    group = groups.get(tuple(scene.classes[i] for i in order))
    made = of_triple(len(scene), 0 if group is None else 1)
    if group is None:
        return Match(LandmarkMatch(scene.stamp_ns, scene.frame_id, made.status, conditions=made.conditions))
    landmarks = np.stack([position_of[name] for name in group.landmark_ids])
    range_m = np.linalg.norm(scene.positions_xy[order], axis=1)
    position = solve_position(landmarks, range_m, config.thesis_guess_m).position_xy
    match = LandmarkMatch(
        scene.stamp_ns,
        scene.frame_id,
        made.status,
        tuple(scene.ids[i] for i in order),
        group.landmark_ids,
        np.abs(np.linalg.norm(landmarks - position, axis=1) - range_m),
        conditions=made.conditions,
    )
    return Match.of(match, np.array([*position, 0.0]))
