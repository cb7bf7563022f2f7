"""Localize every bundle of scene objects in a landmark map."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Literal

import numpy as np

from toolkit.channels import (
    MAP,
    MATCH,
    ODOMETRY,
    POSE,
    POSE_COVARIANCE,
    SCENE_OBJECTS,
    TF,
)
from toolkit.geometry.se2 import compose, inverse
from toolkit.landmarks.database import read_map
from toolkit.landmarks.scene import scene_from_map
from toolkit.messages.match import Status
from toolkit.messages.poses import PoseStamped, PoseWithCovarianceStamped
from toolkit.messages.transforms import TFMessage, Transform
from toolkit.stage import Bundle, Stage, Stamped
from toolkit.stages._localize_default import Located, Locator
from toolkit.stages._localize_thesis import locate_as_in_the_thesis

_BATCH = 4096


@dataclass(frozen=True, slots=True)
class LocalizeConfig:
    """How bundles are localized.

    `max_sigma_m`: a pose whose own position sigma (square root of the largest eigenvalue) is above it is refused, and
    so is one whose heading sigma is above `max_sigma_deg`: three of them are the 20 degrees that make a pose false.
    `range_sigma_m` and `bearing_sigma_rad` stand in for covariances that the log leaves unknown. `robust_dof`: degrees
    of the Student-t distribution that observations weigh by; 0 weighs them by their covariance alone. `consistency`:
    the probability under which a set of objects that do fit is refused. `calibrate` finds from the first bundles
    whether ranges are distances or depths, and their offset, and corrects them where that explains far more than
    chance. `tf`: write map -> odom, or never. `thesis_guess_m`: the fixed initial guess of the thesis's solver, which
    the thesis does not print.
    """

    method: Literal["default", "thesis"] = "default"
    max_sigma_m: float = 0.5
    max_sigma_deg: float = 6.5
    range_sigma_m: float = 0.05
    bearing_sigma_rad: float = 0.01
    robust_dof: float = 0.0
    consistency: float = 1e-3
    calibrate: bool = True
    tf: Literal["auto", "never"] = "auto"
    thesis_guess_m: tuple[float, float] = (0.0, 0.0)


def process(bundles: Iterable[Bundle], config: LocalizeConfig, resources: Mapping[str, Path]) -> Iterator[Stamped]:
    """Match and pose of every bundle, the map once before the first."""
    landmark_map = read_map(resources["map"])
    locator = Locator(landmark_map, config)
    stream, first = iter(bundles), True
    while batch := list(islice(stream, _BATCH)):
        if first:
            yield Stamped(MAP, batch[0].log_time_ns, scene_from_map(landmark_map, batch[0].stamp_ns))
            first = False
        scenes = [scene for bundle in batch if (scene := bundle.get(SCENE_OBJECTS)) is not None]
        if config.method == "thesis":
            found = locate_as_in_the_thesis(scenes, landmark_map, config)
        else:
            found = locator.locate(scenes)
        for bundle, located in zip(batch, found, strict=True):
            yield from _messages(bundle, located, landmark_map.frame, config)


def _messages(bundle: Bundle, located: Located, frame: str, config: LocalizeConfig) -> Iterator[Stamped]:
    yield Stamped(MATCH, bundle.log_time_ns, located.match)
    if located.match.status != Status.LOCALIZED or located.pose is None:
        return
    pose, stamp_ns = located.pose, bundle.stamp_ns
    if located.covariance is None:  # the thesis's solver knows no heading, and an all-zero quaternion says so
        position = np.array([pose[0], pose[1], 0.0])
        yield Stamped(POSE, bundle.log_time_ns, PoseStamped(stamp_ns, frame, position, np.zeros(4)))
        return
    yield Stamped(POSE, bundle.log_time_ns, PoseStamped.planar(stamp_ns, frame, pose))
    message = PoseWithCovarianceStamped.planar(stamp_ns, frame, pose, located.covariance)
    yield Stamped(POSE_COVARIANCE, bundle.log_time_ns, message)
    if config.tf == "auto" and bundle.odometry is not None:
        map_from_odom = compose(pose, inverse(bundle.odometry.odom_from_base))
        transform = Transform.planar(stamp_ns, (frame, bundle.odometry.frame_id), map_from_odom)
        yield Stamped(TF, bundle.log_time_ns, TFMessage((transform,)))


STAGE = Stage(
    "localize",
    reads=(SCENE_OBJECTS, ODOMETRY),
    writes=(MAP, MATCH, POSE, POSE_COVARIANCE, TF),
    config=LocalizeConfig,
    process=process,
    resources=("map",),
    tolerance={"position_m": 1e-6, "orientation": 1e-7, "residual_m": 1e-6},
)
