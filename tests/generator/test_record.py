"""Whole recordings: same bytes, readable by others, collisions and stuck robots reported."""

import multiprocessing
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_IMAGE, ODOMETRY, SCAN, TRUTH_DETECTIONS, TRUTH_OBJECTS, TRUTH_POSE
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.stage import Stamped
from mcap_landmarks_generator.camera import ImageJob
from mcap_landmarks_generator.checks import Staged, stage
from mcap_landmarks_generator.loading import load_scenario
from mcap_landmarks_generator.record import record
from mcap_landmarks_generator.rendering import Darkroom, Messages
from mcap_landmarks_generator.simulation import Simulation
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from tests.generator.conftest import StageText

SHORT = """\
seed = 3
objects = [
  { class = "fire hydrant", at = [3.0, 0.5], look = 1 },
  { class = "suitcase", at = [4.0, -0.8], look = 2 },
  { class = "person", variant = "stride", at = [5.0, 2.0], walk = [[5.0, -2.0]], look = 3 },
]
[camera]
width_px = 160
height_px = 120
rate_hz = 5
[trajectory]
waypoints = [ { at = [0.0, 0.0] }, { at = [0.3, 0.0], heading_deg = 20, stop_s = 0.5 } ]
"""


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> tuple[Staged, Path]:
    folder = tmp_path_factory.mktemp("short")
    (folder / "short.toml").write_text(SHORT)
    staged = stage(load_scenario(str(folder / "short.toml")))
    record(staged, folder / "one.mcap")
    return staged, folder


@pytest.mark.slow
def test_one_worker_or_two_give_the_same_bytes(short: tuple[Staged, Path]) -> None:
    staged, folder = short
    record(staged, folder / "two.mcap", workers=2)
    assert (folder / "one.mcap").read_bytes() == (folder / "two.mcap").read_bytes()


def develop(darkroom: Darkroom, job: ImageJob) -> Messages:
    darkroom.hand_in(job)
    return darkroom.pick_up()


@pytest.mark.slow
def test_a_killed_worker_is_an_error(short: tuple[Staged, Path]) -> None:
    staged, _ = short
    jobs = [event for event in Simulation(staged).run() if isinstance(event, ImageJob)]
    with Darkroom(staged, 2) as darkroom:
        assert develop(darkroom, jobs[0])[0].log_time_ns == jobs[0].log_time_ns
        for process in multiprocessing.active_children():
            process.kill()
            process.join()
        with pytest.raises(ToolkitError, match="a rendering worker died"):
            develop(darkroom, jobs[1])


@pytest.mark.slow
def test_another_seed_gives_other_noise_in_the_same_world(short: tuple[Staged, Path]) -> None:
    _, folder = short
    other = stage(load_scenario(str(folder / "short.toml"), ["camera.when=never"], seed=4))
    summary = record(other, folder / "other.mcap")
    assert CAMERA_IMAGE.topic not in summary.messages
    with open_recording(folder / "one.mcap") as one, open_recording(folder / "other.mcap") as two:
        scans = [
            [message.data for message in log.messages() if message.connection.topic == SCAN.topic] for log in (one, two)
        ]
    assert scans[0][0] != scans[1][0]


def test_messages_come_in_order_and_complete(short: tuple[Staged, Path]) -> None:
    staged, folder = short
    with open_recording(folder / "one.mcap") as log:
        times = [message.log_time_ns for message in log.messages()]
        counts = {channel.connection.topic: channel.count for channel in log.channels}
        run = log.metadata["mcap-landmarks.run"]
        seconds = (log.end_ns - log.start_ns) / 1e9
    assert times == sorted(times)
    assert times[0] == staged.scenario.start_ns
    assert counts[ODOMETRY.topic] == counts["/tf"] == pytest.approx(30 * seconds, abs=2)
    assert counts[TRUTH_POSE.topic] == pytest.approx(30 * seconds, abs=2)
    assert counts[TRUTH_OBJECTS.topic] == pytest.approx(10 * seconds, abs=2)
    assert counts[SCAN.topic] == pytest.approx(5 * seconds, abs=2)
    assert counts[CAMERA_IMAGE.topic] == counts[TRUTH_DETECTIONS.topic] == pytest.approx(5 * seconds, abs=2)
    assert counts["/tf_static"] == 1
    assert run["seed"] == "3"
    assert '"class": "suitcase"' in run["config"]


@pytest.mark.slow
def test_others_read_every_message(short: tuple[Staged, Path]) -> None:
    path = short[1] / "one.mcap"
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        kinds = {
            type(reader.deserialize(data, connection.msgtype)).__name__ for connection, _, data in reader.messages()
        }
    assert len(kinds) == 8
    doctor = Path(sys.executable).with_name("pymcap-cli")
    done = subprocess.run([doctor, "doctor", path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_truth_says_where_robot_and_objects_are(short: tuple[Staged, Path]) -> None:
    with open_recording(short[1] / "one.mcap") as log:
        by_topic: dict[str, list[bytes]] = {}
        for message in log.messages():
            by_topic.setdefault(message.connection.topic, []).append(bytes(message.data))
    last = decode(PoseStamped, by_topic[TRUTH_POSE.topic][-1])
    assert last.pose == pytest.approx([0.3, 0.0, np.deg2rad(20)], abs=0.01)
    objects = decode(SceneObjects, by_topic[TRUTH_OBJECTS.topic][10])
    assert objects.ids == ("fire_hydrant_1", "suitcase_1", "person_1")
    assert objects.classes == ("fire hydrant", "suitcase", "person")
    assert objects.positions_xy[0] == pytest.approx([3.0, 0.5])
    assert objects.positions_xy[2] == pytest.approx([5.0, 1.2])
    assert objects.radii_m[0] == pytest.approx(0.15)


@pytest.mark.slow
def test_a_collision_is_reported(stage_text: StageText, tmp_path: Path) -> None:
    staged = stage_text(
        """\
objects = [ { class = "person", at = [3.5, 0.0], walk = [[-3.0, 0.0], [3.5, 0.0]], speed_mps = 1.5, look = 1 } ]
[camera]
when = "never"
[trajectory]
waypoints = [ { at = [0.0, 0.0] }, { at = [0.5, 0.0], stop_s = 2.0 } ]
"""
    )
    summary = record(staged, tmp_path / "bump.mcap")
    assert [name for _, name in summary.collisions][:1] == ["person_1"]
    assert 1.0 < summary.collisions[0][0] < 3.0


@pytest.mark.slow
def test_a_stuck_robot_is_an_error_and_leaves_no_file(stage_text: StageText, tmp_path: Path) -> None:
    staged = stage_text(
        """\
objects = [ { class = "car", at = [5.0, 0.0], walk = [[2.0, 0.0], [1.9, 0.0]], speed_mps = 0.0001, look = 1 } ]
[camera]
when = "never"
[trajectory]
waypoints = [ { at = [0.0, 0.0] }, { at = [6.0, 0.0] } ]
"""
    )
    with pytest.raises(ToolkitError, match=r"the robot is stuck at \(.*; it touches car_1"):
        record(staged, tmp_path / "stuck.mcap")
    assert list(tmp_path.glob("*stuck*")) == []


def test_a_way_is_needed(stage_text: StageText, tmp_path: Path) -> None:
    with pytest.raises(ToolkitError, match="waypoints is empty"):
        record(stage_text("seed = 1\n"), tmp_path / "none.mcap")


@pytest.mark.slow
def test_images_only_at_stops(stage_text: StageText) -> None:
    staged = stage_text(SHORT.replace("[camera]", '[camera]\nwhen = "stops"'))
    jobs = [event for event in Simulation(staged).run() if isinstance(event, ImageJob)]
    assert 2 <= len(jobs) <= 3
    assert [job.index for job in jobs] == list(range(len(jobs)))


@pytest.mark.slow
def test_laps_come_back(stage_text: StageText) -> None:
    text = "[camera]\nwhen = 'never'\n[robot]\nspeed_factor = 4.0\n[trajectory]\nlaps = 2\nwaypoints = ["
    staged = stage_text(text + "{ at = [0.0, 0.0] }, { at = [1.0, 0.0] }, { at = [1.0, 1.0] } ]\n")
    poses = [
        event.message.pose
        for event in Simulation(staged).run()
        if isinstance(event, Stamped) and isinstance(event.message, PoseStamped)
    ]
    near_start = np.hypot(*np.array(poses)[:, :2].T) < 0.3
    assert np.count_nonzero(np.diff(near_start.astype(int)) == 1) == 1
    assert poses[-1][:2] == pytest.approx([1.0, 1.0], abs=0.05)
