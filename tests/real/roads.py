"""KITTI frames of the development set with their labels, as `docs/kitti.py` reads and writes frames."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.se2 import Array

from docs import kitti

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
class Labelled(kitti.Frame):
    """One moment with its labels."""

    labels: tuple[Label, ...] = ()


def single_frames(folder: Path, numbers: Iterable[int]) -> list[Labelled]:
    """Frames of KITTI's object benchmark, 20 s from each other so that nothing is taken for a drive."""
    found = []
    for frame in kitti.object_frames(folder, numbers):
        name = f"{frame.number:06d}.txt"
        _, rectified_from_lidar = kitti.object_calibration(folder / "calib" / name)
        lines = (folder / "label_2" / name).read_text().splitlines()
        labels = tuple(_label(line.split(), rectified_from_lidar) for line in lines if line.strip())
        found.append(_labelled(frame, labels))
    return found


def drive_frames(folder: Path, numbers: Iterable[int]) -> list[Labelled]:
    """Frames of the drive of parked cars, at 10 Hz; its clouds are packed."""
    projection, rectified_from_lidar = kitti.object_calibration(folder / "calib.txt")
    calibration = kitti.camera(projection, rectified_from_lidar)
    poses = kitti.read_poses(folder / "poses_kissicp_DERIVED.txt", ())
    rows = [line.split() for line in (folder / "label_02_0001.txt").read_text().splitlines()]
    found = []
    for number in numbers:
        with np.load(folder / "velo" / f"{number:06d}.npz") as cloud:
            points = cloud["xyz"] * float(cloud["scale"])
        own = [row for row in rows if int(row[0]) == number]
        labels = tuple(_label(row[2:], rectified_from_lidar, int(row[1])) for row in own)
        picture = (folder / "image" / f"{number:06d}.jpg").read_bytes()
        stamp_ns = (number + 1) * 10**8
        frame = kitti.Frame(number, stamp_ns, "jpeg", picture, points, *calibration, poses[number])
        found.append(_labelled(frame, labels))
    return found


def _labelled(frame: kitti.Frame, labels: tuple[Label, ...]) -> Labelled:
    return Labelled(*(getattr(frame, field.name) for field in fields(frame)), labels=labels)


def _label(words: Sequence[str], rectified_from_lidar: Array, track: int = -1) -> Label:
    box, (height, width, length), bottom = (np.array(words[i:j], dtype=float) for i, j in ((4, 8), (8, 11), (11, 14)))
    lidar_from_rectified = np.linalg.inv(rectified_from_lidar)
    centre = frames.apply(kitti.base_from_lidar() @ lidar_from_rectified, bottom - [0.0, height / 2, 0.0])
    ahead = lidar_from_rectified[:3, :3] @ [np.cos(float(words[14])), 0.0, -np.sin(float(words[14]))]
    return Label(words[0], box, centre, np.array([length, width, height]), float(np.arctan2(ahead[1], ahead[0])), track)
