"""The thesis's scenarios against its appendices."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks_generator.bundled import FOLDER
from mcap_landmarks_generator.loading import load_scenario

_DATA = Path(__file__).parents[1] / "data"
_HIGHEST_BEARING_DEG = 31.1


def appendix(name: str) -> list[list[Any]]:
    lines = (_DATA / f"thesis_appendix_{name}.txt").read_text().splitlines()
    return [json.loads(line[line.index("[") :].replace("'", '"')) for line in lines if "[" in line]


def test_the_map_s_world_is_appendix_c() -> None:
    scenario = load_scenario("thesis_map").scenario
    rows = appendix("c")
    expected = [(name, x, y) for row in rows for name, x, y in row[:3]]
    assert [(spec.class_name, *spec.at) for spec in scenario.objects] == expected
    stops = scenario.trajectory.waypoints
    assert [point.at for point in stops] == [tuple(row[3][1:3]) for row in rows]
    headings = [np.deg2rad(point.heading_deg) for point in stops if point.heading_deg is not None]
    assert headings == pytest.approx([row[3][3] for row in rows], abs=1e-5)
    assert {point.stop_s for point in stops} == {3.0}
    assert (scenario.odometry.source, scenario.camera.when) == ("world", "stops")
    assert {spec.variant for spec in scenario.objects} == {""}, "a person in a long coat is seen from 15 m"


def test_the_second_log_stops_at_appendix_d_and_faces_the_groups() -> None:
    scenario = load_scenario("thesis_localize").scenario
    stops = scenario.trajectory.waypoints
    assert [point.at for point in stops] == [tuple(row[1]) for row in appendix("d")]
    for point, row in zip(stops, appendix("c"), strict=True):
        away = np.array([spec[1:3] for spec in row[:3]]) - point.at
        bearings = wrap(np.arctan2(away[:, 1], away[:, 0]) - np.deg2rad(point.heading_deg or 0.0))
        assert bearings.max() == pytest.approx(-bearings.min(), abs=1e-5)
        assert np.rad2deg(bearings.max()) < _HIGHEST_BEARING_DEG


@pytest.mark.parametrize("name", ["thesis_map", "thesis_localize"])
def test_with_drift_the_world_is_the_same(name: str) -> None:
    plain, drifting = load_scenario(name).scenario, load_scenario(f"{name}_drift").scenario
    assert drifting.objects == plain.objects
    assert drifting.odometry.source == "encoders"
    assert (drifting.odometry.distance_slip, drifting.odometry.heading_slip_deg) == (0.02, 0.5)


def test_the_second_drifting_log_is_the_same_drive() -> None:
    plain, drifting = (load_scenario(name).scenario for name in ("thesis_localize", "thesis_localize_drift"))
    assert (drifting.trajectory, drifting.camera) == (plain.trajectory, plain.camera)


def test_the_drifting_map_has_the_same_stops_and_closes_its_loop() -> None:
    plain, drifting = load_scenario("thesis_map").scenario, load_scenario("thesis_map_drift").scenario
    way = drifting.trajectory.waypoints
    assert tuple(point for point in way if point.is_stop) == plain.trajectory.waypoints
    points = np.array([point.at for point in way])
    assert np.hypot(*np.diff(points, axis=0).T).sum() == pytest.approx(530, abs=5)
    again = points[[i for i, point in enumerate(way) if not point.is_stop]]
    for group in (1, 5, 6, 7, 14, 16):
        first = np.array(plain.trajectory.waypoints[group - 1].at)
        assert np.linalg.norm(again - first, axis=1).min() < 3.0, f"group {group} is passed once only"


def test_the_loop_comes_back_after_340_m() -> None:
    scenario = load_scenario("loop").scenario
    points = np.array([point.at for point in scenario.trajectory.waypoints])
    assert np.hypot(*np.diff(points, axis=0).T).sum() == pytest.approx(340, abs=5)
    assert points[0] == pytest.approx(points[-1])
    assert (FOLDER / "loop.toml").read_text().startswith('extends = "thesis_map"')
