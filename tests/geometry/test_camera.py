"""Cameras: pixels and rays, against OpenCV and back and forth."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.geometry.camera import CameraModel

K = np.array([[530.5, 0.0, 320.0], [0.0, 528.0, 240.0], [0.0, 0.0, 1.0]])
PINHOLE = np.array([-0.28, 0.09, 0.001, -0.0007, -0.012])
RATIONAL = np.array([0.4, -0.2, 0.0004, 0.0002, 0.01, 0.75, -0.15, 0.02])
PRISM = np.array([*PINHOLE, 0.0, 0.0, 0.0, 0.003, -0.0005, -0.002, 0.0004])
TILTED = np.array([*PRISM, 0.03, -0.05])
FISHEYE = np.array([-0.04, 0.003, -0.002, 0.0004])
SIZE = (640, 480)


def points(spread: float) -> np.ndarray:
    rng = np.random.default_rng(1)
    return np.column_stack([rng.uniform(-spread, spread, (200, 2)), rng.uniform(2, 10, 200)])


@pytest.mark.parametrize(
    ("name", "distortion"),
    [
        ("plumb_bob", PINHOLE),
        ("rational_polynomial", RATIONAL),
        ("rational_polynomial", PRISM),
        ("rational_polynomial", TILTED),
        ("", np.zeros(0)),
    ],
)
def test_pixels_are_opencvs(name: str, distortion: np.ndarray) -> None:
    ahead = points(1.0)
    expected = cv2.projectPoints(ahead, np.zeros(3), np.zeros(3), K, distortion if len(distortion) else None)[0][:, 0]
    camera = CameraModel.of(name, SIZE, K, distortion)
    np.testing.assert_allclose(camera.project(ahead), expected, atol=1e-8)


def test_a_fisheyes_pixels_are_opencvs() -> None:
    around = points(4.0)
    expected = cv2.fisheye.projectPoints(around[:, None], np.zeros(3), np.zeros(3), K, FISHEYE)[0][:, 0]
    camera = CameraModel.of("equidistant", SIZE, K, FISHEYE)
    np.testing.assert_allclose(camera.project(around), expected, atol=1e-8)


@given(
    st.floats(0, 640), st.floats(0, 480), st.sampled_from(["plumb_bob", "rational_polynomial", "tilted", "equidistant"])
)
def test_rays_go_through_their_pixels(u: float, v: float, name: str) -> None:
    known = {"plumb_bob": PINHOLE, "rational_polynomial": RATIONAL, "tilted": TILTED, "equidistant": FISHEYE}
    camera = CameraModel.of("rational_polynomial" if name == "tilted" else name, SIZE, K, known[name])
    ray = camera.rays([u, v])
    assert np.linalg.norm(ray) == pytest.approx(1.0)
    np.testing.assert_allclose(camera.project(7 * ray), [u, v], atol=1e-6)


def test_a_fisheye_looks_beyond_a_right_angle_and_a_pinhole_does_not() -> None:
    behind = np.array([1.0, 0.0, -0.1])
    fisheye = CameraModel.of("equidistant", SIZE, K, np.array([0.01]))
    pixel = fisheye.project(behind)
    assert pixel[0] > 320 + 530.5 * np.pi / 2
    np.testing.assert_allclose(fisheye.rays(pixel), behind / np.linalg.norm(behind), atol=1e-9)
    assert np.isnan(CameraModel.of("plumb_bob", SIZE, K, PINHOLE).project(behind)).all()


@pytest.mark.parametrize("name", ["plumb_bob", "equidistant"])
def test_the_axis_is_the_principal_point(name: str) -> None:
    camera = CameraModel.of(name, SIZE, K, np.full(4, 0.01))
    np.testing.assert_allclose(camera.project([0.0, 0.0, 3.0]), [320, 240], atol=1e-12)
    np.testing.assert_allclose(camera.rays([320.0, 240.0]), [0, 0, 1], atol=1e-12)


def test_what_is_no_camera_is_said() -> None:
    with pytest.raises(RecordingError, match="no focal length"):
        CameraModel.of("plumb_bob", SIZE, np.zeros((3, 3)), PINHOLE)
    with pytest.raises(RecordingError, match=r"'omni'.*'equidistant'"):
        CameraModel.of("omni", SIZE, K, PINHOLE)
    with pytest.raises(RecordingError, match="12 coefficients"):
        CameraModel.of("plumb_bob", SIZE, K, np.ones(12))


@pytest.mark.parametrize(
    ("name", "distortion"),
    [("plumb_bob", np.array([-0.4, 0.05])), ("fisheye", np.array([-0.054, -0.078, 0.096, -0.052]))],
)
def test_what_lies_far_outside_is_not_folded_into_the_image(name: str, distortion: np.ndarray) -> None:
    camera = CameraModel.of(name, SIZE, K, distortion)
    angles = np.linspace(0.0, 1.5, 300)
    u = camera.project(np.stack([np.sin(angles), np.zeros(300), np.cos(angles)], axis=-1))[:, 0]
    shown = np.isfinite(u)
    assert 100 < shown.sum() < 300
    assert (np.diff(u[shown]) > 0).all()
    assert not shown[-1]
