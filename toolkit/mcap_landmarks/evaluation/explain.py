"""Where a bundle was seen, or may have been: the match as it was published, else its candidates fitted again."""

from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation.polar import polar_from_points
from mcap_landmarks.estimation.pose import position_sigma, solve_poses
from mcap_landmarks.geometry.se2 import Array, rotation, transform_points
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.maps.scene_objects import known_covariances
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.match import LandmarkMatch
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects

Ints = NDArray[np.int64]

# Of more objects than these, the nearest are tried as a candidate's landmarks: choosing five of twelve is 792 fits.
_MOST = 12


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """What a log holds about one bundle; None where it has nothing of that kind.

    `landmarks` is the map that was used; `pose` (3,) and `covariance` (3, 3) are what was published, where there is no
    heading without a covariance. `detections` are those of every camera. `config` is what localize ran with.
    """

    stamp_ns: int
    scene: SceneObjects | None
    match: LandmarkMatch | None
    landmarks: SceneObjects | None = None
    pose: Array | None = None
    covariance: Array | None = None
    scan_objects: ScanObjects | None = None
    detections: tuple[Detections, ...] = ()
    config: LocalizeConfig = field(default_factory=LocalizeConfig)


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A place of the map: its landmarks, its share of the evidence, and the bundle's objects there.

    rows (K,): the object at each landmark, in the scene; residual_m and sigmas (K,): how far off each is, in metres and
    in standard deviations of object and landmark. The pose (3,) has no heading (NaN) where none was published. Without
    a pose the landmarks were seen in earlier bundles, or nobody knows which objects they are.
    """

    landmark_ids: tuple[str, ...]
    share: float
    rows: Ints
    pose: Array | None = None
    residual_m: Array | None = None
    sigmas: Array | None = None
    chi2: float = float("nan")
    dof: int = 0
    sigma_m: float = float("nan")


def places_of(situation: Situation) -> tuple[Place, ...]:
    """The match itself where objects were matched, else what was possible, best first."""
    match, scene, landmarks = situation.match, situation.scene, situation.landmarks
    if match is None or scene is None or landmarks is None:
        return ()
    if match.object_ids:
        return (_matched(situation, match, scene, landmarks),)
    near = np.sort(np.argsort(np.linalg.norm(scene.positions_xy, axis=1), kind="stable")[:_MOST])
    places = []
    for name, share in zip(match.candidate_ids, match.candidate_scores.tolist(), strict=True):
        if not name:  # of a place that is known from earlier bundles alone
            continue
        names = tuple(name.split("+"))
        choices = np.array(list(combinations(near.tolist(), len(names))), dtype=np.int64)
        places.append(_fitted(situation, scene, landmarks, Place(names, share, np.zeros(0, dtype=np.int64)), choices))
    return tuple(places)


def _matched(situation: Situation, match: LandmarkMatch, scene: SceneObjects, landmarks: SceneObjects) -> Place:
    """The match as it was published; where its pose was refused, the one that its pairs alone tell."""
    share = float(match.candidate_scores[0]) if len(match.candidate_scores) else float("nan")
    rows = np.array([scene.ids.index(name) for name in match.object_ids if name in scene.ids], dtype=np.int64)
    if len(rows) != len(match.landmark_ids) or any(name not in landmarks.ids for name in match.landmark_ids):
        return Place(match.landmark_ids, share, np.zeros(0, dtype=np.int64))
    told = Place(match.landmark_ids, share, rows, residual_m=match.residual_m, chi2=match.chi2, dof=match.dof)
    pose, covariance = situation.pose, situation.covariance
    if pose is None:
        return replace(told, pose=_fitted(situation, scene, landmarks, told, rows[None]).pose)
    if covariance is None:
        return replace(told, pose=np.array([*pose[:2], np.nan]))
    sigmas = _sigmas(situation, scene, landmarks, told, pose)
    return replace(told, pose=pose, sigmas=sigmas, sigma_m=float(position_sigma(covariance)))


def _fitted(situation: Situation, scene: SceneObjects, landmarks: SceneObjects, place: Place, choices: Ints) -> Place:
    """The place with the objects, of choices (C, K), that fit its landmarks best, and where they say that it is."""
    names = place.landmark_ids
    if len(names) < 2 or not choices.size or any(name not in landmarks.ids for name in names):
        return place
    which = [landmarks.ids.index(name) for name in names]
    spread = _spread(situation, scene)
    place_xy = landmarks.positions_xy[which]
    range_m, bearing_rad, covariance = polar_from_points(scene.positions_xy[choices], spread[choices])
    solved = solve_poses(
        np.broadcast_to(place_xy, (len(choices), *place_xy.shape)),
        range_m,
        bearing_rad,
        covariance,
        landmark_covariance=landmarks.covariances[which],
    )
    best = int(np.argmin(np.where(np.isfinite(solved.chi2), solved.chi2, np.inf)))
    pose = solved.map_from_base[best]
    if not np.isfinite(pose).all():
        return place
    found = Place(names, place.share, choices[best])
    miss = transform_points(pose, scene.positions_xy[found.rows]) - place_xy
    return Place(
        names,
        place.share,
        found.rows,
        pose,
        np.linalg.norm(miss, axis=1),
        _sigmas(situation, scene, landmarks, found, pose),
        float(solved.chi2[best]),
        int(solved.dof[best]),
        float(position_sigma(solved.covariance[best])),
    )


def _sigmas(situation: Situation, scene: SceneObjects, landmarks: SceneObjects, place: Place, pose: Array) -> Array:
    """Mahalanobis distance (K,) between each object, seen from a pose, and its landmark."""
    which = [landmarks.ids.index(name) for name in place.landmark_ids]
    miss = transform_points(pose, scene.positions_xy[place.rows]) - landmarks.positions_xy[which]
    turn = rotation(pose[2])
    spread = turn @ _spread(situation, scene)[place.rows] @ turn.T + landmarks.covariances[which]
    squared = (miss[:, None] @ np.linalg.solve(spread, miss[..., None]))[:, 0, 0]
    sigmas: Array = np.sqrt(np.maximum(squared, 0.0))
    return sigmas


def _spread(situation: Situation, scene: SceneObjects) -> Array:
    return known_covariances(scene, situation.config.range_sigma_m, situation.config.bearing_sigma_rad)
