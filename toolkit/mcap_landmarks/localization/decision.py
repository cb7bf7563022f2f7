"""What is said of one bundle after matching: accepted with a pose, or refused with the candidates."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from mcap_landmarks.estimation.pose import position_sigma
from mcap_landmarks.geometry import se2
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.verification import UNMATCHED, Fits
from mcap_landmarks.messages.match import LandmarkMatch, Status
from mcap_landmarks.messages.scene import SceneObjects

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_LISTED = 5


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """What came of one bundle, and where it was localized its pose map_from_base (3,) and covariance (3, 3)."""

    message: LandmarkMatch
    pose: Array | None = None
    covariance: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Distinct places where a set of objects may have been seen, best first, and how likely the best is an accident."""

    fits: Fits
    expected_accidental: float

    def scores(self) -> Array:
        """Share of each place in the evidence, that for an unknown place included."""
        log_ratio = self.fits.log_ratio
        shares: Array = np.exp(log_ratio - logsumexp(np.append(log_ratio, 0.0)))
        return shares


@dataclass(frozen=True, slots=True, eq=False)
class Fix:
    """A pose map_from_base (3,) that was accepted, its covariance (3, 3) in the base frame, and how well it fits.

    `landmarks` (K,) has the landmark that each object of the bundle shows, or `UNMATCHED`.
    """

    pose: Array
    covariance: Array
    landmarks: Ints
    expected_accidental: float
    chi2: float
    dof: int


def refused(scene: SceneObjects, index: MapIndex, places: Places | None, joined: int = 1) -> Match:
    """A bundle of which it is not clear where it was seen."""
    status = Status.AMBIGUOUS
    if len(scene) < 2:
        status = Status.TOO_FEW_OBJECTS
    elif places is None or logsumexp(places.fits.log_ratio) < 0:
        status = Status.NO_MATCH
    shown = np.zeros((0, 0), dtype=np.int64) if places is None else places.fits.candidates.landmarks[:_LISTED]
    message = LandmarkMatch(
        scene.stamp_ns,
        scene.frame_id,
        status,
        candidate_ids=tuple(place_name(index, landmarks) for landmarks in shown),
        candidate_scores=np.zeros(0) if places is None else places.scores()[:_LISTED],
        expected_accidental=float(len(index)) if places is None else places.expected_accidental,
        bundles_joined=joined,
    )
    return Match(message)


def accepted(
    scene: SceneObjects,
    rows: Ints,
    points_xy: Array,
    index: MapIndex,
    fix: Fix,
    config: LocalizeConfig,
    joined: int = 1,
) -> Match:
    """A bundle that was seen from a known pose, unless a limit says no; `rows` (K,) are its objects in the scene."""
    turn = np.eye(3)
    turn[:2, :2] = se2.rotation(fix.pose[2])
    covariance = turn @ fix.covariance @ turn.T
    matched = np.flatnonzero(fix.landmarks != UNMATCHED)
    landmarks = fix.landmarks[matched]
    status = Status.LOCALIZED
    if len(scene) < 2:
        status = Status.TOO_FEW_OBJECTS
    elif fix.expected_accidental > config.accidental:
        status = Status.AMBIGUOUS
    elif not len(matched):
        status = Status.NO_MATCH
    elif 2 * len(matched) < len(rows):
        status = Status.INCONSISTENT
    elif position_sigma(covariance) > config.max_sigma_m:
        status = Status.WEAK_GEOMETRY
    miss = se2.transform_points(fix.pose, points_xy[matched]) - index.positions_xy[landmarks]
    message = LandmarkMatch(
        scene.stamp_ns,
        scene.frame_id,
        status,
        tuple(scene.ids[i] for i in rows[matched]),
        tuple(index.landmark_map.ids[index.rows[i]] for i in landmarks),
        np.linalg.norm(miss, axis=1),
        (place_name(index, fix.landmarks),),
        np.array([1 / (1 + fix.expected_accidental)]),
        fix.expected_accidental,
        fix.chi2,
        fix.dof,
        joined,
    )
    return Match(message, fix.pose, covariance) if status == Status.LOCALIZED else Match(message)


def place_name(index: MapIndex, landmarks: Ints) -> str:
    """The ids of a place's landmarks, the first few, joined by plus signs."""
    shown = landmarks[landmarks != UNMATCHED][:_LISTED]
    return "+".join(index.landmark_map.ids[index.rows[i]] for i in shown)
