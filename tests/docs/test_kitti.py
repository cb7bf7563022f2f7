"""The script for KITTI frames writes recordings that the toolkit reads, with calibration and odometry as given."""

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_INFO, ODOMETRY, TF_STATIC
from mcap_landmarks.geometry import frames
from mcap_landmarks.inspection.info import describe
from mcap_landmarks.messages.codec import M, decode
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.stage import Channel
from scipy.spatial.transform import Rotation

from docs.kitti import CLOUD

ROOT = Path(__file__).resolve().parents[2]
PROJECTION = np.array([[700.0, 0.0, 320.0, 45.0], [0.0, 700.0, 100.0, -0.3], [0.0, 0.0, 1.0, 0.005]])
CAMERA_FROM_LIDAR = np.array([[0.0, -1.0, 0.0, 0.02], [0.0, 0.0, -1.0, -0.06], [1.0, 0.0, 0.0, -0.33]])
RECTIFIED = Rotation.from_euler("xyz", [0.01, -0.02, 0.005]).as_matrix()
POINTS = np.array([[10.0, 1.0, -1.0, 0.3], [20.0, -3.0, 0.5, 0.1]], "<f4")


def row(name: str, values: np.ndarray) -> str:
    return f"{name}: {' '.join(f'{value:.12e}' for value in np.ravel(values))}\n"


def write_frame(picture: Path, cloud: Path) -> None:
    for file in (picture, cloud):
        file.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(picture), np.zeros((200, 640, 3), np.uint8))
    POINTS.tofile(cloud)


def write_object_layout(folder: Path, numbers: tuple[int, ...]) -> Path:
    (folder / "calib").mkdir()
    for number in numbers:
        name = f"{number:06d}"
        write_frame(folder / "image_2" / f"{name}.png", folder / "velodyne" / f"{name}.bin")
        text = row("P2", PROJECTION) + row("R0_rect", RECTIFIED) + row("Tr_velo_to_cam", CAMERA_FROM_LIDAR) + "\n"
        (folder / "calib" / f"{name}.txt").write_text(text)
    return folder


def write_raw_layout(folder: Path) -> Path:
    """Two frames, the second 5 m to the north of the first; the vehicle looks there."""
    told = "calib_time: 09-Jan-2012 13:57:47\n"
    (folder / "calib_cam_to_cam.txt").write_text(told + row("R_rect_00", RECTIFIED) + row("P_rect_02", PROJECTION))
    mount = row("R", CAMERA_FROM_LIDAR[:, :3]) + row("T", CAMERA_FROM_LIDAR[:, 3])
    (folder / "calib_velo_to_cam.txt").write_text(told + mount)
    (folder / "calib_imu_to_velo.txt").write_text(told + row("R", np.eye(3)) + row("T", np.array([-0.8, 0.3, -0.8])))
    drive = folder / "2011_09_26_drive_0001_sync"
    (drive / "oxts" / "data").mkdir(parents=True)
    for number in range(2):
        name = f"{number:010d}"
        write_frame(drive / "image_02" / "data" / f"{name}.png", drive / "velodyne_points" / "data" / f"{name}.bin")
        packet = np.zeros(30)
        packet[:6] = 49.0 + np.degrees(5.0 * number / 6378137.0), 8.4, 110.0, 0.0, 0.0, np.pi / 2
        np.savetxt(drive / "oxts" / "data" / f"{name}.txt", packet[None])
    (drive / "image_02" / "timestamps.txt").write_text("2011-09-26 13:02:25.964389445\n2011-09-26 13:02:26.0675\n")
    return drive


def written(folder: Path, *words: object) -> Path:
    """The recording that the script makes of a folder."""
    log = folder / "log.mcap"
    command = [sys.executable, ROOT / "docs" / "kitti.py", folder, "-o", log, *words]
    subprocess.run([str(word) for word in command], check=True)
    return log


def read(log: Path, channel: Channel[M]) -> list[M]:
    with open_recording(log) as recording:
        raws = recording.messages(recording.connections(channel.topic))
        return [decode(channel.message, raw.data) for raw in raws]


def holds_the_calibration(log: Path) -> None:
    """A point of the LiDAR is in the picture where KITTI's own formula says."""
    lidar = POINTS[:, :3].astype(float)
    rectified = (np.c_[lidar, np.ones(len(lidar))] @ CAMERA_FROM_LIDAR.T) @ RECTIFIED.T
    expected = np.c_[rectified, np.ones(len(lidar))] @ PROJECTION.T
    (info, *_), (mounts, *_) = read(log, CAMERA_INFO), read(log, TF_STATIC)
    steps = {step.child_frame_id: frames.rigid(step.translation_m, step.rotation_xyzw) for step in mounts.transforms}
    pixels = frames.apply(frames.inverse(steps[info.frame_id]), lidar) @ info.intrinsics.T
    np.testing.assert_allclose(pixels[:, :2] / pixels[:, 2:], expected[:, :2] / expected[:, 2:], atol=1e-3)
    assert (info.width_px, info.height_px) == (640, 200)
    assert steps["velodyne"][2, 3] == pytest.approx(1.73)


@pytest.mark.slow
def test_frames_of_no_drive_are_far_apart(tmp_path: Path) -> None:
    log = written(write_object_layout(tmp_path, (7, 31, 60)), "--first", 31)
    holds_the_calibration(log)
    clouds = read(log, CLOUD)
    assert [cloud.stamp_ns for cloud in clouds] == [20 * 10**9, 40 * 10**9]
    np.testing.assert_array_equal(clouds[0].points_m, POINTS[:, :3])
    (found,) = describe(log, {})
    assert found.roles["image"]
    assert not found.roles["odometry"]


@pytest.mark.slow
def test_poses_make_frames_a_drive(tmp_path: Path) -> None:
    folder, poses = write_object_layout(tmp_path, (4, 5)), tmp_path / "poses.txt"
    moved = np.column_stack([Rotation.from_euler("z", 0.1).as_matrix(), [1.5, 0.2, 0.0]])
    np.savetxt(poses, [np.eye(4)[:3].ravel(), moved.ravel()])
    places = read(written(folder, "--poses", poses), ODOMETRY)
    assert [place.stamp_ns for place in places] == [10**8, 2 * 10**8]
    np.testing.assert_allclose([place.pose for place in places], [[0, 0, 0], [1.5, 0.2, 0.1]], atol=1e-9)


@pytest.mark.slow
def test_a_raw_drive_moves_as_its_inertial_unit_says(tmp_path: Path) -> None:
    log = written(write_raw_layout(tmp_path))
    holds_the_calibration(log)
    places = read(log, ODOMETRY)
    assert [place.stamp_ns for place in places] == [1317042145964389445, 1317042146067500000]
    np.testing.assert_allclose([place.pose for place in places], [[0, 0, 0], [5.0, 0, 0]], atol=1e-3)
