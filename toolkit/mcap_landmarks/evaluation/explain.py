"""Why a bundle was localized or not: its candidate places fitted again, and the conditions that it had to meet."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from mcap_landmarks.estimation.polar import polar_from_points
from mcap_landmarks.estimation.pose import position_sigma, solve_poses
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.maps.scene_objects import known_covariances
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.match import LandmarkMatch, Status
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects

Ints = NDArray[np.int64]

# A set of objects where classes repeat fits if so much of a chi-square lies beyond it.
_SET = 1e-4
# With more objects than these, the nearest, a candidate's landmarks could be any of too many.
_MOST = 12


@dataclass(frozen=True, slots=True)
class Limits:
    """What the run asked of a match; names are those of the configuration of localize."""

    accidental: float = 2e-3
    max_sigma_m: float = 0.5
    max_sigma_deg: float = 6.5
    consistency: float = 1e-3
    range_sigma_m: float = 0.05
    bearing_sigma_rad: float = 0.01

    @classmethod
    def of(cls, config: Mapping[str, object]) -> "Limits":
        """Those of a run's configuration; what it does not tell has its default."""
        given = {name: value for name, value in config.items() if name in cls.__slots__}
        return cls(**given)  # type: ignore[arg-type] # written by ourselves


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """What a log holds about one bundle; None where it has nothing of that kind.

    `landmarks` is the map that was used, `pose` (3,) and `covariance` (3, 3) what was published.
    """

    stamp_ns: int
    scene: SceneObjects | None
    match: LandmarkMatch | None
    landmarks: SceneObjects | None = None
    pose: Array | None = None
    covariance: Array | None = None
    scan_objects: ScanObjects | None = None
    detections: Detections | None = None
    limits: Limits = Limits()


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A candidate: its landmarks, its share of the evidence, and the bundle's own objects fitted to them.

    rows (K,): the object at each landmark, in the scene; residual_m and sigmas (K,): how far off each is, in metres and
    standard deviations. Without a fit (the landmarks were seen in earlier bundles) rows are empty and pose is None.
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
    sigma_deg: float = float("nan")


@dataclass(frozen=True, slots=True)
class Condition:
    """One condition: what was measured, the bound, whether it held, and all that in words."""

    name: str
    value: float
    limit: float
    holds: bool
    words: str


def places_of(situation: Situation) -> tuple[Place, ...]:
    """The candidates, best first: the match itself where there is one, else what was possible."""
    match, scene, landmarks = situation.match, situation.scene, situation.landmarks
    if match is None or scene is None or landmarks is None:
        return ()
    if match.object_ids:
        rows = np.array([scene.ids.index(name) for name in match.object_ids if name in scene.ids], dtype=np.int64)
        share = float(match.candidate_scores[0]) if len(match.candidate_scores) else float("nan")
        choices = rows[None] if len(rows) == len(match.landmark_ids) else np.zeros((0, 0), dtype=np.int64)
        return (_fitted(situation, scene, landmarks, match.landmark_ids, share, choices),)
    places = []
    near = np.sort(np.argsort(np.linalg.norm(scene.positions_xy, axis=1), kind="stable")[:_MOST])
    for name, share in zip(match.candidate_ids, match.candidate_scores.tolist(), strict=True):
        if not name:  # of a place that is known from earlier bundles alone
            continue
        names = tuple(name.split("+"))
        choices = np.array(list(combinations(near.tolist(), len(names))), dtype=np.int64)
        places.append(_fitted(situation, scene, landmarks, names, share, choices))
    return tuple(places)


def _fitted(
    situation: Situation,
    scene: SceneObjects,
    landmarks: SceneObjects,
    names: tuple[str, ...],
    share: float,
    choices: Ints,
) -> Place:
    """Fit each choice of objects (C, K) to the landmarks; the choice that fits best."""
    nothing = Place(names, share, np.zeros(0, dtype=np.int64))
    if len(names) < 2 or not choices.size or any(name not in landmarks.ids for name in names):
        return nothing
    which = [landmarks.ids.index(name) for name in names]
    limits = situation.limits
    spread = known_covariances(scene, limits.range_sigma_m, limits.bearing_sigma_rad)
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
        return nothing
    rows = choices[best]
    miss = transform_points(pose, scene.positions_xy[rows]) - place_xy
    return Place(
        names,
        share,
        rows,
        pose,
        np.linalg.norm(miss, axis=1),
        np.sqrt(np.maximum(solved.observation_chi2[best], 0.0)),
        float(solved.chi2[best]),
        int(solved.dof[best]),
        float(position_sigma(solved.covariance[best])),
        float(np.degrees(np.sqrt(solved.covariance[best, 2, 2]))),
    )


def conditions_of(situation: Situation, places: tuple[Place, ...]) -> tuple[Condition, ...]:
    """The conditions of an accepted match, as far as the log tells what they came to, for the best candidate."""
    match, scene, limits = situation.match, situation.scene, situation.limits
    if match is None or scene is None:
        return ()
    found = [_at_least("objects", float(len(scene)), 2.0, "objects in the bundle")]
    unique = not match.candidate_ids and not match.expected_accidental
    if not unique:
        found.append(_accidental(match, limits))
    if not places or places[0].pose is None:
        return tuple(found)
    best = places[0]
    if best.dof > 0:
        probability = float(chdtrc(best.dof, best.chi2))
        limit = limits.consistency if unique else _SET
        found.append(_at_least("fit", probability, limit, f"probability of chi2 {best.chi2:.1f} at dof {best.dof}"))
    if match.status != Status.AMBIGUOUS:
        least = 2.0 if unique else len(scene) / 2
        found.append(_at_least("matched", float(len(best.rows)), least, f"of {len(scene)} objects are matched"))
    covariance = situation.covariance
    sigma_m = best.sigma_m if covariance is None else float(position_sigma(covariance))
    found.append(_at_most("position", sigma_m, limits.max_sigma_m, "m standard deviation of the position"))
    if match.status != Status.LOCALIZED or covariance is not None:  # else a position without heading, of ranges alone
        sigma_deg = best.sigma_deg if covariance is None else float(np.degrees(np.sqrt(covariance[2, 2])))
        found.append(_at_most("heading", sigma_deg, limits.max_sigma_deg, "degrees standard deviation of the heading"))
    return tuple(found)


def _accidental(match: LandmarkMatch, limits: Limits) -> Condition:
    """Whether the match is none of those to expect by accident."""
    if match.status == Status.NO_MATCH:
        text = "no place of the map explains the objects better than objects that are not in it"
        return Condition("evidence", match.expected_accidental, limits.accidental, holds=False, words=text)
    return _at_most("accidental", match.expected_accidental, limits.accidental, "matches as good expected by accident")


def _at_least(name: str, value: float, limit: float, what: str) -> Condition:
    return Condition(name, value, limit, value >= limit, f"{value:.3g} {what}, at least {limit:g} needed")


def _at_most(name: str, value: float, limit: float, what: str) -> Condition:
    return Condition(name, value, limit, value <= limit, f"{value:.3g} {what}, at most {limit:g} allowed")
