"""MRCLAM data sets: exact arcs, honest covariances, and nothing left out in silence."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_landmarks.channels import ODOMETRY, SCENE_OBJECTS, TRUTH_OBJECTS, TRUTH_POSE
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.geometry.se2 import compose, exp
from mcap_landmarks.messages.codec import M, decode
from mcap_landmarks.messages.poses import Odometry, PoseStamped
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.sources import SourceLog, find_source
from mcap_landmarks.sources._mrclam_robot import MrclamConfig, integrate, odometry_covariance
from mcap_landmarks.stage import Channel

from tests.sources.bags import SECOND, write_mrclam

SOURCE = find_source("mrclam")
START_NS = 1_248_444_187 * SECOND


def open_all(path: Path, config: MrclamConfig | None = None) -> list[SourceLog]:
    with SOURCE.open(path, config or MrclamConfig()) as logs:
        return list(logs)


def messages(log: SourceLog, channel: Channel[M]) -> list[M]:
    (part,) = log.parts
    return [decode(channel.message, raw.data) for raw in part.messages() if raw.connection.topic == channel.topic]


def odometry_rows(*rows: tuple[float, float, float]) -> str:
    return "".join(f"{time:.3f} {forward} {turn}\n" for time, forward, turn in rows)


def test_each_robot_is_a_log_of_its_own(tmp_path: Path) -> None:
    one, two = open_all(write_mrclam(tmp_path / "set"))
    assert (one.name, two.name) == ("robot1", "robot2")
    counts = {entry.connection.topic: entry.count for entry in one.parts[0].channels}
    assert counts == {"/odom": 50, "/landmarks/scene_objects": 5, "/ground_truth/pose": 50, "/ground_truth/objects": 1}
    assert one.dropped == {"Robot1_Measurement.dat: barcode of a robot": 5}
    assert (one.losses, one.notes) == ((), ())


def test_odometry_starts_at_zero_and_follows_the_arc(tmp_path: Path) -> None:
    one, _ = open_all(write_mrclam(tmp_path / "set"))
    odometry = messages(one, ODOMETRY)
    assert odometry[0].pose.tolist() == [0, 0, 0]
    assert (odometry[0].frame_id, odometry[0].child_frame_id) == ("odom", "base_footprint")
    turn = 0.2 * 4.9
    arc = [0.5 * np.sin(turn), 0.5 * (1 - np.cos(turn)), turn]
    assert odometry[-1].pose == pytest.approx(arc, abs=1e-6)
    assert (odometry[0].linear_mps[0], odometry[0].angular_radps[2]) == (0.1, 0.2)
    assert [message.stamp_ns for message in odometry[:2]] == [START_NS, START_NS + SECOND // 10]


@given(st.lists(st.tuples(st.floats(0.01, 2), st.floats(-1, 1), st.floats(-3, 3)), min_size=1, max_size=20))
def test_integration_composes_the_steps(steps: list[tuple[float, float, float]]) -> None:
    stamps = np.concatenate([[0], np.cumsum([int(seconds * 1e9) for seconds, _, _ in steps])]).astype(np.int64)
    speeds = np.array([[forward, turn] for _, forward, turn in steps] + [[0.0, 0.0]])
    pose = np.zeros(3)
    for seconds, (forward, turn) in zip(np.diff(stamps) * 1e-9, speeds, strict=False):
        pose = compose(pose, exp([forward * seconds, 0, turn * seconds]))
    found = integrate(stamps, speeds)[-1]
    assert found[:2] == pytest.approx(pose[:2], abs=1e-9)
    assert np.cos(found[2] - pose[2]) == pytest.approx(1, abs=1e-9)


def test_covariance_is_that_of_many_noisy_runs() -> None:
    rng = np.random.default_rng(5)
    stamps = (np.arange(61) * SECOND // 2).astype(np.int64)
    speeds = np.column_stack([np.full(61, 0.3), np.where(np.arange(61) < 30, 0.2, -0.1)])
    config = MrclamConfig(slip_sd_m=0.03, turn_sd_rad=0.05, drift_sd_rad=0.02)
    poses = integrate(stamps, speeds)
    expected = odometry_covariance(stamps, speeds, poses, config)[-1]
    way, turned = 0.3 * 0.5, np.abs(speeds[:-1, 1]) * 0.5
    turn_sd = np.sqrt(config.turn_sd_rad**2 * turned + config.drift_sd_rad**2 * way)
    ends = []
    for _ in range(4000):
        pose = np.zeros(3)
        heading_noise = rng.normal(0, turn_sd)
        headings = np.concatenate([[0], np.cumsum(speeds[:-1, 1] * 0.5 + heading_noise)])
        middle = (headings[:-1] + headings[1:]) / 2
        moves = np.column_stack([np.cos(middle), np.sin(middle)]) * way + rng.normal(
            0, config.slip_sd_m * np.sqrt(way), (60, 2)
        )
        pose[:2], pose[2] = moves.sum(axis=0), headings[-1]
        ends.append(pose)
    found = np.cov(np.array(ends).T)
    assert np.diag(found) == pytest.approx(np.diag(expected), rel=0.12)
    assert found[:2, 2] == pytest.approx(expected[:2, 2], rel=0.12, abs=2e-4)
    assert found[0, 1] == pytest.approx(expected[0, 1], rel=0.2, abs=2e-4)


def test_covariances_are_positive_and_grow(tmp_path: Path) -> None:
    odometry = messages(open_all(write_mrclam(tmp_path / "set"))[0], ODOMETRY)
    planar = np.array([message.pose_covariance[np.ix_([0, 1, 5], [0, 1, 5])] for message in odometry])
    assert not planar[0].any()
    assert (np.linalg.eigvalsh(planar[1:])[:, 0] > 0).all()
    assert (np.diff(planar[:, 2, 2]) > 0).all()


def test_objects_of_a_time_stamp_are_one_message(tmp_path: Path) -> None:
    rows = "1248444187.0 63 2.0 0.5\n1248444187.0 25 3.0 -0.5\n1248444187.0 99 4.0 0\n1248444187.5 14 1.0 0\n"
    one, _ = open_all(write_mrclam(tmp_path / "set", Robot1_Measurement=rows), MrclamConfig(0.1, 0.02))
    first, second = messages(one, SCENE_OBJECTS)
    assert first.classes == ("landmark_6", "landmark_7", "barcode_99")
    assert first.frame_id == "base_footprint"
    assert first.positions_xy[0] == pytest.approx([2 * np.cos(0.5), 2 * np.sin(0.5)])
    values, vectors = np.linalg.eigh(first.covariances[1])
    assert values == pytest.approx([(3 * 0.02) ** 2, 0.1**2])
    assert abs(vectors[:, 1] @ [np.cos(-0.5), np.sin(-0.5)]) == pytest.approx(1)
    assert len(second) == 0
    assert second.stamp_ns == START_NS + SECOND // 2


def test_truth_is_the_survey_and_the_vicon(tmp_path: Path) -> None:
    one, _ = open_all(write_mrclam(tmp_path / "set"))
    (survey,) = messages(one, TRUTH_OBJECTS)
    assert survey.ids == survey.classes == ("landmark_6", "landmark_7")
    assert survey.frame_id == "map"
    assert survey.positions_xy.tolist() == [[2, 1], [3, -1]]
    assert survey.covariances[0].tolist() == [[pytest.approx(1e-4), 0], [0, pytest.approx(4e-4)]]
    truth = messages(one, TRUTH_POSE)
    assert (truth[0].frame_id, truth[0].stamp_ns) == ("map", START_NS)
    assert truth[0].pose == pytest.approx([1, 2, 0.3])


def test_the_truth_leaks_into_no_other_channel(tmp_path: Path) -> None:
    moved = "".join(f"{1248444187 + i / 10:.3f} {i} {-i} 1.5\n" for i in range(50))
    survey = "6 -9.0 8.0 0.5 0.5\n7 7.0 -6.0 0.5 0.5\n"
    plain = open_all(write_mrclam(tmp_path / "a"))[0]
    other = open_all(write_mrclam(tmp_path / "b", Robot1_Groundtruth=moved, Landmark_Groundtruth=survey))[0]
    for channel in (ODOMETRY, SCENE_OBJECTS):
        wanted, found = (
            [(raw.log_time_ns, raw.data) for raw in log.parts[0].messages() if raw.connection.topic == channel.topic]
            for log in (plain, other)
        )
        assert wanted == found


def test_what_is_wrong_in_the_tables_is_counted(tmp_path: Path) -> None:
    odometry = odometry_rows(
        (187.0, 0.1, 0), (187.1, float("nan"), 0), (187.2, 0.1, 0), (187.2, 0.3, 0), (187.1, 0.2, 0)
    )
    measured = (
        "187.0 63 2.0 0.5\n187.0 63 2.0 0.5\n187.0 63 2.1 0.5\n187.1 25 -1.0 0\n187.2 25 inf 0\n187.2 25 1.0\nwords\n"
    )
    truth = "187.0 1 2 0\n187.0 1 2 0\n190.0 1 2 0\n"
    changes = {"Robot1_Odometry": odometry, "Robot1_Measurement": measured, "Robot1_Groundtruth": truth}
    one, _ = open_all(write_mrclam(tmp_path / "set", **changes))
    assert one.dropped == {
        "Robot1_Odometry.dat: not finite": 1,
        "Robot1_Odometry.dat: same time as the next row": 1,
        "Robot1_Measurement.dat: measured twice": 1,
        "Robot1_Measurement.dat: range is not positive": 1,
        "Robot1_Measurement.dat: not finite": 1,
        "Robot1_Groundtruth.dat: same time as the row before": 1,
    }
    assert one.losses == ("Robot1_Measurement.dat: 2 lines are not 4 numbers",)
    assert one.notes == ("Robot1_Odometry.dat: time goes backwards 1 times; the rows were sorted by time",)
    assert [(message.stamp_ns, message.linear_mps[0]) for message in messages(one, ODOMETRY)] == [
        (187 * SECOND, 0.1),
        (187 * SECOND + SECOND // 10, 0.2),
        (187 * SECOND + SECOND // 5, 0.3),
    ]
    assert [len(scene) for scene in messages(one, SCENE_OBJECTS)] == [2, 0]


def test_a_file_cut_in_its_last_line_is_told(tmp_path: Path) -> None:
    one, _ = open_all(write_mrclam(tmp_path / "set", Robot1_Odometry="187.0 0.1 0\n187.1 0.1 0\n187.2 0"))
    assert one.losses == ("Robot1_Odometry.dat: the file is cut in its last line",)


def test_a_zip_gives_the_same(tmp_path: Path) -> None:
    folder = write_mrclam(tmp_path / "set")
    with zipfile.ZipFile(tmp_path / "set.zip", "w") as archive:
        for path in folder.iterdir():
            archive.write(path, f"inside/{path.name}")
    assert SOURCE.recognises(tmp_path / "set.zip")
    assert SOURCE.recognises(folder)
    assert SOURCE.recognises(tmp_path)
    wanted, found = (
        [raw[1:] for raw in open_all(path)[0].parts[0].messages()] for path in (folder, tmp_path / "set.zip")
    )
    assert wanted == found


def test_missing_files_are_told_or_refused(tmp_path: Path) -> None:
    folder = write_mrclam(tmp_path / "set")
    (folder / "Robot2_Groundtruth.dat").unlink()
    (folder / "Landmark_Groundtruth.dat").unlink()
    one, two = open_all(folder)
    assert one.notes == ("there is no Landmark_Groundtruth.dat",)
    assert two.notes == ("there is no Robot2_Groundtruth.dat", "there is no Landmark_Groundtruth.dat")
    assert {entry.connection.topic for entry in two.parts[0].channels} == {"/odom", "/landmarks/scene_objects"}
    (folder / "Barcodes.dat").unlink()
    with pytest.raises(RecordingError, match=r"lacks Barcodes\.dat"):
        open_all(folder)


def test_damaged_surveys_and_zips_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="rows that are not 5 numbers"):
        open_all(write_mrclam(tmp_path / "set", Landmark_Groundtruth="6 1.0 nan 0 0\n"))
    (tmp_path / "set.zip").write_bytes(b"PK\x03\x04" + bytes(100))
    with pytest.raises(RecordingError, match="damaged zip"):
        open_all(tmp_path / "set.zip")


@pytest.mark.slow
def test_dataset_6_has_every_row(shared_data: Path) -> None:
    logs = open_all(shared_data / "mrclam" / "MRCLAM_Dataset6.zip")
    counts = [{entry.connection.topic: entry.count for entry in log.parts[0].channels} for log in logs]
    assert [count["/odom"] for count in counts] == [61785, 65004, 61150, 52906, 60563]
    assert [count["/landmarks/scene_objects"] for count in counts] == [1234, 2353, 2745, 1459, 2791]
    assert [count["/ground_truth/pose"] for count in counts] == [49241, 59705, 56977, 61714, 57467]
    for log, rows in zip(logs, [407, 792, 1277, 373, 1139], strict=True):
        assert log.dropped[f"Robot{log.name[-1]}_Measurement.dat: barcode of a robot"] == rows


def test_a_log_is_typed_as_its_channels(tmp_path: Path) -> None:
    one, _ = open_all(write_mrclam(tmp_path / "set"))
    types = {entry.connection.topic: entry.connection.message_type for entry in one.parts[0].channels}
    assert types == {
        "/odom": Odometry.ROS_TYPE,
        "/landmarks/scene_objects": SceneObjects.ROS_TYPE,
        "/ground_truth/pose": PoseStamped.ROS_TYPE,
        "/ground_truth/objects": SceneObjects.ROS_TYPE,
    }
