"""Localize where classes repeat: match by geometry, and join bundles through odometry until one place remains."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from mcap_landmarks.estimation.odometry import OdometryNoise
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.decision import Match
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.matching import Matcher
from mcap_landmarks.localization.sequence import Joiner
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.maps.neighbours import Neighbours
from mcap_landmarks.messages.match import Status
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import OdometryAt


class JoinedLocator:
    """Localizes the scenes of one log in their order."""

    def __init__(self, landmark_map: LandmarkMap, neighbours: Neighbours | None, config: LocalizeConfig) -> None:
        self._config = config
        noise = OdometryNoise(config.odometry_position_m, config.odometry_heading_rad, config.odometry_turning_rad)
        self._matcher = Matcher(MapIndex.build(landmark_map, neighbours), config)
        self._joiner = Joiner(self._matcher, noise, config.join_m)

    def locate(self, scenes: Sequence[SceneObjects], odometry: Sequence[OdometryAt | None]) -> list[Match]:
        """Pose of each scene's base in the map; single bundles only, where `join_m` is 0."""
        if self._config.join_m > 0:
            found = [self._joiner.add(scene, at) for scene, at in zip(scenes, odometry, strict=True)]
        else:
            found = self._matcher.match(scenes)
        return [self._limited(match) for match in found]

    def _limited(self, match: Match) -> Match:
        """A heading that is too uncertain makes the pose too weak, however good the position."""
        if match.covariance is None or np.degrees(np.sqrt(match.covariance[2, 2])) <= self._config.max_sigma_deg:
            return match
        return Match(dataclasses.replace(match.message, status=Status.WEAK_GEOMETRY))
