"""Of every box that is no object of a cloud's scene it is said why, as far as a log tells."""

import numpy as np
import pytest
from mcap_landmarks.fusion.camera_view import CameraView
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.messages.boxes import Boxes
from mcap_landmarks.report.box_outcomes import LostBox, corners_of, edges_in_image, lost_boxes

from tests.fusion.test_cloud_fuser import BASE_FROM_CAMERA, CAMERA, CAR, PERSON, Told, clustered, detections, fused
from tests.lidar.clouds import Solid

VIEW = CameraView.at(CAMERA, BASE_FROM_CAMERA, np.zeros(3), 0.0)
FAR = Solid(70.0, 2.0, 4.2, 1.7, 1.5)
WALL = Solid(40.0, 0.0, 0.5, 60.0, 4.0)


def lost(told: list[Told], solids: list[Solid], config: FuseConfig | None = None) -> tuple[LostBox, ...]:
    scene, _ = fused(told, solids)
    return lost_boxes(detections(told), scene, clustered(solids), VIEW, config or FuseConfig())


def test_boxes_that_are_objects_are_not_lost() -> None:
    assert lost([("car", 0.8, CAR), ("person", 0.7, PERSON)], [CAR, PERSON]) == ()


@pytest.mark.parametrize(
    ("name", "score", "solid", "reason"),
    [
        ("car", 0.9, FAR, "the LiDAR meets nothing of it, and the image tells its range less surely than to 3 m"),
        ("car", 0.3, Solid(8.0, 5.0, 4.0, 1.7, 1.5), "points fit no car well enough for a probability of 0.5"),
    ],
)
def test_what_neither_sensor_tells_and_what_fits_nothing(name: str, score: float, solid: Solid, reason: str) -> None:
    (one,) = lost([("car", 0.8, CAR), (name, score, solid)], [CAR, WALL] if score < 0.5 else [CAR])
    assert (one.name, one.score) == (name, score)
    assert one.reason.endswith(reason)
    np.testing.assert_allclose(one.box_xyxy, detections([(name, score, solid)]).boxes_xyxy[0])


def test_a_box_whose_points_are_of_another_object() -> None:
    told: list[Told] = [("car", 0.8, CAR), ("suitcase", 0.7, CAR)]
    scene, _ = fused(told[:1], [CAR])
    (one,) = lost_boxes(detections(told), scene, clustered([CAR]), VIEW, FuseConfig())
    assert (one.name, one.reason) == ("suitcase", f"most of its points are of object {scene.ids[0]}")


def test_what_the_settings_leave_out() -> None:
    told: list[Told] = [("car", 0.8, CAR), ("person", 0.7, PERSON)]
    (one,) = lost(told, [CAR, PERSON], FuseConfig(landmark_classes=("car",)))
    assert (one.name, one.reason) == ("person", "it is no landmark by the settings")


def test_a_box_lies_as_its_yaw_says_and_shows_only_before_the_camera() -> None:
    boxes = Boxes(np.array([[10.0, 2.0, 1.0]] * 2), np.array([[4.0, 2.0, 1.0]] * 2), np.array([0.0, np.pi / 2]))
    along, across = corners_of(boxes, 0), corners_of(boxes, 1)
    np.testing.assert_allclose([along.min(axis=0), along.max(axis=0)], [[8, 1, 0.5], [12, 3, 1.5]])
    np.testing.assert_allclose([across.min(axis=0), across.max(axis=0)], [[9, 0, 0.5], [11, 4, 1.5]])
    beside = Boxes(np.array([[0.3, 2.0, 1.0]]), boxes.sizes_m[:1], boxes.yaws_rad[:1])
    assert np.isfinite(edges_in_image(VIEW, boxes, 0)).all()
    seen = np.isfinite(edges_in_image(VIEW, beside, 0)).all(axis=2)
    assert 0 < seen.sum() < seen.size
