"""Localize every bundle of scene objects in a landmark map."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import islice

import numpy as np

from mcap_landmarks.channels import (
    LOCALIZED_PATH,
    MAP,
    MAP_MARKERS,
    MATCH,
    ODOM_FRAME,
    ODOMETRY,
    POSE,
    POSE_COVARIANCE,
    SCENE_OBJECTS,
    SCENE_VELOCITIES,
    TF,
    TF_STATIC,
)
from mcap_landmarks.errors import MapError
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.geometry.se2 import compose, inverse
from mcap_landmarks.localization.class_association import unique_classes
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.drawn_path import DrawnPath
from mcap_landmarks.localization.match import Match
from mcap_landmarks.localization.repeated_classes import RepeatedClassLocalizer
from mcap_landmarks.localization.thesis import locate_as_in_the_thesis
from mcap_landmarks.localization.unique_classes import UniqueClassLocalizer
from mcap_landmarks.localization.validation import check_map
from mcap_landmarks.locations import Location
from mcap_landmarks.maps.database import read_map, read_neighbours
from mcap_landmarks.maps.map_markers import markers_from_map
from mcap_landmarks.maps.map_message import scene_from_map
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.maps.scene_objects import standing
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.match import Status
from mcap_landmarks.messages.poses import PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.stage import Bundle, InputLog, LeftOut, OdometryAt, Omission, Stage, Stamped, Tolerance

# Bundles that are solved together, or calibrated from; a sequence takes them one by one.
_BATCH, _SEQUENCE = 4096, 64
# Odds are the exponential of a sum of squares over sigmas, and so a thousandth apart where objects are a micrometre
# apart (some ten of them, with sigmas of a centimetre). They are worth telling apart however small they are: the floor
# is that of `Evidence.odds_against`.
_ODDS = Tolerance(1e-300, 1e-3)
_NO_FRAME = "transforms to odometry not written: odometry names no frame of its own, or had to be mended"

Locate = Callable[[Sequence[SceneObjects], Sequence[OdometryAt | None]], list[Match]]


def process(
    bundles: Iterable[Bundle], config: LocalizeConfig, resources: Mapping[str, Location]
) -> Iterator[Stamped | Omission]:
    """Match and pose of every bundle, the map and its markers once before the first, and the path while it grows.

    A transform that cannot be is an omission.
    """
    path, last_ns = DrawnPath(), 0
    for result in _results(bundles, config, resources):
        yield result
        if isinstance(result, Stamped) and (pose := result.get(POSE)):
            last_ns = result.log_time_ns
            if grown := path.add(pose):
                yield Stamped(LOCALIZED_PATH, last_ns, grown)
    if rest := path.rest():
        yield Stamped(LOCALIZED_PATH, last_ns, rest)


def _results(
    bundles: Iterable[Bundle], config: LocalizeConfig, resources: Mapping[str, Location]
) -> Iterator[Stamped | Omission]:
    landmark_map = _usable_map(resources["map"], config)
    locate, size = _method(resources["map"], landmark_map, config)
    stream, first = iter(bundles), True
    while batch := list(islice(stream, size)):
        if first:
            yield Stamped(MAP, batch[0].log_time_ns, scene_from_map(landmark_map, batch[0].stamp_ns))
            yield Stamped(MAP_MARKERS, batch[0].log_time_ns, markers_from_map(landmark_map, batch[0].stamp_ns))
            first = False
        seen = [_standing(bundle, config) for bundle in batch]
        matches = locate([scene for scene, _ in seen], [bundle.odometry for bundle in batch])
        for bundle, match, (_, dropped) in zip(batch, matches, seen, strict=True):
            yield from (Omission(bundle.log_time_ns, reason) for reason in dropped.elements())
            yield from _messages(bundle, match, landmark_map.frame, config)


def _standing(bundle: Bundle, config: LocalizeConfig) -> tuple[SceneObjects, Counter[str]]:
    """The objects of a bundle that can be landmarks, and why others are none."""
    scene, velocities, dropped = bundle.messages[SCENE_OBJECTS], bundle.get(SCENE_VELOCITIES), Counter[str]()
    assert isinstance(scene, SceneObjects)  # noqa: S101 - they make the bundle
    moving = frozenset[str]() if velocities is None else velocities.moving_ids
    return standing(scene, moving, dropped, fixed=config.fixed), dropped


def _usable_map(path: Location, config: LocalizeConfig) -> LandmarkMap:
    """The map in a database, if a pose can be found in it.

    Raises:
        MapError: it cannot be read, or no pose can be found in it.
    """
    landmark_map = read_map(path)
    if config.fixed:
        landmark_map = landmark_map.without_movable()
    try:
        check_map(landmark_map)
    except MapError as error:
        raise MapError(f"{path}: {error}") from error
    return landmark_map


def _method(path: Location, landmark_map: LandmarkMap, config: LocalizeConfig) -> tuple[Locate, int]:
    """The way to localize that the configuration and the map's classes ask for, and how many bundles at once."""
    if config.method == "thesis":
        return lambda scenes, _odometry: locate_as_in_the_thesis(scenes, landmark_map, config), _BATCH
    if len(unique_classes(landmark_map)) == np.count_nonzero(~landmark_map.tentative):
        unique = UniqueClassLocalizer(landmark_map, config)
        return lambda scenes, _odometry: unique.locate(scenes), _BATCH
    repeated = RepeatedClassLocalizer(landmark_map, read_neighbours(path, landmark_map), config)
    return repeated.locate, _SEQUENCE if config.join_m > 0 else _BATCH


def _messages(bundle: Bundle, match: Match, frame: str, config: LocalizeConfig) -> Iterator[Stamped | Omission]:
    yield Stamped(MATCH, bundle.log_time_ns, match.message)
    if match.message.status != Status.LOCALIZED or match.pose is None:
        return
    pose, stamp_ns = match.pose, bundle.stamp_ns
    if match.covariance is None:  # no heading is known, and an all-zero quaternion says so
        position = np.array([pose[0], pose[1], 0.0])
        yield Stamped(POSE, bundle.log_time_ns, PoseStamped(stamp_ns, frame, position, np.zeros(4)))
        return
    yield Stamped(POSE, bundle.log_time_ns, PoseStamped.planar(stamp_ns, frame, pose))
    message = PoseWithCovarianceStamped.planar(stamp_ns, frame, pose, match.covariance)
    yield Stamped(POSE_COVARIANCE, bundle.log_time_ns, message)
    if config.tf == "auto" and bundle.odometry is not None:
        if plain(bundle.odometry.frame_id) in ("", plain(frame)):  # readers refuse transforms from a frame to itself
            yield Omission(bundle.log_time_ns, _NO_FRAME)
            return
        map_from_odom = compose(pose, inverse(bundle.odometry.odom_from_base))
        transform = Transform.planar(stamp_ns, (frame, bundle.odometry.frame_id), map_from_odom)
        yield Stamped(TF, bundle.log_time_ns, TFMessage((transform,)))


def _transforms_topic(log: InputLog, config: LocalizeConfig) -> str | LeftOut:
    """/tf, unless the frame of odometry has a parent there already: a frame has one parent only."""
    if config.tf == "never":
        return TF.topic
    odometry = log.first(ODOMETRY)
    frame = ODOM_FRAME if odometry is None else plain(odometry.frame_id) or ODOM_FRAME
    if _has_parent(log, frame):
        return LeftOut(f"{frame} has a parent frame already; no map -> {frame} transform is written")
    return TF.topic


def _has_parent(log: InputLog, frame: str) -> bool:
    topics = {TF.topic, TF_STATIC.topic}
    name = frame.encode() + b"\0"
    for raw in log.messages([entry.connection for entry in log.channels if entry.connection.topic in topics]):
        if name in bytes(raw.data):  # decode only what can have it as child
            message = decode(TF.message, raw.data)
            if any(plain(transform.child_frame_id) == frame for transform in message.transforms):
                return True
    return False


STAGE = Stage(
    "localize",
    reads=(SCENE_OBJECTS, ODOMETRY, SCENE_VELOCITIES),
    writes=(MAP, MAP_MARKERS, MATCH, POSE, POSE_COVARIANCE, LOCALIZED_PATH, TF),
    config=LocalizeConfig,
    process=process,
    optional=(SCENE_VELOCITIES,),
    places={TF: _transforms_topic},
    resources=("map",),
    tolerance={
        "position_m": 1e-6,
        "orientation": 1e-7,
        "translation_m": 1e-4,
        "rotation": 1e-7,
        "covariance": Tolerance(1e-12, 1e-6),
        "residual_m": 1e-6,
        "candidate_scores": Tolerance(1e-6, 1e-6),
        "expected_accidental": _ODDS,
        "chi2": Tolerance(1e-6, 1e-6),
        "condition_values": Tolerance(1e-6, _ODDS.relative),  # small odds have a field of their own
        "condition_limits": Tolerance(0.0, 1e-9),
    },
)
