"""Several cameras: topics, frames and places of each, and that each sees what is in front of it."""

import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_IMAGE, TF_STATIC, TRUTH_DETECTIONS
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.stage import Stamped
from mcap_landmarks_generator.camera import ImageJob
from mcap_landmarks_generator.checks import Staged
from mcap_landmarks_generator.mounts import mounts
from mcap_landmarks_generator.rendering import Photographer
from mcap_landmarks_generator.simulation import Simulation
from scipy.spatial.transform import Rotation

from tests.generator.conftest import StageText

SCENE = """\
objects = [
  { class = "fire hydrant", at = [4.0, 0.0], look = 1 },
  { class = "suitcase", at = [0.5, 4.0], look = 3 },
]
robot = { start = [0, 0, 0] }
trajectory = { waypoints = [{ at = [0, 0], stop_s = 0.3 }] }
camera = { width_px = 320, height_px = 240 }
cameras = [
  { name = "left", at = [0.0, 0.1, 0.3], yaw_deg = 90, pitch_deg = -10, width_px = 320, height_px = 240 },
]
"""


@pytest.fixture
def staged(stage_text: StageText) -> Staged:
    return stage_text(SCENE)


def test_each_camera_has_its_topics_and_sees_what_is_before_it(staged: Staged) -> None:
    events = list(Simulation(staged).run())
    jobs = {event.camera: event for event in events if isinstance(event, ImageJob)}
    photographer = Photographer(staged)
    taken = {number: photographer.take(jobs[number]) for number in (0, 1)}
    assert taken[0][0].channel is CAMERA_IMAGE
    assert [stamped.channel.topic for stamped in taken[1]] == [
        "/left/image_raw/compressed",
        "/left/camera_info",
        TRUTH_DETECTIONS.topic,
    ]
    expected = (("camera_rgb_optical_frame", "fire_hydrant_1"), ("left_optical_frame", "suitcase_1"))
    for number, (frame, seen) in enumerate(expected):
        truth = taken[number][2].message
        assert isinstance(truth, Detections)
        assert (truth.frame_id, truth.ids) == (frame, (seen,))
    box = truth.boxes_xyxy[0]
    # The suitcase stands to the right of straight ahead of a camera that looks down by 10 degrees.
    assert (box[0] + box[2]) / 2 == pytest.approx(160 + 265.2 * 0.5 / 3.9, abs=10)
    assert box[3] == pytest.approx(120 + 265.2 * np.tan(np.arctan(0.3 / 3.8) - np.deg2rad(10)), abs=5)


def test_the_frame_that_is_told_is_the_camera_s(staged: Staged) -> None:
    (frames,) = [
        event.message for event in Simulation(staged).run() if isinstance(event, Stamped) and event.channel is TF_STATIC
    ]
    assert isinstance(frames, TFMessage)
    (told,) = [one for one in frames.transforms if one.child_frame_id == "left_optical_frame"]
    left = mounts(staged.scenario)[1]
    assert told.frame_id == "base_footprint"
    assert told.translation_m == pytest.approx(left.position_m)
    assert Rotation.from_quat(told.rotation_xyzw).as_matrix() == pytest.approx(left.base_from_optical, abs=1e-9)
    assert left.base_from_optical[:, 2] == pytest.approx([0, np.cos(np.deg2rad(10)), -np.sin(np.deg2rad(10))])


def test_a_further_camera_leaves_the_first_one_s_images_as_they_are(staged: Staged, stage_text: StageText) -> None:
    alone = stage_text(SCENE[: SCENE.index("cameras =")])
    with_it, without = (
        [
            (event.index, event.stamp_ns, event.log_time_ns)
            for event in Simulation(scene).run()
            if isinstance(event, ImageJob) and event.camera == 0
        ]
        for scene in (staged, alone)
    )
    assert with_it == without
    assert mounts(staged.scenario)[0].seed == alone.scenario.seed


def test_names_are_not_shared(stage_text: StageText) -> None:
    with pytest.raises(ToolkitError, match="camera is taken"):
        stage_text(SCENE.replace('"left"', '"camera"'))
    with pytest.raises(ToolkitError, match=r"cameras\.0\.name"):
        stage_text(SCENE.replace('"left"', '"Left/up"'))
