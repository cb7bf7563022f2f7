"""Where every class stands for one landmark: pairs by class, outliers dropped, what cannot be is refused."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.errors import MapError
from mcap_landmarks.estimation.polar import points_from_polar
from mcap_landmarks.geometry.se2 import Array, inverse, transform_points
from mcap_landmarks.localization.class_association import pairs_by_class, unique_classes
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.correspondences import Correspondences, Problem
from mcap_landmarks.localization.match import Match
from mcap_landmarks.localization.unique_classes import UniqueClassLocalizer
from mcap_landmarks.messages.match import Status
from mcap_landmarks.messages.scene import SceneObjects

from tests.localization.small_worlds import landmark_map, seen

LANDMARKS = np.array([[6.0, 1.0], [5.0, 4.0], [8.0, -2.0], [3.0, -3.0], [-4.0, 2.0]])
NAMES = tuple(f"tag {i}" for i in range(5))
WORLD = landmark_map(LANDMARKS, NAMES)
POSE = np.array([1.0, 0.5, 0.3])
CONFIG = LocalizeConfig(calibrate=False)


def locate(*scenes: SceneObjects, config: LocalizeConfig = CONFIG) -> list[Match]:
    return UniqueClassLocalizer(WORLD, config).locate(scenes)


def test_pairs_are_of_classes_seen_once() -> None:
    rows, landmarks = pairs_by_class(["a", "b", "c", "b", "d"], {"a": 7, "b": 8, "d": 9})
    np.testing.assert_array_equal(rows, [0, 4])
    np.testing.assert_array_equal(landmarks, [7, 9])
    twice = landmark_map(LANDMARKS, ("a", "b", "a", "c", "d"))
    tentative = replace(twice, tentative=np.array([False, False, True, False, True]))
    assert unique_classes(twice) == {"b": 1, "c": 3, "d": 4}
    assert unique_classes(tentative) == {"a": 0, "b": 1, "c": 3}


def test_an_exact_bundle_gives_the_exact_pose() -> None:
    (match,) = locate(seen(WORLD, POSE, range(5)))
    assert match.message.status is Status.LOCALIZED
    assert match.pose == pytest.approx(POSE, abs=1e-9)
    assert match.message.landmark_ids == ("l0", "l1", "l2", "l3", "l4")
    assert (match.message.dof, match.message.chi2) == (7, pytest.approx(0.0, abs=1e-9))


def test_an_outlier_among_many_is_dropped() -> None:
    off = np.zeros((5, 2))
    off[1] = [1.0, -1.0]
    (match,) = locate(seen(WORLD, POSE, range(5), off))
    assert match.message.status is Status.LOCALIZED
    assert match.message.landmark_ids == ("l0", "l2", "l3", "l4")
    assert match.message.object_ids == ("0", "2", "3", "4")
    assert match.pose == pytest.approx(POSE, abs=1e-9)


def test_of_two_that_do_not_fit_none_can_be_dropped() -> None:
    (match,) = locate(seen(WORLD, POSE, range(2), [[1.0, 0], [0, 0]]))
    assert match.message.status is Status.INCONSISTENT
    assert match.pose is None
    assert match.message.object_ids == ("0", "1")


@pytest.mark.parametrize(("consistency", "status"), [(1e-3, Status.LOCALIZED), (0.5, Status.INCONSISTENT)])
def test_how_well_a_set_must_fit_is_a_setting(consistency: float, status: Status) -> None:
    """The two are 2 sigma farther apart than in the map: chi-square 4 / 2 at one degree."""
    points = transform_points(inverse(POSE), LANDMARKS[:2])
    along = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
    config = replace(CONFIG, consistency=consistency)
    (match,) = locate(seen(WORLD, POSE, range(2), [[0, 0], 0.06 * along]), config=config)
    assert match.message.status is status
    assert match.message.chi2 == pytest.approx(2.0, rel=0.01)


def test_too_little_is_refused_each_for_its_reason() -> None:
    found = locate(
        seen(WORLD, POSE, range(1)),
        seen(WORLD, POSE, range(3), classes=("tag 0", "tag 0", "tag 0")),
        seen(WORLD, POSE, range(2), classes=("tag 0", "cat")),
        seen(WORLD, POSE, []),
        seen(WORLD, POSE, range(2)),
    )
    assert [match.message.status for match in found] == [
        Status.TOO_FEW_OBJECTS,
        Status.TOO_FEW_OBJECTS,
        Status.NO_MATCH,
        Status.TOO_FEW_OBJECTS,
        Status.LOCALIZED,
    ]
    assert UniqueClassLocalizer(WORLD, CONFIG).locate([]) == []


def test_depths_are_told_from_distances() -> None:
    """A camera that gives the distance along its axis: the first bundles tell, and later ones are corrected."""
    rng, ahead = np.random.default_rng(4), landmark_map([[7.0, 2.5], [6.0, -2.0], [9.0, 1.0], [8.0, -3.0]], NAMES[:4])
    scenes, poses = [], [rng.uniform([-0.5, -0.5, -0.1], [0.5, 0.5, 0.1]) for _ in range(40)]
    for pose in poses:
        points = transform_points(inverse(pose), ahead.positions_xy)
        distance, bearing = np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])
        xy, spread = points_from_polar(distance * np.cos(bearing), bearing, np.diag([0.02**2, 0.005**2]))
        scenes.append(replace(seen(ahead, pose, range(4)), positions_xy=xy, covariances=spread))
    localizer = UniqueClassLocalizer(ahead, LocalizeConfig())
    localizer.locate(scenes[:30])
    for match, pose in zip(localizer.locate(scenes[30:]), poses[30:], strict=True):
        assert match.pose == pytest.approx(pose, abs=0.02)
        assert match.message.residual_m.max() < 0.03
    plain = UniqueClassLocalizer(ahead, CONFIG).locate(scenes[30:])
    assert Status.LOCALIZED not in {match.message.status for match in plain}


def test_maps_and_logs_in_different_units_are_told() -> None:
    far = replace(WORLD, positions_xy=1000 * LANDMARKS)
    scenes = [seen(WORLD, POSE, range(5))] * 2
    with pytest.raises(MapError, match="landmarks of the map lie 1e\\+03 times as far apart"):
        UniqueClassLocalizer(far, CONFIG).locate(scenes)


def polar_scene(pose: Array, sigmas: list[float], rows: range) -> SceneObjects:
    points = transform_points(inverse(pose), LANDMARKS[list(rows)])
    polar = np.diag(np.square(sigmas))
    xy, spread = points_from_polar(np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0]), polar)
    return replace(seen(WORLD, pose, rows), positions_xy=xy, covariances=spread)


RANGES, BEARINGS, BOTH = [0.03, 3.0], [1000.0, 0.005], [0.03, 0.005]


def test_what_the_covariances_leave_open_tells_ranges_and_bearings_alone() -> None:
    scenes = [polar_scene(POSE, sigmas, range(3)) for sigmas in (RANGES, BEARINGS, BOTH)]
    mixed = scenes[0].covariances.copy()
    mixed[0] = scenes[2].covariances[0]
    scenes.append(replace(scenes[0], covariances=mixed))
    problems = [Problem.of(scene, unique_classes(WORLD)) for scene in scenes]
    pairs = Correspondences.of(problems, WORLD, CONFIG)
    np.testing.assert_array_equal(pairs.ranges_alone(), [True, False, False, False])
    np.testing.assert_array_equal(pairs.bearings_alone(), [False, True, False, False])


def test_ranges_alone_give_a_position_and_no_heading() -> None:
    (match,) = locate(polar_scene(POSE, RANGES, range(5)))
    assert match.message.status is Status.LOCALIZED
    assert match.covariance is None
    assert match.pose is not None
    np.testing.assert_allclose(match.pose, [*POSE[:2], 0.0], atol=1e-6)
    assert match.message.candidate_ids == ()
    np.testing.assert_allclose(match.message.residual_m, np.zeros(5), atol=1e-6)


def test_ranges_to_landmarks_in_line_leave_a_mirror_image() -> None:
    line = landmark_map([[-6.0, 2.0], [0.0, 2.0], [5.0, 2.0]], NAMES[:3])
    points = transform_points(inverse(POSE), line.positions_xy)
    xy, spread = points_from_polar(np.hypot(*points.T), np.zeros(3), np.diag(np.square(RANGES)))
    scene = replace(seen(line, POSE, range(3)), positions_xy=xy, covariances=spread)
    (match,) = UniqueClassLocalizer(line, CONFIG).locate([scene])
    assert match.message.status is Status.AMBIGUOUS
    assert set(match.message.candidate_ids) == {"x 1.000 m, y 0.500 m", "x 1.000 m, y 3.500 m"}
    assert match.message.expected_accidental == pytest.approx(1.0, abs=1e-6)


def test_ranges_that_do_not_fit_are_refused() -> None:
    scene = polar_scene(POSE, RANGES, range(5))
    off = scene.positions_xy * np.array([1, 1, 1, 1, 1.5])[:, None]
    (match,) = locate(replace(scene, positions_xy=off))
    assert match.message.status is Status.INCONSISTENT


def test_bearings_alone_give_a_pose() -> None:
    (match,) = locate(polar_scene(POSE, BEARINGS, range(5)))
    assert match.pose == pytest.approx(POSE, abs=1e-6)
    assert match.covariance is not None
    # The angle that 5 mrad leave at a few metres.
    assert 0.005 < np.sqrt(match.covariance[0, 0]) < 0.05


def test_an_outlier_among_bearings_is_dropped_while_three_are_left() -> None:
    scene = polar_scene(POSE, BEARINGS, range(5))
    turned = transform_points(np.array([0.0, 0.0, 0.3]), scene.positions_xy[:1])
    (match,) = locate(replace(scene, positions_xy=np.concatenate([turned, scene.positions_xy[1:]])))
    assert match.message.landmark_ids == ("l1", "l2", "l3", "l4")
    assert match.pose == pytest.approx(POSE, abs=1e-6)


@pytest.mark.parametrize("sigmas", [RANGES, BEARINGS])
def test_two_ranges_or_bearings_are_too_few(sigmas: list[float]) -> None:
    (match,) = locate(polar_scene(POSE, sigmas, range(2)))
    assert match.message.status is Status.TOO_FEW_OBJECTS


@pytest.mark.parametrize(("sigmas", "status"), [(2.9, Status.LOCALIZED), (3.1, Status.AMBIGUOUS)])
def test_mirror_images_within_three_sigmas_are_one_position(sigmas: float, status: Status) -> None:
    """Just beside the line of landmarks, both sides of it are the same."""
    line = landmark_map([[-6.0, 0.0], [0.5, 0.0], [5.0, 0.0]], NAMES[:3])
    # The sigma across the line grows as the robot nears it, and the mirror image is twice as far.
    height = 1.0
    for _ in range(30):
        away = line.positions_xy - np.array([1.0, height])
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        height = sigmas / 2 * np.sqrt(np.linalg.eigvalsh(np.linalg.inv(away.T @ away / 0.3**2))[-1])
    points = line.positions_xy - np.array([1.0, height])
    xy, spread = points_from_polar(np.hypot(*points.T), np.zeros(3), np.diag([0.3**2, 3.0**2]))
    scene = replace(seen(line, POSE, range(3)), positions_xy=xy, covariances=spread)
    (match,) = UniqueClassLocalizer(line, replace(CONFIG, max_sigma_m=5.0)).locate([scene])
    assert match.message.status is status
