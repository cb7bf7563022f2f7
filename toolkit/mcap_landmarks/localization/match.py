"""What comes of one bundle: the place that was found with its pose, or those that it may have been seen from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from mcap_landmarks.geometry import se2
from mcap_landmarks.localization import decision
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.verification import UNMATCHED, Fits
from mcap_landmarks.messages.match import LandmarkMatch, Status
from mcap_landmarks.messages.scene import SceneObjects

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Places, and landmarks of a place, that a message lists: enough for an explanation.
_LISTED = 5


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """What came of one bundle, and where it was localized its pose map_from_base (3,) and covariance (3, 3)."""

    message: LandmarkMatch
    pose: Array | None = None
    covariance: Array | None = None

    @classmethod
    def of(cls, message: LandmarkMatch, pose: Array, covariance: Array | None = None) -> "Match":
        """With the pose that was found, unless it was refused: a failure never gets a pose."""
        return cls(message, pose, covariance) if message.status == Status.LOCALIZED else cls(message)


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Distinct places where a set of objects may have been seen, best first, and how likely the best is an accident."""

    fits: Fits
    expected_accidental: float

    @property
    def log_evidence(self) -> float:
        """Logarithm of the evidence for any of the places against that for an unknown one."""
        return float(logsumexp(self.fits.log_ratio))

    def scores(self) -> Array:
        """Share of each place in the evidence, that for an unknown place included."""
        log_ratio = self.fits.log_ratio
        shares: Array = np.exp(log_ratio - logsumexp(np.append(log_ratio, 0.0)))
        return shares


@dataclass(frozen=True, slots=True, eq=False)
class Fix:
    """A pose map_from_base (3,) that was found, its covariance (3, 3) in the base frame, and how well it fits.

    `landmarks` (K,) has the landmark that each object of the bundle shows, or `UNMATCHED`.
    """

    pose: Array
    covariance: Array
    landmarks: Ints
    expected_accidental: float
    chi2: float
    dof: int


def without_place(
    scene: SceneObjects, index: MapIndex, places: Places | None, config: LocalizeConfig, bundles: int = 1
) -> Match:
    """The match of a bundle of which it is not clear where it was seen: it lists the places that are possible.

    `bundles`: how many it was matched together with, itself included.
    """
    count = len(scene)
    if places is None:
        made = decision.of_unknown_place(count)
        return Match(
            LandmarkMatch(
                scene.stamp_ns,
                scene.frame_id,
                made.status,
                expected_accidental=float(len(index)),
                bundles_joined=bundles,
                conditions=made.conditions,
            )
        )
    expected = places.expected_accidental
    made = decision.of_places(count, len(places.fits.dof), places.log_evidence, expected, config)
    shown = places.fits.candidates.landmarks[:_LISTED]
    message = LandmarkMatch(
        scene.stamp_ns,
        scene.frame_id,
        made.status,
        candidate_ids=tuple(place_name(index, landmarks) for landmarks in shown),
        candidate_scores=places.scores()[:_LISTED],
        expected_accidental=expected,
        bundles_joined=bundles,
        conditions=made.conditions,
    )
    return Match(message)


def at_place(
    scene: SceneObjects,
    rows: Ints,
    points_xy: Array,
    index: MapIndex,
    fix: Fix,
    config: LocalizeConfig,
    bundles: int = 1,
) -> Match:
    """The match of a bundle that was seen from a known place; `rows` (K,) are its objects in the scene."""
    turn = np.eye(3)
    turn[:2, :2] = se2.rotation(fix.pose[2])
    covariance = turn @ fix.covariance @ turn.T
    matched = np.flatnonzero(fix.landmarks != UNMATCHED)
    landmarks = fix.landmarks[matched]
    made = decision.of_place(len(scene), len(rows), len(matched), fix.expected_accidental, covariance, config)
    miss = se2.transform_points(fix.pose, points_xy[matched]) - index.positions_xy[landmarks]
    message = LandmarkMatch(
        scene.stamp_ns,
        scene.frame_id,
        made.status,
        tuple(scene.ids[i] for i in rows[matched]),
        tuple(index.landmark_map.ids[index.rows[i]] for i in landmarks),
        np.linalg.norm(miss, axis=1),
        (place_name(index, fix.landmarks),),
        np.array([1 / (1 + fix.expected_accidental)]),
        fix.expected_accidental,
        fix.chi2,
        fix.dof,
        bundles,
        made.conditions,
    )
    return Match.of(message, fix.pose, covariance)


def place_name(index: MapIndex, landmarks: Ints) -> str:
    """The ids of a place's landmarks, the first few, with plus signs between."""
    shown = landmarks[landmarks != UNMATCHED][:_LISTED]
    return "+".join(index.landmark_map.ids[index.rows[i]] for i in shown)
