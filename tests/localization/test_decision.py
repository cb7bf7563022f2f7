"""What is asked before a pose is accepted, and the status of what fails: one table for every way to localize."""

from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.localization import decision
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.decision import Decision, told
from mcap_landmarks.messages.match import Condition, Status

from tests.localization.logs import bundles, localized, matches, unique_classes
from tests.stages.test_localize_one_kind import AROUND, IN_LINE, located
from tests.stages.test_localize_one_kind import matches as matches_of
from tests.stages.worlds import ring

CONFIG = LocalizeConfig()
SURE = np.diag([0.1**2, 0.1**2, 0.01**2])
VAGUE_PLACE, VAGUE_HEADING = np.diag([0.6**2, 0.1**2, 0.01**2]), np.diag([0.1**2, 0.1**2, 0.2**2])
OPEN, HALF_OPEN = np.diag([np.inf, np.inf, np.inf]), np.diag([np.inf, 0.1**2, 0.01**2])


@pytest.mark.parametrize(
    ("case", "status", "failing"),
    [
        ((4, 4, 2, 1e-9, SURE), Status.LOCALIZED, []),
        ((1, 1, 1, 1e-9, SURE), Status.TOO_FEW_OBJECTS, ["objects"]),
        ((4, 4, 4, 3e-3, SURE), Status.AMBIGUOUS, ["expected_accidental"]),
        ((4, 4, 0, 1e-9, SURE), Status.NO_MATCH, ["matched_objects", "matched_share"]),
        ((4, 0, 0, 1e-9, SURE), Status.NO_MATCH, ["matched_objects"]),
        ((9, 7, 3, 1e-9, SURE), Status.INCONSISTENT, ["matched_share"]),
        ((9, 6, 3, 1e-9, SURE), Status.LOCALIZED, []),
        ((4, 4, 4, 1e-9, VAGUE_PLACE), Status.WEAK_GEOMETRY, ["position_sigma_m"]),
        ((4, 4, 4, 1e-9, VAGUE_HEADING), Status.WEAK_GEOMETRY, ["heading_sigma_deg"]),
        ((4, 4, 4, 1e-9, OPEN), Status.WEAK_GEOMETRY, ["position_sigma_m", "heading_sigma_deg"]),
        ((4, 4, 4, 1e-9, HALF_OPEN), Status.WEAK_GEOMETRY, ["position_sigma_m", "heading_sigma_deg"]),
        (
            (1, 1, 1, 1.0, OPEN),
            Status.TOO_FEW_OBJECTS,
            ["objects", "expected_accidental", "position_sigma_m", "heading_sigma_deg"],
        ),
    ],
)
def test_a_place_where_classes_repeat(case: tuple, status: Status, failing: list[str]) -> None:
    made = decision.of_place(*case, CONFIG)
    assert made.status is status
    assert [one.name for one in made.conditions if not one.held] == failing


@pytest.mark.parametrize(
    ("made", "status"),
    [
        (decision.of_unknown_place(1), Status.TOO_FEW_OBJECTS),
        (decision.of_unknown_place(3), Status.NO_MATCH),
        (decision.of_places(3, 2, -0.1, 5.0, CONFIG), Status.NO_MATCH),
        (decision.of_places(3, 2, 0.1, 5.0, CONFIG), Status.AMBIGUOUS),
    ],
)
def test_places_none_of_which_is_sure(made: Decision, status: Status) -> None:
    assert made.status is status
    assert not made.holds


BEFORE = decision.of_classes(["a", "b", "c"], 3)


@pytest.mark.parametrize(
    ("made", "status"),
    [
        (decision.of_classes(["a", "a", "a"], 0), Status.TOO_FEW_OBJECTS),
        (decision.of_classes(["a", "b"], 1), Status.NO_MATCH),
        (decision.of_one_kind(decision.of_classes(["a", "b"], 2), decision.RANGES, 2), Status.TOO_FEW_OBJECTS),
        (decision.of_one_kind(BEFORE, decision.BEARINGS, 3), Status.LOCALIZED),
        (decision.of_pose(BEFORE, 16.0, 16.3, SURE, CONFIG, converged=True), Status.LOCALIZED),
        (decision.of_pose(BEFORE, 16.4, 16.3, OPEN, CONFIG, converged=False), Status.INCONSISTENT),
        (decision.of_pose(BEFORE, np.nan, 16.3, SURE, CONFIG, converged=True), Status.INCONSISTENT),
        (decision.of_pose(BEFORE, 16.0, 16.3, SURE, CONFIG, converged=False), Status.WEAK_GEOMETRY),
        (decision.of_pose(BEFORE, 16.0, 16.3, OPEN, CONFIG, converged=True), Status.WEAK_GEOMETRY),
        (decision.of_position(BEFORE, 1.0, 10.8, 0.1, 1e-3, CONFIG), Status.LOCALIZED),
        (decision.of_position(BEFORE, 11.0, 10.8, 0.6, 1.0, CONFIG), Status.INCONSISTENT),
        (decision.of_position(BEFORE, 1.0, 10.8, 0.6, 1.0, CONFIG), Status.WEAK_GEOMETRY),
        (decision.of_position(BEFORE, 1.0, 10.8, 0.1, 1.0, CONFIG), Status.AMBIGUOUS),
        (decision.of_triple(2), Status.TOO_FEW_OBJECTS),
        (decision.of_triple(4), Status.NO_MATCH),
        (decision.of_triple(3, 0), Status.NO_MATCH),
        (decision.of_triple(3, 1), Status.LOCALIZED),
    ],
)
def test_where_every_class_stands_for_one_landmark(made: Decision, status: Status) -> None:
    assert made.status is status
    assert made.holds is (status is Status.LOCALIZED)


def test_the_limits_are_those_of_the_configuration() -> None:
    config = LocalizeConfig(accidental=0.5, max_sigma_m=2.0, max_sigma_deg=20.0)
    made = decision.of_place(4, 4, 4, 0.4, np.diag([1.0, 1.0, 0.3**2]), config)
    assert {one.name: one.limit for one in made.conditions} == {
        "objects": 2,
        "expected_accidental": 0.5,
        "matched_objects": 1,
        "matched_share": 0.5,
        "position_sigma_m": 2.0,
        "heading_sigma_deg": 20.0,
    }
    assert made.holds
    assert decision.is_accident(0.6, config)
    assert not decision.is_accident(0.5, config)
    assert decision.chi2_limits([0, 1, 3], CONFIG) == pytest.approx([10.828, 10.828, 16.266], abs=1e-3)


def test_conditions_in_words() -> None:
    assert told(Condition("objects", 1.0, 2.0, held=False)) == "1 objects in the bundle, at least 2 needed"
    text = "0.123 m largest standard deviation of the position, at most 0.5 allowed"
    assert told(Condition("position_sigma_m", 0.1234, 0.5, held=True)) == text
    assert told(Condition("of tomorrow", 0.1234, 0.5, held=True)) == "0.123, with a limit of 0.5"


@pytest.mark.parametrize("unique", [True, False])
@pytest.mark.parametrize(
    ("config", "expected"),
    [
        (LocalizeConfig(), {Status.LOCALIZED, Status.TOO_FEW_OBJECTS}),
        (LocalizeConfig(max_sigma_m=0.03, max_sigma_deg=0.3), {Status.WEAK_GEOMETRY}),
        (LocalizeConfig(join_m=0.0), {Status.LOCALIZED}),
        (LocalizeConfig(method="thesis"), {Status.TOO_FEW_OBJECTS, Status.NO_MATCH}),
    ],
)
def test_localized_is_what_meets_all_conditions(
    unique: bool, config: LocalizeConfig, expected: set[Status], tmp_path: Path
) -> None:
    world = unique_classes() if unique else ring()
    results = localized(tmp_path, *world, bundles(*world), config)
    found = list(matches(results))
    assert expected <= {match.status for match in found}
    for match in found:
        assert match.conditions
        assert (match.status is Status.LOCALIZED) is all(one.held for one in match.conditions)
        assert match.status is Decision(match.conditions).status
    published = {entry.log_time_ns for entry in results if entry.channel.topic == "/landmarks/pose"}
    assert published == {match.stamp_ns for match in found if match.status is Status.LOCALIZED}


@pytest.mark.parametrize("ranges", [True, False])
def test_the_same_of_ranges_or_bearings_alone(ranges: bool, tmp_path: Path) -> None:
    for landmarks in (AROUND, IN_LINE, AROUND[:2]):
        for match in matches_of(located(tmp_path, landmarks, 12, ranges=ranges)):
            assert (match.status is Status.LOCALIZED) is all(one.held for one in match.conditions)
            assert {"ranges" if ranges else "bearings"} < {one.name for one in match.conditions}
