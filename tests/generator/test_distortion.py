"""Lenses that bend the image: what CameraInfo says of them is what the pixels and the truth's boxes show."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.geometry.camera import CameraModel
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks_generator.camera import ImageJob
from mcap_landmarks_generator.checks import Staged
from mcap_landmarks_generator.distortion import Lens
from mcap_landmarks_generator.rendering import Photographer
from mcap_landmarks_generator.sensor_specs import CameraSpec

from tests.generator.conftest import StageText
from tests.generator.test_camera import view_from

BARREL = CameraSpec(distortion=(-0.3, 0.1, 0.001, -0.002))
PINCUSHION = CameraSpec(distortion=(0.1, 0.01))
FISHEYE = CameraSpec(distortion_model="equidistant", distortion=(-0.02, 0.003), field_of_view_deg=120.0)
SCENE = """\
objects = [
  { class = "fire hydrant", at = [4.0, 0.0], look = 1 },
  { class = "person", at = [6.0, -2.9], look = 2 },
  { class = "suitcase", at = [5.0, 2.3], yaw_deg = 180, look = 3 },
]
[camera]
width_px = 320
height_px = 240
"""


def taken(staged: Staged, job: ImageJob) -> tuple[CameraInfo, Detections]:
    photographer = Photographer(staged)
    _, info, truth = (stamped.message for stamped in photographer.take(job))
    assert isinstance(info, CameraInfo)
    assert isinstance(truth, Detections)
    return info, truth


def bearings(info: CameraInfo, truth: Detections) -> dict[str, np.ndarray]:
    """Degrees to the right and down of the middles of the boxes' edges, as the toolkit reads CameraInfo."""
    size = (info.width_px, info.height_px)
    camera = CameraModel.of(info.distortion_model, size, info.intrinsics, info.distortion)
    left, top, right, bottom = truth.boxes_xyxy.T
    middle = (left + right) / 2, (top + bottom) / 2
    edges = [(left, middle[1]), (middle[0], top), (right, middle[1]), (middle[0], bottom)]
    rays = [camera.rays(np.stack(edge, axis=-1)) for edge in edges]
    return {
        name: np.rad2deg([np.arctan2(rays[i][k][axis], rays[i][k][2]) for i, axis in enumerate((0, 1, 0, 1))])
        for k, name in enumerate(truth.ids)
    }


@pytest.mark.parametrize("spec", [BARREL, PINCUSHION, FISHEYE])
def test_the_lens_is_the_one_that_camera_info_tells_of(spec: CameraSpec) -> None:
    lens = Lens.of(replace(spec, width_px=64, height_px=48))
    info = lens.info(0, "")
    camera = CameraModel.of(info.distortion_model, (64, 48), info.intrinsics, info.distortion)
    plane = lens.grid(1)
    rays = np.concatenate([plane, np.ones_like(plane[..., :1])], axis=-1)
    pixels = np.stack(np.meshgrid(np.arange(64) + 0.5, np.arange(48) + 0.5), axis=-1)
    assert camera.project(rays) == pytest.approx(pixels, abs=1e-4)
    assert lens.pixels(plane) == pytest.approx(pixels, abs=1e-4)
    projected = cv2.fisheye.projectPoints if spec is FISHEYE else cv2.projectPoints
    points, still = rays.reshape(-1, 1, 3), np.zeros(3)
    assert projected(points, still, still, info.intrinsics, info.distortion)[0].reshape(48, 64, 2) == pytest.approx(
        pixels, abs=1e-4
    )
    half_deg = np.rad2deg(np.arctan(lens.plane(np.array([[0.0, 24.0], [64.0, 24.0]]))[:, 0]))
    assert half_deg[1] - half_deg[0] == pytest.approx(spec.field_of_view_deg, abs=0.1)


@pytest.mark.parametrize(
    "bent",
    [
        "distortion = [-0.3, 0.1, 0.001, -0.002]\n",
        'distortion_model = "equidistant"\ndistortion = [-0.02, 0.003]\nfield_of_view_deg = 100\n',
    ],
)
def test_boxes_lie_in_the_bent_image_where_a_pinhole_has_them_in_the_world(stage_text: StageText, bent: str) -> None:
    job = ImageJob(0, 0, 0, view_from(0.0, 0.0, 0.0), 0.0)
    plain = taken(stage_text(SCENE), job)
    lens = taken(stage_text(SCENE + bent), job)
    straight, through = bearings(*plain), bearings(*lens)
    assert set(through) == set(straight) == {"fire_hydrant_1", "person_1", "suitcase_1"}
    assert np.abs(lens[1].boxes_xyxy - plain[1].boxes_xyxy).max() > 3
    for name, edges in through.items():
        assert edges == pytest.approx(straight[name], abs=0.45)  # a pixel and a half of the wider view


def test_an_object_that_the_bent_image_cuts_shows_less_than_all(stage_text: StageText) -> None:
    job = ImageJob(0, 0, 0, view_from(0.0, 0.0, -4.5), 0.0)
    cut = 'distortion_model = "equidistant"\ndistortion = [-0.02, 0.003]\n'
    _, truth = taken(stage_text(SCENE + cut), job)
    shares = {name: options[0][1] for name, options in zip(truth.ids, truth.hypotheses, strict=True)}
    assert shares["fire_hydrant_1"] == 1.0
    assert 0.1 < shares["suitcase_1"] < 0.9


@pytest.mark.parametrize(
    ("bent", "said"),
    [
        ("distortion = [-0.5]", "it folds the image back before its corners"),
        ('distortion_model = "equidistant"', "equidistant has k1 to k4, and one of them must not be zero"),
        ("distortion = [1, 2, 3, 4, 5, 6]", "camera.distortion"),
    ],
)
def test_lenses_that_cannot_be_are_refused(stage_text: StageText, bent: str, said: str) -> None:
    with pytest.raises(ToolkitError, match=said):
        stage_text(SCENE + bent + "\n")
