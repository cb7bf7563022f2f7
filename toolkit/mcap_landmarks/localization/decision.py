"""Whether a pose is accepted, for every way to localize: the conditions, and the status that follows from them.

Nothing else decides. Each condition that was looked at is written into the log, so that it can be read there why a
bundle was localized or not.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri

from mcap_landmarks.estimation.pose import position_sigma
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.messages.match import Condition, Status

Array = NDArray[np.float64]

LEAST_OF_ONE_KIND = 3
"""Objects that a position from ranges or bearings alone needs: two leave a mirror image, or a circle."""
_TRIPLE = 3  # objects of a group in the thesis
_MATCHED_SHARE = 0.5  # a bundle of which most does not fit was seen elsewhere, or the map has changed


@dataclass(frozen=True, slots=True)
class Rule:
    """What is asked of a bundle: the status of those that fail it, and what its value is, in words."""

    name: str
    failing: Status
    words: str
    at_most: bool = False

    def asked(self, value: float, limit: float) -> Condition:
        """The condition on one bundle: a value that is no number fails."""
        held = value <= limit if self.at_most else value >= limit
        return Condition(self.name, float(value), float(limit), bool(held))

    def told(self, condition: Condition) -> str:
        """The condition in words."""
        bound = f"at most {condition.limit:.4g} allowed" if self.at_most else f"at least {condition.limit:.4g} needed"
        return f"{condition.value:.3g} {self.words}, {bound}"


OBJECTS = Rule("objects", Status.TOO_FEW_OBJECTS, "objects in the bundle")
CLASSES = Rule("distinct_classes", Status.TOO_FEW_OBJECTS, "different classes in the bundle")
RANGES = Rule("ranges", Status.TOO_FEW_OBJECTS, "ranges to landmarks, without bearings")
BEARINGS = Rule("bearings", Status.TOO_FEW_OBJECTS, "bearings to landmarks, without ranges")
SURPLUS = Rule("surplus_objects", Status.NO_MATCH, "objects beside the three of a group", at_most=True)
GROUPS = Rule("groups", Status.NO_MATCH, "groups of the map have these classes in this order")
PLACES = Rule("places", Status.NO_MATCH, "places of the map where objects fit")
EVIDENCE = Rule("log_evidence", Status.NO_MATCH, "log odds of all places against objects that the map does not know")
ACCIDENTAL = Rule("expected_accidental", Status.AMBIGUOUS, "matches as good expected by accident", at_most=True)
MATCHED = Rule("matched_objects", Status.NO_MATCH, "objects matched to landmarks")
SHARE = Rule("matched_share", Status.INCONSISTENT, "of the objects whose class the map knows are matched")
CHI2 = Rule("chi2", Status.INCONSISTENT, "sum of squared normalised residuals", at_most=True)
CONVERGED = Rule("converged", Status.WEAK_GEOMETRY, "(1 where the solver converged)")
POSITION = Rule("position_sigma_m", Status.WEAK_GEOMETRY, "m largest standard deviation of the position", at_most=True)
HEADING = Rule("heading_sigma_deg", Status.WEAK_GEOMETRY, "degrees standard deviation of the heading", at_most=True)
MIRROR = Rule("mirror_odds", Status.AMBIGUOUS, "odds of the mirror image against the position", at_most=True)

RULES = {
    rule.name: rule
    for rule in (
        OBJECTS,
        CLASSES,
        RANGES,
        BEARINGS,
        SURPLUS,
        GROUPS,
        PLACES,
        EVIDENCE,
        ACCIDENTAL,
        MATCHED,
        SHARE,
        CHI2,
        CONVERGED,
        POSITION,
        HEADING,
        MIRROR,
    )
}


@dataclass(frozen=True, slots=True)
class Decision:
    """The conditions of one bundle; of those that do not hold the first one tells the status."""

    conditions: tuple[Condition, ...]

    @property
    def status(self) -> Status:
        """Localized if and only if all conditions hold."""
        return next((RULES[one.name].failing for one in self.conditions if not one.held), Status.LOCALIZED)

    @property
    def holds(self) -> bool:
        """Whether all conditions do, of those that were looked at by now."""
        return self.status == Status.LOCALIZED


def told(condition: Condition) -> str:
    """A condition in words; those that another version of this program asks have none here."""
    rule = RULES.get(condition.name)
    return rule.told(condition) if rule else f"{condition.value:.3g}, with a limit of {condition.limit:.4g}"


def is_accident(expected_accidental: float, config: LocalizeConfig) -> bool:
    """Whether a place may be one of those that fit by accident."""
    return not ACCIDENTAL.asked(expected_accidental, config.accidental).held


def of_unknown_place(objects: int) -> Decision:
    """Where classes repeat: no place was found at which anything fits."""
    return Decision((OBJECTS.asked(objects, 2), PLACES.asked(0, 1)))


def of_places(
    objects: int, places: int, log_evidence: float, expected_accidental: float, config: LocalizeConfig
) -> Decision:
    """Where classes repeat: places were found, none of which can be told from an accident."""
    asked = OBJECTS.asked(objects, 2), PLACES.asked(places, 1), EVIDENCE.asked(log_evidence, 0.0)
    return Decision((*asked, ACCIDENTAL.asked(expected_accidental, config.accidental)))


def of_place(
    objects: int, known: int, matched: int, expected_accidental: float, covariance: Array, config: LocalizeConfig
) -> Decision:
    """Where classes repeat: a place was found, or tracked, at which so many objects are matched.

    `known` are the objects whose class the map has, `covariance` (3, 3) is that of the pose.
    """
    asked = [OBJECTS.asked(objects, 2), ACCIDENTAL.asked(expected_accidental, config.accidental)]
    asked.append(MATCHED.asked(matched, 1))
    if known:
        asked.append(SHARE.asked(matched / known, _MATCHED_SHARE))
    return Decision((*asked, *_of_geometry(covariance, config)))


def of_classes(classes: Sequence[str], matched: int) -> Decision:
    """Where every class stands for one landmark: what a bundle must have before a pose is looked for."""
    return Decision((CLASSES.asked(len(set(classes)), 2), MATCHED.asked(matched, 2)))


def of_one_kind(before: Decision, rule: Rule, count: int) -> Decision:
    """The same of a bundle of `RANGES` or `BEARINGS` alone."""
    return Decision((*before.conditions, rule.asked(count, LEAST_OF_ONE_KIND)))


def of_pose(
    before: Decision, chi2: float, chi2_limit: float, covariance: Array, config: LocalizeConfig, *, converged: bool
) -> Decision:
    """Where every class stands for one landmark: the pose that was found, with covariance (3, 3)."""
    asked = CHI2.asked(chi2, chi2_limit), CONVERGED.asked(converged, 1)
    return Decision((*before.conditions, *asked, *_of_geometry(covariance, config)))


def of_position(
    before: Decision, chi2: float, chi2_limit: float, sigma_m: float, mirror_odds: float, config: LocalizeConfig
) -> Decision:
    """Of ranges alone: the position that was found, and how likely its mirror image is beside it."""
    asked = CHI2.asked(chi2, chi2_limit), POSITION.asked(sigma_m, config.max_sigma_m)
    return Decision((*before.conditions, *asked, MIRROR.asked(mirror_odds, config.accidental)))


def of_triple(objects: int, groups: int | None = None) -> Decision:
    """As in the thesis: exactly three objects, of the classes of a group; `groups` is None where that was not asked."""
    asked = OBJECTS.asked(objects, _TRIPLE), SURPLUS.asked(objects - _TRIPLE, 0)
    return Decision(asked if groups is None else (*asked, GROUPS.asked(groups, 1)))


def chi2_limits(dof: ArrayLike, config: LocalizeConfig) -> Array:
    """The largest chi-square (...) of degrees (...) that fits: `consistency` of all sets of objects lie beyond it."""
    return np.asarray(chdtri(np.maximum(dof, 1), config.consistency), dtype=np.float64)


def _of_geometry(covariance: Array, config: LocalizeConfig) -> tuple[Condition, Condition]:
    finite = bool(np.isfinite(covariance).all())
    sigma_m = float(position_sigma(covariance)) if finite else np.inf
    sigma_deg = float(np.degrees(np.sqrt(covariance[2, 2]))) if finite else np.inf
    return POSITION.asked(sigma_m, config.max_sigma_m), HEADING.asked(sigma_deg, config.max_sigma_deg)
