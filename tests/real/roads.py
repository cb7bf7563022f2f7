"""KITTI frames of the development set as recordings: image, cloud, calibration, mounting, and labels beside them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from mcap_landmarks.channels import CAMERA_IMAGE, CAMERA_INFO, ODOMETRY, TF_STATIC
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.images import CameraInfo, CompressedImage
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Channel, Stamped
from scipy.spatial.transform import Rotation

CLOUD = Channel("/velodyne_points", PointCloud2)
LIDAR_M = 1.73
"""Height of the Velodyne above the road."""
SINGLE = (31, 35, 60, 76, 80, 134, 142, 217, 2155, 7347)
DRIVE = tuple(range(31))
DEVELOPED_ON = (31, 35, 60, 76, 142, 2155)
"""Single frames that were looked at while the code was written, as were the even frames of the drive; no others."""


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """One labelled object: KITTI's class, its box in the image (4,) in pixels, the centre (3,) in the base frame, size
    (length, width, height) in m, and yaw in the base frame; a region that nobody labelled is a `DontCare` without a
    place."""

    name: str
    box_xyxy: Array
    centre_m: Array
    size_m: Array
    yaw_rad: float
    track: int = -1


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One moment: stamp, picture (its format and bytes), points (N, 3) in the LiDAR's frame, calibration and labels.

    `intrinsics` (3, 3) are those of `camera_from_lidar` (4, 4), whose frame is the left colour camera's; `pose` (3,) is
    that of the base in the frame of the drive's start, None for a single frame.
    """

    number: int
    stamp_ns: int
    format: str
    picture: bytes
    points_m: Array
    intrinsics: Array
    camera_from_lidar: Array
    labels: tuple[Label, ...]
    pose: Array | None = None

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the picture."""
        height, width = cv2.imdecode(np.frombuffer(self.picture, np.uint8), cv2.IMREAD_UNCHANGED).shape[:2]
        return width, height


def single_frames(folder: Path, numbers: Iterable[int]) -> list[Frame]:
    """Frames of KITTI's object benchmark in its layout, 20 s from each other so that nothing is taken for a drive."""
    found = []
    for i, number in enumerate(numbers):
        name = f"{number:06d}"
        intrinsics, camera_from_lidar, rectified_from_lidar = _calibration(folder / "calib" / f"{name}.txt")
        points = np.fromfile(folder / "velodyne" / f"{name}.bin", "<f4").reshape(-1, 4)[:, :3]
        lines = (folder / "label_2" / f"{name}.txt").read_text().splitlines()
        labels = tuple(_label(line.split(), rectified_from_lidar) for line in lines if line.strip())
        picture = (folder / "image_2" / f"{name}.png").read_bytes()
        stamp_ns = (i + 1) * 20 * 10**9
        found.append(Frame(number, stamp_ns, "png", picture, points, intrinsics, camera_from_lidar, labels))
    return found


def drive_frames(folder: Path, numbers: Iterable[int]) -> list[Frame]:
    """Frames of the drive of parked cars, at 10 Hz."""
    intrinsics, camera_from_lidar, rectified_from_lidar = _calibration(folder / "calib.txt")
    poses = {int(row[0]): row[1:].reshape(3, 4) for row in np.loadtxt(folder / "poses_kissicp_DERIVED.txt")}
    rows = [line.split() for line in (folder / "label_02_0001.txt").read_text().splitlines()]
    found = []
    for number in numbers:
        with np.load(folder / "velo" / f"{number:06d}.npz") as cloud:
            points = cloud["xyz"] * float(cloud["scale"])
        own = [row for row in rows if int(row[0]) == number]
        labels = tuple(_label(row[2:], rectified_from_lidar, int(row[1])) for row in own)
        picture = (folder / "image" / f"{number:06d}.jpg").read_bytes()
        pose = frames.planar(np.vstack([poses[number], [0, 0, 0, 1]]))
        stamp_ns = (number + 1) * 10**8
        found.append(Frame(number, stamp_ns, "jpeg", picture, points, intrinsics, camera_from_lidar, labels, pose))
    return found


def write_log(path: Path, content: Sequence[Frame]) -> None:
    """Frames as a recording; with odometry, if they have poses."""
    with create_recording(path) as writer:
        mounts = [_mount(content[0].stamp_ns, "base_link", "velodyne", base_from_lidar())]
        # Cameras of several drives have several calibrations; a transform of its own keeps each where it was.
        for i, frame in enumerate(content):
            mounts.append(
                _mount(content[0].stamp_ns, "velodyne", f"camera{i}", frames.inverse(frame.camera_from_lidar))
            )
        writer.add(Stamped(TF_STATIC, content[0].stamp_ns, TFMessage(tuple(mounts))))
        for i, frame in enumerate(content):
            stamp_ns, name = frame.stamp_ns, f"camera{i}"
            width, height = frame.size_px
            projection = np.column_stack([frame.intrinsics, np.zeros(3)])
            info = CameraInfo(
                stamp_ns, name, height, width, "plumb_bob", np.zeros(5), frame.intrinsics, np.eye(3), projection
            )
            writer.add(Stamped(CAMERA_INFO, stamp_ns, info))
            writer.add(Stamped(CAMERA_IMAGE, stamp_ns, CompressedImage(stamp_ns, name, frame.format, frame.picture)))
            writer.add(Stamped(CLOUD, stamp_ns, PointCloud2(stamp_ns, "velodyne", frame.points_m.astype(np.float32))))
            if frame.pose is not None:
                odometry = Odometry.planar(stamp_ns, ("odom", "base_link"), frame.pose, np.zeros((3, 3)))
                writer.add(Stamped(ODOMETRY, stamp_ns, odometry))


def base_from_lidar() -> Array:
    """Where the LiDAR sits above the road (4, 4)."""
    return frames.rigid([0.0, 0.0, LIDAR_M], [0.0, 0.0, 0.0, 1.0])


def _mount(stamp_ns: int, parent: str, child: str, matrix: Array) -> Transform:
    return Transform(stamp_ns, parent, child, matrix[:3, 3], Rotation.from_matrix(matrix[:3, :3]).as_quat())


def _calibration(path: Path) -> tuple[Array, Array, Array]:
    """K (3, 3) of the left colour camera, camera_from_lidar and rectified_from_lidar (4, 4)."""
    rows = {}
    for line in path.read_text().splitlines():
        key, *values = line.replace(":", " ").split() or [""]
        rows[key] = np.array([float(value) for value in values])
    rectified, mounted, projection = np.eye(4), np.eye(4), rows["P2"].reshape(3, 4)
    rectified[:3, :3] = rows["R0_rect" if "R0_rect" in rows else "R_rect"].reshape(3, 3)
    mounted[:3] = rows["Tr_velo_to_cam" if "Tr_velo_to_cam" in rows else "Tr_velo_cam"].reshape(3, 4)
    rectified_from_lidar, shifted = rectified @ mounted, np.eye(4)
    shifted[:3, 3] = np.linalg.solve(projection[:, :3], projection[:, 3])
    turned = shifted @ rectified_from_lidar
    turned[:3, :3] = Rotation.from_matrix(turned[:3, :3]).as_matrix()  # the files round to seven digits
    return projection[:, :3], turned, rectified_from_lidar


def _label(words: Sequence[str], rectified_from_lidar: Array, track: int = -1) -> Label:
    box, (height, width, length), bottom = (np.array(words[i:j], dtype=float) for i, j in ((4, 8), (8, 11), (11, 14)))
    lidar_from_rectified = np.linalg.inv(rectified_from_lidar)
    centre = frames.apply(base_from_lidar() @ lidar_from_rectified, bottom - [0.0, height / 2, 0.0])
    ahead = lidar_from_rectified[:3, :3] @ [np.cos(float(words[14])), 0.0, -np.sin(float(words[14]))]
    return Label(words[0], box, centre, np.array([length, width, height]), float(np.arctan2(ahead[1], ahead[0])), track)
