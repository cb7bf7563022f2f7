"""Build a landmark map from scene objects and odometry of one or several logs."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from mcap_landmarks.channels import MAP_MARKERS, MAP_PATH, MAP_POSE, ODOMETRY, SCENE_OBJECTS, SCENE_VELOCITIES
from mcap_landmarks.errors import MapError
from mcap_landmarks.mapping.built_map import BuiltMap
from mcap_landmarks.mapping.config import BuildMapConfig
from mcap_landmarks.mapping.landmark_slam import solve_jointly
from mcap_landmarks.mapping.observations import LogObservations
from mcap_landmarks.mapping.prepared_log import LogAlone, each_alone
from mcap_landmarks.mapping.thesis import solve_as_in_the_thesis
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.maps.scene_objects import known_covariances, standing
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import Bundle, OdometryAt, Reduction, Tolerance

_NOTHING: Mapping[int, Sequence[LogAlone]] = {}
FARTHEST_M = 500.0
"""Nothing that cameras and LiDARs of robots and cars see stands farther away."""


def collect(bundles: Iterable[Bundle], config: BuildMapConfig) -> LogObservations:
    """What one log saw: its bundles that have odometry, and their objects, but for those that move."""
    kept, seen, odometry, count = _usable(bundles)
    scenes, dropped = _standing(kept, seen, config)
    spread = [known_covariances(scene, config.range_sigma_m, config.bearing_sigma_rad) for scene in scenes]
    return LogObservations(
        np.array([bundle.stamp_ns for bundle in kept], dtype=np.int64),
        np.array([bundle.log_time_ns for bundle in kept], dtype=np.int64),
        np.array([at.odom_from_base for at in odometry]).reshape(-1, 3),
        np.array([at.way_m for at in odometry]),
        np.array([at.turned_rad for at in odometry]),
        np.repeat(np.arange(len(kept)), list(map(len, scenes))),
        tuple(name for scene in scenes for name in scene.classes),
        np.concatenate([np.zeros((0, 2)), *(scene.positions_xy for scene in scenes)]),
        np.concatenate([np.zeros((0, 2, 2)), *spread]),
        np.concatenate([np.zeros(0), *(scene.radii_m for scene in scenes)]),
        count,
        dropped=dropped,
        piece=np.array([at.piece for at in odometry], dtype=np.int64),
    )


def _standing(
    bundles: Iterable[Bundle], scenes: Iterable[SceneObjects], config: BuildMapConfig
) -> tuple[list[SceneObjects], Counter[str]]:
    """Scenes without what rather moves than stands by the end of its track, when most is known of it; and how many."""
    moving, dropped = set[str](), Counter[str]()
    for bundle in bundles:
        velocities = bundle.get(SCENE_VELOCITIES)
        if velocities is not None:
            moving -= {*velocities.ids}
            moving |= velocities.moving_ids
    return [standing(scene, moving, dropped, fixed=config.fixed) for scene in scenes], dropped


def _usable(bundles: Iterable[Bundle]) -> tuple[list[Bundle], list[SceneObjects], list[OdometryAt], int]:
    """The bundles with a scene, odometry and a stamp after the last one's, both of these, and the number of all."""
    kept: list[Bundle] = []
    scenes, odometry, count = [], [], 0
    for bundle in bundles:
        scene, at = bundle.get(SCENE_OBJECTS), bundle.odometry
        count += 1
        if scene is not None and at is not None and (not kept or bundle.stamp_ns > kept[-1].stamp_ns):
            kept.append(bundle)
            scenes.append(scene)
            odometry.append(at)
    return kept, scenes, odometry, count


def alone(log: LogObservations, config: BuildMapConfig) -> tuple[LogAlone, ...]:
    """What a log tells before others are known; nothing where `solve` will not ask for it, or would fail on it."""
    if config.method == "thesis" or not len(log.bundle):
        return ()
    try:
        return each_alone(log, config)
    except (MapError, RuntimeError):
        return ()


def solve(
    logs: Sequence[LogObservations],
    prior: LandmarkMap | None,
    config: BuildMapConfig,
    alone: Mapping[int, Sequence[LogAlone]] = _NOTHING,
) -> BuiltMap:
    """One map of all logs, each log's trajectory in it, and how the solver ended.

    `alone` is what the function of that name found of some of the logs, by their rows.

    Raises:
        MapError: nothing was seen, a log cannot be joined to the others, or the solver did not converge.
    """
    if not any(len(log.bundle) or log.dropped for log in logs):
        raise MapError("no bundle holds an object; a map needs scene objects")
    ranges = np.concatenate([np.zeros(0), *(np.hypot(*log.points_xy.T) for log in logs)])
    if len(ranges) and (far_m := float(np.median(ranges))) > FARTHEST_M:
        raise MapError(
            f"scene objects are {far_m:.0f} m away on the median, as if they were in millimetres; give metres"
        )
    if config.method == "thesis":
        return solve_as_in_the_thesis(logs)
    try:
        return solve_jointly(logs, prior, config, alone)
    except RuntimeError as error:  # what the sparse solver raises
        raise MapError(
            f"what was seen does not determine a map ({error}); look at positions and covariances"
        ) from error


STAGE = Reduction(
    "build_map",
    reads=(SCENE_OBJECTS, ODOMETRY, SCENE_VELOCITIES),
    writes=(MAP_MARKERS, MAP_PATH, MAP_POSE),
    config=BuildMapConfig,
    optional=(SCENE_VELOCITIES,),
    collect=collect,
    alone=alone,
    solve=solve,
    tolerance={
        "position_m": 1e-4,
        "orientation": 1e-5,
        "size_m": 1e-4,
        "radius_m": 1e-4,
        "heading_rad": 1e-5,
        "covariance": Tolerance(1e-9, 1e-3),
    },
)
