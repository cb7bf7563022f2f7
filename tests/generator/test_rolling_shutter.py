"""A rolling shutter: rows are taken one after the other, and the truth's boxes are right for such an image."""

import numpy as np
import pytest
from mcap_landmarks.channels import TRUTH_DETECTIONS
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks_generator.camera import ImageJob, Viewpoint
from mcap_landmarks_generator.lens_renderer import LensRenderer
from mcap_landmarks_generator.renderer import Renderer
from mcap_landmarks_generator.rendering import Photographer
from mcap_landmarks_generator.rolling_shutter import bands
from mcap_landmarks_generator.simulation import Simulation
from mcap_landmarks_generator.visibility import true_detections

from tests.generator.conftest import StageText
from tests.generator.test_camera import view_from

SCENE = """\
objects = [ { class = "person", variant = "coat", at = [3.0, 0.0], look = 2 } ]
robot = { start = [0, 0, 0] }
trajectory = { waypoints = [{ at = [0, 0], heading_deg = 60 }] }
[camera]
width_px = 320
height_px = 240
"""
ROLLING = SCENE + "rolling_shutter_s = 0.05\n"
TURN_RADPS, READOUT_S, FOCAL_PX = 1.0, 0.05, 265.2


def turning(turn_radps: float) -> tuple[Viewpoint, ...]:
    """Views from the first row's time to the last one's, the middle one straight ahead."""
    times = np.linspace(-READOUT_S / 2, READOUT_S / 2, 13)
    views = [view_from(0.0, 0.0, float(np.rad2deg(turn_radps * time_s))) for time_s in times]
    return tuple(
        Viewpoint(view.eye_m, view.world_from_optical, float(time_s)) for view, time_s in zip(views, times, strict=True)
    )


def middles_of_rows(mask: np.ndarray) -> np.ndarray:
    """Column (N,) of the middle of a mask in each of its rows, in pixels of the image."""
    rows = np.flatnonzero(mask.any(axis=1))
    return np.array([np.flatnonzero(mask[row]).mean() / 2 for row in rows])


def test_a_turn_leans_what_stands_upright(stage_text: StageText) -> None:
    staged = stage_text(ROLLING)
    plain = Renderer(staged.scenario, staged.objects)
    rolling = LensRenderer(staged.scenario, staged.objects)
    view = view_from(0.0, 0.0, 0.0)
    still, straight = rolling.draw(view, turning(0.0)), plain.draw(view)
    lean = rolling.draw(view, turning(TURN_RADPS))
    boxes = [
        true_detections(drawn, by, view, 0).boxes_xyxy[0]
        for drawn, by in ((straight, plain), (still, rolling), (lean, rolling))
    ]
    assert boxes[1] == pytest.approx(boxes[0], abs=0.5)
    assert np.abs(still.image.astype(int) - straight.image).mean() < 2
    upright, leaning = middles_of_rows(still.body_ids >= 0), middles_of_rows(lean.body_ids >= 0)
    slope = np.polyfit(np.arange(len(leaning)) / 2, leaning - upright[: len(leaning)], 1)[0]
    assert slope == pytest.approx(TURN_RADPS * READOUT_S * FOCAL_PX / 240, rel=0.1)  # later rows: farther to the right
    columns = np.flatnonzero((lean.body_ids >= 0).any(axis=0))
    assert boxes[2][[0, 2]] == pytest.approx([columns[0] / 2, (columns[-1] + 1) / 2])


def test_bands_follow_the_camera_s_way() -> None:
    assert len(bands(turning(1.0), 240)) <= 2  # the camera sits 8 cm before the axis of the turn
    forwards = tuple(view_from(0.00095 * step, 0.0, 0.0) for step in range(21))
    parts = bands(forwards, 240)
    assert [part.first for part in parts] == [0, 60, 120, 180]
    assert [part.end for part in parts][-1] == 240
    eyes = np.array([part.view.eye_m[0] for part in parts]) - forwards[0].eye_m[0]
    assert eyes == pytest.approx([0.0024, 0.0071, 0.0119, 0.0166], abs=2e-4)
    assert parts[0].rows_turned == pytest.approx(np.broadcast_to(np.eye(3), (60, 3, 3)), abs=1e-12)


def test_the_stamp_is_of_the_first_row(stage_text: StageText) -> None:
    staged = stage_text(ROLLING.replace("[camera]", "[camera]\njitter_s = 0\ndelay_s = 0"))
    jobs = [event for event in Simulation(staged).run() if isinstance(event, ImageJob)]
    for job in jobs[:5]:
        stamp_s = (job.stamp_ns - staged.scenario.start_ns) / 1e9
        assert [view.time_s for view in job.readout][:: len(job.readout) - 1] == pytest.approx(
            [stamp_s, stamp_s + READOUT_S]
        )
        assert job.view.time_s == pytest.approx(stamp_s + READOUT_S / 2)
        assert job.log_time_ns == job.stamp_ns + 50_000_000
    photographer = Photographer(staged)
    first, again = photographer.take(jobs[1]), photographer.take(jobs[1])
    for one, other in zip(first, again, strict=True):
        if isinstance(one.message, CompressedImage):
            assert isinstance(other.message, CompressedImage)
            assert one.message.data == other.message.data
    (truth,) = [stamped.message for stamped in first if stamped.channel is TRUTH_DETECTIONS]
    assert isinstance(truth, Detections)
    assert truth.ids == ("person_1",)
