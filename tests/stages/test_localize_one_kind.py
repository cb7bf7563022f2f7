"""Logs of ranges alone or of bearings alone: what the covariances leave open is left open."""

from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import MATCH, POSE, POSE_COVARIANCE, SCENE_OBJECTS
from mcap_landmarks.estimation.polar import points_from_polar
from mcap_landmarks.geometry.se2 import Array, inverse, transform_points
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.maps.model import LandmarkMap, MapSource
from mcap_landmarks.messages.match import LandmarkMatch, Status
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import Bundle, Stamped
from mcap_landmarks.stages.localize import LocalizeConfig, process

from tests.estimation.worlds import nees, pose_errors

AROUND = np.array([[8.0, 1.0], [3.0, 9.0], [-7.0, 6.0], [-8.0, -5.0], [2.0, -9.0]])
IN_LINE = np.array([[-6.0, 2.0], [0.0, 2.0], [5.0, 2.0], [9.0, 2.0]])
RANGE_SIGMA_M, BEARING_SIGMA_RAD = 0.03, 0.005
OPEN_RAD, OPEN_M = np.pi, 1000.0


def poses(count: int) -> Array:
    return np.random.default_rng(3).uniform([-4, -4, -np.pi], [4, 1, np.pi], (count, 3))


def scene(number: int, pose: Array, landmarks: Array, rng: np.random.Generator, *, ranges: bool) -> SceneObjects:
    """What a radio that tells distances, or a camera that tells directions, would write of all landmarks."""
    points = transform_points(inverse(pose), landmarks)
    range_m, bearing = np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])
    count = len(landmarks)
    if ranges:
        range_m, bearing = range_m + rng.normal(0, RANGE_SIGMA_M, count), np.zeros(count)
    else:
        range_m, bearing = np.ones(count), bearing + rng.normal(0, BEARING_SIGMA_RAD, count)
    spread = np.diag([RANGE_SIGMA_M**2, OPEN_RAD**2] if ranges else [OPEN_M**2, BEARING_SIGMA_RAD**2])
    xy, covariances = points_from_polar(range_m, bearing, spread)
    names = tuple(f"l{i}" for i in range(count))
    return SceneObjects(number, "base", names, tuple(((n, 1.0),) for n in names), xy, covariances, np.zeros(count))


def located(folder: Path, landmarks: Array, count: int, *, ranges: bool) -> list[Stamped]:
    names = tuple(f"l{i}" for i in range(len(landmarks)))
    write_map(folder / "map.db", LandmarkMap.surveyed(names, names, landmarks, MapSource("import", "test")))
    rng = np.random.default_rng(5)
    scenes = [scene(i + 1, pose, landmarks, rng, ranges=ranges) for i, pose in enumerate(poses(count))]
    bundles = [Bundle(seen.stamp_ns, seen.stamp_ns, {SCENE_OBJECTS: seen}, None) for seen in scenes]
    return list(process(bundles, LocalizeConfig(), {"map": folder / "map.db"}))


def of(found: list[Stamped], channel: object) -> list[object]:
    return [stamped.message for stamped in found if stamped.channel == channel]


def matches(found: list[Stamped]) -> list[LandmarkMatch]:
    return [message for message in of(found, MATCH) if isinstance(message, LandmarkMatch)]


def test_ranges_give_positions_without_heading(tmp_path: Path) -> None:
    found = located(tmp_path, AROUND, 60, ranges=True)
    assert sum(match.status == Status.LOCALIZED for match in matches(found)) >= 59
    assert not of(found, POSE_COVARIANCE)
    at = [stamped for stamped in found if stamped.channel == POSE]
    truth = poses(60)[[stamped.log_time_ns - 1 for stamped in at]]
    estimate = np.array([stamped.message.position_m[:2] for stamped in at])
    assert np.linalg.norm(estimate - truth[:, :2], axis=1).max() < 5 * RANGE_SIGMA_M
    assert all(not stamped.message.orientation_xyzw.any() for stamped in at)


def test_ranges_to_landmarks_in_line_leave_two_positions(tmp_path: Path) -> None:
    found = matches(located(tmp_path, IN_LINE, 30, ranges=True))
    twofold = [match for match in found if match.status == Status.AMBIGUOUS]
    assert len(twofold) >= 25
    assert all(match.status != Status.LOCALIZED for match in found)
    for match in twofold:
        assert len(match.candidate_ids) == 2
        assert match.candidate_scores == pytest.approx([0.5, 0.5], abs=1e-3)
    x, y, _ = poses(30)[twofold[0].stamp_ns - 1]
    shown = [[float(word) for word in name.split() if word[0] in "-0123456789"] for name in twofold[0].candidate_ids]
    assert min(np.linalg.norm(np.array(shown) - [x, y], axis=1)) < 5 * RANGE_SIGMA_M
    assert min(np.linalg.norm(np.array(shown) - [x, 4 - y], axis=1)) < 5 * RANGE_SIGMA_M


def test_bearings_give_poses_with_honest_covariance(tmp_path: Path) -> None:
    found = located(tmp_path, AROUND, 300, ranges=False)
    fixed = [stamped for stamped in found if stamped.channel == POSE_COVARIANCE]
    assert len(fixed) >= 295
    truth = poses(300)[[stamped.log_time_ns - 1 for stamped in fixed]]
    estimate = np.array([stamped.message.pose for stamped in fixed])
    covariance = np.array([stamped.message.planar_covariance for stamped in fixed])
    assert 0.85 < nees(pose_errors(estimate, truth), covariance) < 1.15


@pytest.mark.parametrize("ranges", [True, False])
def test_two_are_too_few(tmp_path: Path, ranges: bool) -> None:
    found = matches(located(tmp_path, AROUND[:2], 5, ranges=ranges))
    assert {match.status for match in found} == {Status.TOO_FEW_OBJECTS}


def test_one_circle_with_all_landmarks_is_weak(tmp_path: Path) -> None:
    angle = np.array([0.3, 1.9, 4.0])
    x, y, _ = poses(1)[0]
    circle = np.array([x, y]) + 5 * np.array([1.0, 0.0]) + 5 * np.column_stack([np.cos(angle), np.sin(angle)])
    (match,) = matches(located(tmp_path, circle, 1, ranges=False))
    assert match.status == Status.WEAK_GEOMETRY
