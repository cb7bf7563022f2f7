"""CameraInfo as that of its images: binning and regions as ROS defines them, and what drivers make of them."""

from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.fusion.camera_info import in_image
from mcap_landmarks.fusion.camera_view import camera_from_info
from mcap_landmarks.messages.images import CameraInfo, Region

K = np.array([[1060.0, 0, 650], [0, 1056, 470], [0, 0, 1]])
FULL = CameraInfo(
    1, "camera", 960, 1280, "plumb_bob", np.array([-0.2, 0.05, 0, 0, 0]), K, np.eye(3), np.hstack([K, np.zeros((3, 1))])
)
BINNED = replace(FULL, binning=(2, 2))
PART = replace(FULL, region=Region(200, 100, 800, 600))


def test_what_is_of_the_whole_sensor_stays_as_it_is() -> None:
    assert in_image(FULL) is FULL
    assert in_image(FULL, (1280, 960)) is FULL


@pytest.mark.parametrize("image_px", [None, (640, 480)])
def test_binned_pixels_are_so_many_of_the_sensors(image_px: tuple[int, int] | None) -> None:
    found = in_image(BINNED, image_px)
    assert (found.width_px, found.height_px, found.binning) == (640, 480, (0, 0))
    np.testing.assert_allclose(found.intrinsics, [[530, 0, 325], [0, 528, 235], [0, 0, 1]])
    np.testing.assert_allclose(found.projection[:, :3], found.intrinsics)
    assert in_image(found, image_px) is found


def test_a_region_is_binned_from_where_it_begins() -> None:
    found = in_image(replace(PART, binning=(4, 2)), (200, 300))
    np.testing.assert_allclose(found.intrinsics, [[265, 0, 112.5], [0, 528, 185], [0, 0, 1]])
    assert (found.width_px, found.height_px, found.region) == (200, 300, Region())


def test_an_image_of_the_size_that_is_told_is_taken_as_it_is() -> None:
    for info in (BINNED, replace(PART, width_px=800, height_px=600)):
        found = in_image(info, (info.width_px, info.height_px))
        np.testing.assert_array_equal(found.intrinsics, K)
        assert (found.binning, found.region) == ((0, 0), Region())


def test_what_is_left_over_at_the_edge_may_be_a_pixel_or_none() -> None:
    odd = replace(BINNED, width_px=1281, height_px=961)
    assert [in_image(odd, size).width_px for size in ((640, 480), (641, 481))] == [640, 641]


@pytest.mark.parametrize(
    ("info", "image_px", "words"),
    [
        (FULL, (640, 480), r"of 1280 x 960 pixels, but the images are of 640 x 480; .*--image TOPIC"),
        (BINNED, (320, 240), r"of which binning 2 x 2 leaves 640 x 480, but the images are of 320 x 240"),
        (PART, (1280, 720), r"a region of 800 x 600 at 200, 100, but the images are of 1280 x 720"),
        (replace(PART, width_px=900), None, "its region does not lie within"),
        (replace(FULL, width_px=0, height_px=0), (640, 480), "says no size, and its principal point 650, 470"),
    ],
)
def test_other_sizes_are_refused_with_both(info: CameraInfo, image_px: tuple[int, int] | None, words: str) -> None:
    with pytest.raises(RecordingError, match=words):
        in_image(info, image_px)


def test_without_a_size_the_principal_point_tells_whether_it_fits() -> None:
    unset = replace(FULL, width_px=0, height_px=0)
    assert in_image(unset, (1280, 960)).width_px == 1280
    assert camera_from_info(unset, rectified=None).size_px == (1300, 940)


def test_rectified_images_have_p_and_no_distortion() -> None:
    info = replace(FULL, projection=np.hstack([K / 2, np.zeros((3, 1))]), of_rectified=True)
    assert not camera_from_info(info, rectified=None).distortion.any()
    assert camera_from_info(info, rectified=None).intrinsics[0, 0] == 530
    assert camera_from_info(info, rectified=False).distortion.any()
    assert camera_from_info(replace(info, of_rectified=False), rectified=None).distortion.any()
    with pytest.raises(RecordingError, match=r"no P.*fuse\.rectified=false"):
        camera_from_info(replace(info, projection=np.zeros((3, 4))), rectified=None)
