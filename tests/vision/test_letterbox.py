"""Letterboxes: where pixels go, and how boxes come back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_landmarks.vision.letterbox import Colours, fit, fitted_input, tensor

sides = st.integers(2, 2000)


def test_the_usual_camera() -> None:
    assert fitted_input((480, 640), 640, 32) == (480, 640)
    assert fitted_input((1080, 1920), 640, 32) == (384, 640)
    box = fit((480, 640), (640, 640))
    assert (box.width_px, box.height_px, box.left_px, box.top_px) == (640, 480, 0, 80)
    box = fit((1080, 1920), (384, 640))
    assert (box.width_px, box.height_px, box.left_px, box.top_px) == (640, 360, 0, 12)


@given(sides, sides, st.sampled_from([320, 640, 1280]), st.sampled_from([32, 64]))
def test_a_fitted_input_holds_the_image(height: int, width: int, size: int, stride: int) -> None:
    found = fitted_input((height, width), size, stride)
    box = fit((height, width), found)
    assert all(side % stride == 0 for side in found)
    assert max(found) == size
    assert 0 <= box.left_px <= found[1] - box.width_px
    assert 0 <= box.top_px <= found[0] - box.height_px
    assert max(box.width_px, box.height_px) == size


@given(sides, sides, st.floats(0, 1), st.floats(0, 1))
def test_boxes_come_back(height: int, width: int, across: float, down: float) -> None:
    box = fit((height, width), (480, 640))
    corner = np.array([width * across, height * down])
    inside = corner * (box.width_px / width, box.height_px / height) + (box.left_px, box.top_px)
    found = box.in_image(np.array([[*inside, *inside]], dtype=np.float32))[0]
    np.testing.assert_allclose(found, [*corner, *corner], atol=1e-3 * max(height, width))


def test_boxes_end_at_the_border() -> None:
    box = fit((100, 200), (640, 640))
    assert box.in_image(np.array([[-50, -50, 700, 700]], np.float32)).tolist() == [[0, 0, 200, 100]]


def test_the_tensor_has_the_image_in_grey_margins() -> None:
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (48, 64, 3), dtype=np.uint8)
    box = fit((48, 64), (64, 64))
    found = tensor(image, box, (64, 64), np.dtype(np.float32), Colours())
    assert found.shape == (1, 3, 64, 64)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found[0, :, 8:56], image.transpose(2, 0, 1) / 255, atol=1e-7)
    margins = np.delete(found, np.s_[8:56], axis=2)
    assert np.unique(margins).tolist() == [np.float32(114 / 255)]


def test_half_precision() -> None:
    image = np.full((64, 64, 3), 51, np.uint8)
    found = tensor(image, fit((64, 64), (64, 64)), (64, 64), np.dtype(np.float16), Colours())
    assert found.dtype == np.float16
    assert np.unique(found).tolist() == [np.float16(0.2)]


def test_an_image_is_scaled() -> None:
    image = np.zeros((20, 20, 3), np.uint8)
    image[:, 10:, 0] = 255
    found = tensor(image, fit((20, 20), (64, 64)), (64, 64), np.dtype(np.float32), Colours())
    assert found[0, 0, :, :28].max() == 0
    assert found[0, 0, :, 36:].min() == 1
    assert found[0, 1:].max() == 0


@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_colours_in_another_order_less_a_mean(dtype: type[np.floating]) -> None:
    image = np.tile(np.array([200, 100, 50], np.uint8), (32, 64, 1))
    blue_first = Colours("bgr", (103.53, 116.28, 123.675), (57.375, 57.12, 58.395), padding=0)
    found = tensor(image, fit((32, 64), (64, 64)), (64, 64), np.dtype(dtype), blue_first)
    assert found.dtype == dtype
    exact = np.finfo(dtype).eps * 2
    for channel, (value, mean, std) in enumerate(zip((50, 100, 200), blue_first.mean, blue_first.std, strict=True)):
        np.testing.assert_allclose(found[0, channel, 16:48], (value - mean) / std, rtol=exact)
        np.testing.assert_allclose(found[0, channel, :16], -mean / std, rtol=exact)
