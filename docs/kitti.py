"""Write frames of KITTI as a recording: image, calibration, point cloud, mounting, and odometry where poses are known.

    python docs/kitti.py FOLDER -o LOG.mcap [--poses FILE] [--first N] [--last N]

FOLDER is one of two layouts (Geiger et al., Vision meets robotics: The KITTI dataset, IJRR 2013):

- object: `image_2/000031.png`, `velodyne/000031.bin`, `calib/000031.txt`. Frames are of no drive and are written 20 s
  apart, unless `--poses` makes them one at 10 Hz: a row per frame in their order, of twelve numbers, the upper 3x4 of
  start_from_lidar, or of thirteen with the frame's number before them. LiDAR odometry, such as KISS-ICP, writes these.
- raw: `2011_09_26/2011_09_26_drive_0009_sync` with `image_02`, `velodyne_points` and `oxts`, and the calibration beside
  it; the odometry is that of the GPS and inertial unit.

The base is on the road below the LiDAR.
"""

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import cv2
import numpy as np
from mcap_landmarks.channels import CAMERA_IMAGE, CAMERA_INFO, ODOMETRY, TF_STATIC
from mcap_landmarks.errors import ToolkitError
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
_PERIOD_NS, _APART_NS = 10**8, 20 * 10**9
_EARTH_M = 6378137.0


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One moment: stamp, picture (its format and bytes), points (N, 3) in the LiDAR's frame, and calibration.

    `intrinsics` (3, 3) are those of `camera_from_lidar` (4, 4), whose frame is the left colour camera's; `pose` (3,) is
    that of the base in the frame of the drive's start, None if it is not known.
    """

    number: int
    stamp_ns: int
    format: str
    picture: bytes
    points_m: Array
    intrinsics: Array
    camera_from_lidar: Array
    pose: Array | None = None

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the picture."""
        height, width = cv2.imdecode(np.frombuffer(self.picture, np.uint8), cv2.IMREAD_UNCHANGED).shape[:2]
        return width, height


def object_frames(folder: Path, numbers: Iterable[int], poses: Mapping[int, Array] | None = None) -> Iterator[Frame]:
    """Frames in the layout of the object benchmark; a drive if there are poses (3,) by number."""
    for i, number in enumerate(numbers, 1):
        name = f"{number:06d}"
        projection, rectified_from_lidar = object_calibration(folder / "calib" / f"{name}.txt")
        yield Frame(
            number,
            i * (_APART_NS if poses is None else _PERIOD_NS),
            "png",
            (folder / "image_2" / f"{name}.png").read_bytes(),
            _points(folder / "velodyne" / f"{name}.bin"),
            *camera(projection, rectified_from_lidar),
            None if poses is None else _pose_of(poses, number),
        )


def _pose_of(poses: Mapping[int, Array], number: int) -> Array:
    if number not in poses:
        raise ValueError(f"there is no pose of frame {number}; leave it out with --first and --last, or add its pose")
    return poses[number]


def raw_frames(folder: Path, numbers: Iterable[int]) -> Iterator[Frame]:
    """Frames of a drive in the layout of the raw data, synchronised and rectified; stamps are those of its images."""
    files = ("calib_cam_to_cam.txt", "calib_velo_to_cam.txt", "calib_imu_to_velo.txt")
    cameras, lidar, inertial = (rows(folder.parent / name) for name in files)
    rectified_from_camera = np.eye(4)
    rectified_from_camera[:3, :3] = cameras["R_rect_00"].reshape(3, 3)
    calibration = camera(cameras["P_rect_02"].reshape(3, 4), rectified_from_camera @ _rigid(lidar["R"], lidar["T"]))
    imu_from_lidar = frames.inverse(_rigid(inertial["R"], inertial["T"]))
    stamps_ns = [_stamp_ns(line) for line in (folder / "image_02" / "timestamps.txt").read_text().splitlines()]
    start: Array | None = None
    for number in numbers:
        name = f"{number:010d}"
        packet = np.loadtxt(folder / "oxts" / "data" / f"{name}.txt")
        start = packet if start is None else start
        start_from_lidar = frames.inverse(_world_from_imu(start, start) @ imu_from_lidar) @ (
            _world_from_imu(packet, start) @ imu_from_lidar
        )
        picture = (folder / "image_02" / "data" / f"{name}.png").read_bytes()
        points = _points(folder / "velodyne_points" / "data" / f"{name}.bin")
        yield Frame(number, stamps_ns[number], "png", picture, points, *calibration, frames.planar(start_from_lidar))


def read_poses(path: Path, numbers: Sequence[int]) -> dict[int, Array]:
    """Poses (3,) by frame, of the rows of a file; those of rows without a frame's number are of `numbers`, in order."""
    found = np.loadtxt(path, ndmin=2)
    if found.shape[1] not in (12, 13):
        raise ValueError(f"{path}: rows of {found.shape[1]} numbers; a pose has 12, or a frame's number before them")
    names = numbers if found.shape[1] == 12 else found[:, 0].astype(int).tolist()
    matrices = found[:, -12:].reshape(-1, 3, 4)
    return {
        name: frames.planar(np.vstack([matrix, [0, 0, 0, 1]])) for name, matrix in zip(names, matrices, strict=True)
    }


def write_log(path: Path, content: Iterable[Frame]) -> None:
    """Frames as a recording; with odometry, where they have poses."""
    mounts: list[Transform] = []
    names: dict[bytes, str] = {}
    with create_recording(path) as writer:
        for frame in content:
            # Frames of several drives have several calibrations; a name of its own keeps each camera where it was.
            key, stamp_ns = frame.camera_from_lidar.tobytes(), frame.stamp_ns
            if key not in names:
                names[key] = f"camera{len(names)}"
                mounts = mounts or [_mount(stamp_ns, "base_link", "velodyne", base_from_lidar())]
                mounts.append(_mount(stamp_ns, "velodyne", names[key], frames.inverse(frame.camera_from_lidar)))
                writer.add(Stamped(TF_STATIC, stamp_ns, TFMessage(tuple(mounts))))
            for message in _messages(frame, names[key]):
                writer.add(message)


def _messages(frame: Frame, name: str) -> Iterator[Stamped]:
    stamp_ns, k = frame.stamp_ns, frame.intrinsics
    width, height = frame.size_px
    projection = np.column_stack([k, np.zeros(3)])
    info = CameraInfo(stamp_ns, name, height, width, "plumb_bob", np.zeros(5), k, np.eye(3), projection)
    yield Stamped(CAMERA_INFO, stamp_ns, info)
    yield Stamped(CAMERA_IMAGE, stamp_ns, CompressedImage(stamp_ns, name, frame.format, frame.picture))
    yield Stamped(CLOUD, stamp_ns, PointCloud2(stamp_ns, "velodyne", frame.points_m.astype(np.float32)))
    if frame.pose is not None:
        odometry = Odometry.planar(stamp_ns, ("odom", "base_link"), frame.pose, np.zeros((3, 3)))
        yield Stamped(ODOMETRY, stamp_ns, odometry)


def base_from_lidar() -> Array:
    """Where the LiDAR sits above the road (4, 4)."""
    return frames.rigid([0.0, 0.0, LIDAR_M], [0.0, 0.0, 0.0, 1.0])


def object_calibration(path: Path) -> tuple[Array, Array]:
    """P2 (3, 4) and rectified_from_lidar (4, 4) of a file of the object or the tracking benchmark."""
    known = rows(path)
    rectified, mounted = np.eye(4), np.eye(4)
    rectified[:3, :3] = known["R0_rect" if "R0_rect" in known else "R_rect"].reshape(3, 3)
    mounted[:3] = known["Tr_velo_to_cam" if "Tr_velo_to_cam" in known else "Tr_velo_cam"].reshape(3, 4)
    return known["P2"].reshape(3, 4), rectified @ mounted


def camera(projection: Array, rectified_from_lidar: Array) -> tuple[Array, Array]:
    """K (3, 3) and camera_from_lidar (4, 4) of the camera with a projection (3, 4) from the rectified frame."""
    shifted = np.eye(4)
    shifted[:3, 3] = np.linalg.solve(projection[:, :3], projection[:, 3])
    turned = shifted @ rectified_from_lidar
    turned[:3, :3] = Rotation.from_matrix(turned[:3, :3]).as_matrix()  # the files round to seven digits
    return projection[:, :3], turned


def rows(path: Path) -> dict[str, Array]:
    """The rows of a file of calibrations, by their names; rows of words are left out."""
    found = {}
    for line in path.read_text().splitlines():
        key, *values = line.replace(":", " ").split() or [""]
        try:
            found[key] = np.array([float(value) for value in values])
        except ValueError:  # such as the time of the calibration
            continue
    return found


def _points(path: Path) -> Array:
    return np.fromfile(path, "<f4").reshape(-1, 4)[:, :3]


def _rigid(turn: Array, shift: Array) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn.reshape(3, 3), shift
    return matrix


def _mount(stamp_ns: int, parent: str, child: str, matrix: Array) -> Transform:
    return Transform(stamp_ns, parent, child, matrix[:3, 3], Rotation.from_matrix(matrix[:3, :3]).as_quat())


def _stamp_ns(line: str) -> int:
    """Nanoseconds of a line such as 2011-09-26 13:02:25.964389445."""
    whole, part = line.strip().split(".")
    seconds = int(datetime.strptime(whole, "%Y-%m-%d %H:%M:%S").replace(tzinfo=UTC).timestamp())
    return seconds * 10**9 + int(part.ljust(9, "0"))


def _world_from_imu(oxts: Array, start: Array) -> Array:
    """The pose (4, 4) of a packet: latitude, longitude, altitude, roll, pitch, yaw.

    By Mercator's projection, true to scale at the first packet, as in the development kit of KITTI.
    """
    latitude, longitude, altitude = oxts[:3].tolist()
    scale = np.cos(np.radians(start[0]))
    x = scale * np.radians(longitude) * _EARTH_M
    y = scale * _EARTH_M * np.log(np.tan(np.pi / 4 + np.radians(latitude) / 2))
    return _rigid(Rotation.from_euler("xyz", oxts[3:6]).as_matrix(), np.array([x, y, altitude]))


def main() -> None:
    """Write what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="frames in the object layout, or a raw drive")
    parser.add_argument("-o", "--output", type=Path, required=True, help="the recording")
    parser.add_argument("--poses", type=Path, help="poses of frames in the object layout that are one drive")
    parser.add_argument("--first", type=int, default=0, help="number of the first frame")
    parser.add_argument("--last", type=int, default=sys.maxsize, help="number of the last frame")
    asked = parser.parse_args()
    is_raw = (asked.folder / "velodyne_points").is_dir()
    clouds = asked.folder / ("velodyne_points/data" if is_raw else "velodyne")
    numbers = sorted(int(file.stem) for file in clouds.glob("*.bin"))
    numbers = [number for number in numbers if asked.first <= number <= asked.last]
    if not numbers:
        parser.error(f"{clouds} has no such clouds; give a folder in KITTI's object layout, or a drive of its raw data")
    try:
        if is_raw:
            write_log(asked.output, raw_frames(asked.folder, numbers))
        else:
            poses = read_poses(asked.poses, numbers) if asked.poses else None
            write_log(asked.output, object_frames(asked.folder, numbers, poses))
    except (OSError, ValueError, ToolkitError) as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
