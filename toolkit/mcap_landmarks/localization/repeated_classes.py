"""Localize where classes repeat: match by geometry, one bundle alone or a sequence until one place remains."""

from collections.abc import Sequence

from mcap_landmarks.estimation.odometry import OdometryNoise
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.match import Match
from mcap_landmarks.localization.matching import Matcher
from mcap_landmarks.localization.sequence import SequenceLocalizer
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.maps.neighbours import Neighbours
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import OdometryAt


class RepeatedClassLocalizer:
    """Localizes the scenes of one log in their order."""

    def __init__(self, landmark_map: LandmarkMap, neighbours: Neighbours | None, config: LocalizeConfig) -> None:
        self._config = config
        noise = OdometryNoise(config.odometry_position_m, config.odometry_heading_rad, config.odometry_turning_rad)
        self._matcher = Matcher(MapIndex.build(landmark_map, neighbours), config)
        self._sequence = SequenceLocalizer(self._matcher, noise, config.join_m)

    def locate(self, scenes: Sequence[SceneObjects], odometry: Sequence[OdometryAt | None]) -> list[Match]:
        """Pose of each scene's base in the map; single bundles only, where `join_m` is 0."""
        if self._config.join_m > 0:
            return [self._sequence.localize(scene, at) for scene, at in zip(scenes, odometry, strict=True)]
        return self._matcher.match(scenes)
