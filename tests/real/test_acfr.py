"""A fisheye camera and a VLP-16 in a workshop: people that the stock YOLOv5n finds become objects where they stand."""

import csv
import io
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_IMAGE, CAMERA_INFO, DETECTIONS, SCENE_OBJECTS, TF_STATIC
from mcap_landmarks.cli.main import run
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.camera import CameraModel
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.codec import Message, decode
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo, CompressedImage
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Channel, Stamped
from scipy.spatial.transform import Rotation

pytestmark = pytest.mark.slow

SHOTS = (1, 5, 10, 15, 20, 25, 30, 35)
SIZE_PX = (1920, 1208)
STEP_NS = 20 * 10**9
CLOUD = Channel("/velodyne/points", PointCloud2)
SLICE_M = (0.35, 0.75)
"""Between ankles and hips."""
LEG_M = 0.08
FLOOR_IN_LIDAR = np.array([-0.118, 0.007, 0.993])
LIDAR_M = 1.605
"""The floor's normal and the LiDAR's height above it: a plane through the points of the floor."""
LAMPS_PX = 215.0
"""The lamps under the ceiling are above this row, and nobody is."""
LEAST_SCORE = 0.5
"""The network is sure of a person; below, it has two more guesses behind a board and an orange thing by the wall."""


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """The camera, base_from_lidar and lidar_from_camera (4, 4)."""

    camera: CameraModel
    intrinsics: Array
    distortion: Array
    base_from_lidar: Array
    lidar_from_camera: Array


def rig(archive: zipfile.ZipFile) -> Rig:
    """The calibration as the data's README describes it, and the LiDAR's tilt from the floor."""
    lines = dict(
        line.split(":", 1) for line in archive.read("acfr_vlp16_camera/camera_info.yaml").decode().splitlines()
    )
    intrinsics, distortion = (
        np.array([float(number) for number in lines[key].strip(" []").split(",")]) for key in ("K", "D")
    )
    rows = list(csv.reader(io.StringIO(archive.read("acfr_vlp16_camera/calibration_quickstart.csv").decode())))
    roll, pitch, yaw, *place = np.array(rows[1:], dtype=np.float64).mean(axis=0).tolist()
    lidar_from_camera = frames.rigid(place, Rotation.from_euler("xyz", [roll, pitch, yaw]).as_quat())
    up = FLOOR_IN_LIDAR / np.linalg.norm(FLOOR_IN_LIDAR)
    ahead = np.array([1.0, 0.0, 0.0]) - up[0] * up
    ahead /= np.linalg.norm(ahead)
    level = Rotation.from_matrix(np.stack([ahead, np.cross(up, ahead), up])).as_quat()
    matrix = intrinsics.reshape(3, 3)
    camera = CameraModel.of("fisheye", SIZE_PX, matrix, distortion)
    return Rig(camera, matrix, distortion, frames.rigid([0.0, 0.0, LIDAR_M], level), lidar_from_camera)


def shots(archive: zipfile.ZipFile) -> Iterator[tuple[int, bytes, Array]]:
    """Stamp, PNG and points (N, 3) of every shot."""
    for i, number in enumerate(SHOTS):
        picture = archive.read(f"acfr_vlp16_camera/pose{number}.png")
        text = archive.read(f"acfr_vlp16_camera/pose{number}_full.pcd").decode()
        yield (i + 1) * STEP_NS, picture, np.loadtxt(io.StringIO(text), skiprows=11)[:, :3]


def write_log(path: Path, archive: zipfile.ZipFile) -> None:
    """The shots as a recording, twenty seconds from each other: of every one an image and a point cloud."""
    found = rig(archive)
    mounts = []
    for parent, child, matrix in (
        ("base_footprint", "velodyne", found.base_from_lidar),
        ("velodyne", "camera", found.lidar_from_camera),
    ):
        turn = Rotation.from_matrix(matrix[:3, :3]).as_quat()
        mounts.append(Transform(STEP_NS, parent, child, matrix[:3, 3], turn))
    with create_recording(path) as writer:
        writer.add(Stamped(TF_STATIC, STEP_NS, TFMessage(tuple(mounts))))
        for stamp_ns, picture, points in shots(archive):
            info = CameraInfo(
                stamp_ns,
                "camera",
                SIZE_PX[1],
                SIZE_PX[0],
                "fisheye",
                found.distortion,
                found.intrinsics,
                np.eye(3),
                np.column_stack([found.intrinsics, np.zeros(3)]),
            )
            writer.add(Stamped(CAMERA_INFO, stamp_ns, info))
            writer.add(Stamped(CAMERA_IMAGE, stamp_ns, CompressedImage(stamp_ns, "camera", "png", picture)))
            writer.add(Stamped(CLOUD, stamp_ns, PointCloud2(stamp_ns, "velodyne", points.astype(np.float32))))


def place_of(box: Array, found: Rig, points: Array) -> Array | None:
    """Where (2,) the legs of a person in a box are, by the points (N, 3) of the slice alone; None if there are none."""
    camera_from_base = frames.inverse(found.base_from_lidar @ found.lidar_from_camera)
    pixels = found.camera.project(frames.apply(camera_from_base, points))
    margin = np.array([0.1 * (box[2] - box[0]), 0.0])
    shown = ((pixels > box[:2] + margin) & (pixels < box[2:] - margin)).all(axis=1)
    seen = points[shown, :2]
    if len(seen) < 3:
        return None
    away = np.hypot(seen[:, 0], seen[:, 1])
    groups = [(away >= nearest) & (away < nearest + 0.4) for nearest in away]
    middle: Array = seen[max(groups, key=np.count_nonzero)].mean(axis=0)
    # Of a leg the LiDAR meets the near half, whose middle is this far before the leg's.
    return middle * (1 + np.pi / 4 * LEG_M / np.hypot(*middle))


@pytest.fixture(scope="module")
def output(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shots with what the stages make of them."""
    archive, model = shared_data / "acfr_vlp16_camera.zip", shared_data / "models" / "yolov5n-coco.onnx"
    if not (archive.exists() and model.exists()):
        pytest.skip("no acfr_vlp16_camera.zip or no yolov5n-coco.onnx in the folder of data")
    folder = tmp_path_factory.mktemp("acfr")
    with zipfile.ZipFile(archive) as content:
        write_log(folder / "log.mcap", content)
    log, out, low, high = folder / "log.mcap", folder / "out.mcap", *SLICE_M
    options = ["--model", str(model), "--scan", CLOUD.topic, "--set", f"cluster.slice_m=[{low}, {high}]"]
    options += ["--stages", "detect,cluster,fuse"]
    with pytest.raises(SystemExit) as done:
        run(["run", str(log), "-o", str(out), *options])
    assert done.value.code == 0
    return out


def read(path: Path, channel: Channel[Message]) -> list[Any]:
    with open_recording(path) as recording:
        raws = recording.messages(recording.connections(channel.topic))
        return [decode(channel.message, raw.data) for raw in raws]


def test_people_become_objects_where_they_stand(shared_data: Path, output: Path) -> None:
    images: list[Detections] = read(output, DETECTIONS)
    scenes: list[SceneObjects] = read(output, SCENE_OBJECTS)
    with zipfile.ZipFile(shared_data / "acfr_vlp16_camera.zip") as content:
        found, clouds = rig(content), [points for _, _, points in shots(content)]
    errors_m = []
    for number, image, scene, cloud in zip(SHOTS, images, scenes, clouds, strict=True):
        points = frames.apply(found.base_from_lidar, cloud)
        points = points[(points[:, 2] > SLICE_M[0]) & (points[:, 2] < SLICE_M[1])]
        people = scene.positions_xy[[name == "person" for name in scene.classes]]
        for box, options in zip(image.boxes_xyxy, image.hypotheses, strict=True):
            name, score = options[0]
            if name != "person" or score < LEAST_SCORE:
                continue
            place = place_of(box, found, points)
            assert place is not None, (number, box)
            away = np.hypot(*(people - place).T)
            assert (away < 0.5).sum() == 1, (number, box, place, people)
            errors_m.append(away.min())
    assert len(errors_m) == 11
    assert max(errors_m) <= 0.15


def test_lamps_become_nothing(output: Path) -> None:
    images: list[Detections] = read(output, DETECTIONS)
    scenes: list[SceneObjects] = read(output, SCENE_OBJECTS)
    lamps = [
        options[0][0]
        for image in images
        for box, options in zip(image.boxes_xyxy, image.hypotheses, strict=True)
        if box[3] < LAMPS_PX
    ]
    assert {"boat", "car"} <= {*lamps}
    assert len(lamps) > 10
    assert not {"boat", "car"} & {name for scene in scenes for name in scene.classes}
