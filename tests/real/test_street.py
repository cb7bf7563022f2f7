"""A street of parked cars (KITTI), mapped in every other frame: cars are where they stand, the other frames too."""

from pathlib import Path

import numpy as np
import pytest

from tests.real.street import NEAR_M, THERE_M, Street, drive_street


@pytest.fixture(scope="module")
def street(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Street:
    if not ((shared_data / "roads").is_dir() and (shared_data / "models" / "yolov5n-coco.onnx").exists()):
        pytest.skip("no roads or no yolov5n-coco.onnx in the folder of data")
    return drive_street(shared_data, tmp_path_factory.mktemp("street"))


def test_parked_cars_are_landmarks_where_they_stand(street: Street) -> None:
    assert len(street.cars_off_m) == 14
    assert np.count_nonzero(street.cars_off_m <= NEAR_M) >= 10


def test_no_landmark_stands_where_nothing_does(street: Street) -> None:
    assert street.landmarks_off_m.max() < 2.0


def test_the_frames_between_are_localized_as_surely_as_they_say(street: Street) -> None:
    assert np.count_nonzero(street.poses_off_m <= THERE_M) >= 0.8 * street.frames
    assert np.mean(street.poses_nees) / 3 <= 2.0
