"""KITTI frames, stock YOLOv5n and whole clouds: what is detected becomes objects where the labels say."""

from pathlib import Path

import numpy as np
import pytest

from tests.real import roads
from tests.real.roads_judge import Judged, judge_frames

HELD_BACK = tuple(number for number in roads.SINGLE if number not in roads.DEVELOPED_ON)
SINGLE, STREET = "kitti_object", "kitti_tracking_0001"


@pytest.fixture(scope="module")
def folder(shared_data: Path) -> Path:
    """The development set beside the network."""
    if not ((shared_data / "roads").is_dir() and (shared_data / "models" / "yolov5n-coco.onnx").exists()):
        pytest.skip("no roads or no yolov5n-coco.onnx in the folder of data")
    return shared_data / "roads"


@pytest.fixture(scope="module", params=["developed on", "held back"])
def single(folder: Path, request: pytest.FixtureRequest) -> Judged:
    numbers = roads.DEVELOPED_ON if request.param == "developed on" else HELD_BACK
    return judge_frames(folder.parent, roads.single_frames(folder / SINGLE, numbers))


@pytest.fixture(scope="module")
def street(folder: Path) -> Judged:
    return judge_frames(folder.parent, roads.drive_frames(folder / STREET, roads.DRIVE[1::6]))


def test_detected_objects_become_objects_where_they_are(single: Judged) -> None:
    assert len(single.errors_m) >= 0.85 * len(single.cases)
    assert np.median(single.errors_m) <= 0.25
    assert single.within(0.5) >= 0.7 * len(single.cases)


def test_hardly_anything_stands_where_nothing_does(single: Judged) -> None:
    assert len(single.wrong) <= 0.2 * single.objects


def test_covariances_say_how_far_off_objects_are(single: Judged) -> None:
    assert 0.5 <= single.nees / 2 <= 2.0


def test_nothing_near_is_lost(single: Judged) -> None:
    near = single.between(0.0, 20.0)
    assert len(near.errors_m) == len(near.cases)


def test_parked_cars_are_found_along_a_street(street: Judged) -> None:
    assert len(street.cases) > 20
    assert len(street.errors_m) >= 0.85 * len(street.cases)
    assert np.median(street.errors_m) <= 0.3
    assert len(street.wrong) <= 0.2 * street.objects
