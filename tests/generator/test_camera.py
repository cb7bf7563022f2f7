"""Images and their truth: boxes lie where CameraInfo and extrinsics project the objects, and shares are right."""

import cv2
import numpy as np
import pytest
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks_generator.camera import Viewpoint
from mcap_landmarks_generator.checks import Staged, stage
from mcap_landmarks_generator.distortion import Lens
from mcap_landmarks_generator.loading import load_scenario
from mcap_landmarks_generator.optics import Optics
from mcap_landmarks_generator.renderer import Renderer
from mcap_landmarks_generator.robot import BASE_FROM_OPTICAL, CAMERA_IN_BASE_M, OPTICAL_FRAME
from mcap_landmarks_generator.sensor_specs import CameraSpec
from mcap_landmarks_generator.simulation import static_transforms
from mcap_landmarks_generator.visibility import true_detections
from numpy.typing import NDArray

from tests.generator.conftest import StageText

Floats = NDArray[np.float64]

SCENE = """\
objects = [
  { class = "fire hydrant", at = [4.0, 0.0], look = 1 },
  { class = "person", at = [8.0, -2.0], look = 2 },
  { class = "suitcase", at = [9.0, 3.6], yaw_deg = 180, look = 3 },
  { class = "stop sign", variant = "post", at = [6.0, 1.8], yaw_deg = 180, look = 4 },
  { class = "barrel", at = [12.0, 0.5] },
  { class = "sports ball", at = [40.0, 1.0], look = 5 },
]
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> tuple[Staged, Renderer]:
    path = tmp_path_factory.mktemp("scene") / "scene.toml"
    path.write_text(SCENE)
    staged = stage(load_scenario(str(path)))
    return staged, Renderer(staged.scenario, staged.objects)


def view_from(x: float, y: float, heading_deg: float) -> Viewpoint:
    c, s = np.cos(np.deg2rad(heading_deg)), np.sin(np.deg2rad(heading_deg))
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Viewpoint(turn @ CAMERA_IN_BASE_M + [x, y, 0.0], turn @ BASE_FROM_OPTICAL, 0.0)


def detections_from(scene: tuple[Staged, Renderer], view: Viewpoint) -> dict[str, tuple[Floats, float]]:
    """Box and visible share by object id."""
    found: Detections = true_detections(scene[1].draw(view), scene[1], view, 0)
    shares = [options[0][1] for options in found.hypotheses]
    return dict(zip(found.ids, zip(found.boxes_xyxy, shares, strict=True), strict=True))


def optical_from_base() -> tuple[Floats, Floats]:
    """Rotation and translation chained from /tf_static, as a reader of the recording would."""
    message = static_transforms(0).message
    assert isinstance(message, TFMessage)
    by_child = {transform.child_frame_id: transform for transform in message.transforms}
    rotation, position, frame = np.eye(3), np.zeros(3), "camera_rgb_optical_frame"
    while frame != "base_footprint":
        step = by_child[frame]
        x, y, z, w = step.rotation_xyzw
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        rotation, position, frame = turn @ rotation, turn @ position + step.translation_m, step.frame_id
    return rotation.T, -rotation.T @ position


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (1.0, 0.5, 8.0), (2.0, -1.0, 15.0), (0.0, 2.0, -20.0)])
def test_boxes_contain_the_projected_centres(scene: tuple[Staged, Renderer], pose: tuple[float, float, float]) -> None:
    """Through CameraInfo and /tf_static; a sign's centre is that of the sign without its post."""
    staged = scene[0]
    matrix = Lens.of(staged.scenario.camera).info(0, "").intrinsics
    rotation, offset = optical_from_base()
    found = detections_from(scene, view_from(*pose))
    c, s = np.cos(np.deg2rad(pose[2])), np.sin(np.deg2rad(pose[2]))
    whole = 0
    for placed in staged.objects:
        if placed.object_id not in found or found[placed.object_id][1] < 1.0:
            continue
        labelled = np.concatenate([part.vertices for part in placed.asset.parts if part.labelled])
        x, y = placed.route_xy[0] - np.array(pose[:2])
        height = (labelled[:, 2].min() + labelled[:, 2].max()) / 2
        pixel = matrix @ (rotation @ np.array([c * x + s * y, -s * x + c * y, height]) + offset)
        box = found[placed.object_id][0]
        u, v = pixel[:2] / pixel[2]
        assert box[0] < u < box[2]
        assert box[1] < v < box[3]
        whole += 1
    assert whole >= 2


def test_a_disc_s_box_is_centred_on_its_projection(scene: tuple[Staged, Renderer]) -> None:
    """Half a pixel off would show here: boxes, CameraInfo and renderer agree where pixels lie."""
    found = detections_from(scene, view_from(0.0, 0.0, 0.0))
    box = found["fire_hydrant_1"][0]
    centre = (box[0] + box[2]) / 2
    mirrored = detections_from(scene, view_from(8.0, 0.0, 180.0))["fire_hydrant_1"][0]
    assert (centre + (mirrored[0] + mirrored[2]) / 2) / 2 == pytest.approx(320.0, abs=0.5)


def test_only_landmarks_in_reach_are_in_the_truth(scene: tuple[Staged, Renderer]) -> None:
    found = detections_from(scene, view_from(0.0, 0.0, 0.0))
    assert set(found) == {"fire_hydrant_1", "person_1", "suitcase_1", "stop_sign_1"}
    assert all(share == 1.0 for _, share in found.values())


@pytest.mark.slow
def test_the_visible_share_counts_what_hides_and_what_cuts(scene: tuple[Staged, Renderer]) -> None:
    head_only = detections_from(scene, view_from(0.0, 2.0, -26.5))
    assert head_only["fire_hydrant_1"][1] == 1.0
    assert 0.05 < head_only["person_1"][1] < 0.2
    assert 0.6 < detections_from(scene, view_from(0.0, 1.5, -22.0))["person_1"][1] < 0.9
    cut = detections_from(scene, view_from(3.0, -0.4, 10.0))
    assert cut["fire_hydrant_1"][1] < 1.0
    assert cut["fire_hydrant_1"][0][1] >= 0.0


def test_a_picture_does_not_depend_on_what_was_drawn_before(scene: tuple[Staged, Renderer]) -> None:
    view = view_from(0.0, 0.0, 0.0)
    first = scene[1].draw(view).image
    scene[1].draw(view_from(5.0, 0.0, 180.0))
    assert np.array_equal(scene[1].draw(view).image, first)


def test_an_empty_view_is_sky_above_ground(scene: tuple[Staged, Renderer]) -> None:
    rendered = scene[1].draw(view_from(0.0, 0.0, 180.0))
    assert rendered.visible == ()
    assert rendered.image.shape == (480, 640, 3)
    assert rendered.image[:200].std() < rendered.image.std() + 60
    assert not np.array_equal(rendered.image[100], rendered.image[400])


def test_the_camera_is_the_turtlebot_s() -> None:
    info = Lens.of(CameraSpec()).info(5, OPTICAL_FRAME)
    assert (info.width_px, info.height_px, info.frame_id) == (640, 480, "camera_rgb_optical_frame")
    assert info.intrinsics[0, 0] == pytest.approx(530.5, abs=0.1)
    rotation, offset = optical_from_base()
    assert -rotation.T @ offset == pytest.approx([0.076, 0.0, 0.103], abs=1e-9)
    assert -rotation.T @ offset == pytest.approx(CAMERA_IN_BASE_M)
    assert pytest.approx(BASE_FROM_OPTICAL, abs=1e-12) == rotation.T


def test_noise_blur_and_exposure_do_what_they_say() -> None:
    grey = np.full((120, 160, 3), 100, np.uint8)
    spec = CameraSpec(width_px=160, height_px=120, noise=4.0, exposure=1.2, exposure_jitter=0.0)
    taken = Optics(spec, 100.0, 1).expose(grey, 0, 0.0)
    assert taken.mean() == pytest.approx(120.0, abs=0.5)
    assert taken.std() == pytest.approx(4.0, rel=0.1)
    again, other = Optics(spec, 100.0, 1).expose(grey, 0, 0.0), Optics(spec, 100.0, 1).expose(grey, 1, 0.0)
    assert np.array_equal(again, taken)
    assert not np.array_equal(other, taken)


def test_a_turn_smears_sideways() -> None:
    edge = np.zeros((40, 80, 3), np.uint8)
    edge[:, 40:] = 200
    spec = CameraSpec(width_px=80, height_px=40, noise=0.0, exposure_jitter=0.0, blur_px=0.0, exposure_s=0.01)
    still = Optics(spec, 500.0, 0).expose(edge, 0, 0.0)
    turning = Optics(spec, 500.0, 0).expose(edge, 0, 1.6)
    assert np.array_equal(still, edge)
    assert np.count_nonzero((turning[20, :, 0] > 5) & (turning[20, :, 0] < 195)) == pytest.approx(8, abs=1)


def test_jpeg_is_read_back(scene: tuple[Staged, Renderer]) -> None:
    image = scene[1].draw(view_from(0.0, 0.0, 0.0)).image
    data = Optics(CameraSpec(jpeg_quality=95), 530.0, 0).jpeg(image)
    read = cv2.cvtColor(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    assert np.abs(read.astype(int) - image.astype(int)).mean() < 4


@pytest.mark.slow
def test_objects_that_walk_are_seen_where_they_are(stage_text: StageText) -> None:
    staged = stage_text(
        'objects = [ { class = "person", variant = "legs", at = [6.0, 2.0], walk = [[6.0, -2.0]], speed_mps = 1.0 } ]\n'
    )
    start = view_from(0.0, 0.0, 0.0)
    renderer = Renderer(staged.scenario, staged.objects)
    centres = []
    for time_s in (0.0, 1.0, 4.0, 6.0):
        view = Viewpoint(start.eye_m, start.world_from_optical, time_s)
        box = true_detections(renderer.draw(view), renderer, view, 0).boxes_xyxy[0]
        centres.append((box[0] + box[2]) / 2)
    expected = 320 - 530.5 * np.array([2.0, 1.0, -2.0, 0.0]) / (6.0 - CAMERA_IN_BASE_M[0])
    assert centres == pytest.approx(expected, abs=12)


def test_the_lens_takes_light_from_corners_and_behind_dirt() -> None:
    grey = np.full((120, 160, 3), 200, np.uint8)
    bare = CameraSpec(width_px=160, height_px=120, noise=0.0, exposure_jitter=0.0)
    dark = CameraSpec(width_px=160, height_px=120, noise=0.0, exposure_jitter=0.0, vignetting=0.5)
    taken = Optics(dark, 100.0, 1).expose(grey, 0, 0.0)
    assert taken[60, 80, 0] == 200
    assert taken[0, 0, 0] == pytest.approx(100, abs=2)
    dirty = CameraSpec(width_px=160, height_px=120, noise=0.0, exposure_jitter=0.0, dirt=3)
    specks = Optics(dirty, 100.0, 1).expose(grey, 0, 0.0)
    assert specks.min() < 130
    assert (specks > 190).mean() > 0.9
    np.testing.assert_array_equal(specks, Optics(dirty, 100.0, 1).expose(grey, 7, 0.0, 3.0))  # dirt stays where it is
    np.testing.assert_array_equal(Optics(bare, 100.0, 1).expose(grey, 0, 0.0), grey)


def test_exposure_and_white_balance_swing_with_time() -> None:
    grey = np.full((120, 160, 3), 120, np.uint8)
    plain = {"width_px": 160, "height_px": 120, "noise": 0.0, "exposure_jitter": 0.0}
    bright, colour = (
        np.array([Optics(spec, 100.0, 2).expose(grey, 0, 0.0, time_s)[0, 0] for time_s in np.arange(0, 40, 0.3)], int)
        for spec in (CameraSpec(**plain, exposure_hunt=0.3), CameraSpec(**plain, white_balance_hunt=0.2))
    )
    assert (bright[:, 0] == bright[:, 2]).all()
    assert (bright[:, 1].min(), bright[:, 1].max()) == (pytest.approx(84, abs=3), pytest.approx(156, abs=3))
    assert (colour[:, 1] == 120).all()
    assert np.abs(colour[:, 0] - colour[:, 2]).max() > 20
