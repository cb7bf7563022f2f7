"""Foxglove's types and what stands for them in ROS 2: one table, and what fills in the fields of each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype

from mcap_landmarks.errors import MessageError
from mcap_landmarks.geometry.frames import apply, is_rigid, rigid
from mcap_landmarks.messages.definition_extent import FieldType
from mcap_landmarks.messages.parts import Array, header_to_ros, make, pose_to_ros, stamp_to_ros
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.messages.typestore import RosObject, full_name, typestore
from mcap_landmarks.sources._foxglove_fields import COVARIANCES, LEVELS, NUMBERS, FieldsOf, JsonFields
from mcap_landmarks.stage import Connection

NO_LIMIT_M = float(np.finfo(np.float32).max)
"""The range_max of scans whose limits nobody tells: with the largest number every range counts, and one that is
infinite still lies beyond, as REP 117 has it where nothing came back; `inf` as limit would let it count, too."""
_IMAGE_ENCODINGS = {"uyvy": "yuv422", "yuyv": "yuv422_yuy2"}
"""What ROS 2 calls them in every distribution."""
_DATATYPES = (0, 2, 1, 4, 3, 6, 5, 7, 8)
"""ROS's number of each type of a point's field, by Foxglove's: unknown, uint8, int8, uint16, int16, uint32, int32, and
floats of 32 and 64 bits."""
_FLOATS = {7: "<f4", 8: "<f8"}
_LEVELS = (10, 10, 20, 30, 40, 50)
"""ROS's level of each of Foxglove's: unknown, debug, info, warning, error, fatal."""
_TIMES = {"builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"}
_NOTHING = JsonFields({})
_PACKAGES = frozenset({"foxglove", "foxglove_msgs"})
_OWN_PACKAGE = "foxglove_msgs/msg/"


@dataclass(frozen=True, slots=True)
class Counterpart:
    """A ROS 2 type, what makes an object of it, and the fields that no message can be without."""

    ros_type: str
    build: Callable[[FieldsOf], RosObject]
    needs: tuple[str, ...] = ()


def pose_of(fields: FieldsOf | None) -> tuple[Array, Array]:
    """Position (3,) and quaternion (4,) x, y, z, w of a pose; no pose, or one of zeros only, is the origin."""
    if fields is None:
        return np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
    position, orientation = _vector(fields, "position", "xyz"), _vector(fields, "orientation", "xyzw")
    return position, orientation if orientation.any() else np.array([0.0, 0.0, 0.0, 1.0])


def _vector(fields: FieldsOf, name: str, axes: str) -> Array:
    part = fields.part(name)
    return np.zeros(len(axes)) if part is None else np.array([part.number(axis) for axis in axes])


def _header(fields: FieldsOf) -> RosObject:
    return header_to_ros(fields.time_ns("timestamp"), fields.text("frame_id"))


def _scan(fields: FieldsOf) -> RosObject:
    """Its pose is not in it: see `ScanFrame`."""
    ranges, first, last = fields.numbers("ranges"), fields.number("start_angle"), fields.number("end_angle")
    with np.errstate(over="ignore"):
        ranges_m, intensities = ranges.astype(np.float32), fields.numbers("intensities").astype(np.float32)
    step = (last - first) / max(len(ranges) - 1, 1)
    times, limits = (0.0, 0.0), (0.0, NO_LIMIT_M)
    stamp_ns, frame_id = fields.time_ns("timestamp"), fields.text("frame_id")
    return LaserScan(stamp_ns, frame_id, first, last, step, *times, *limits, ranges_m, intensities).to_ros()


def _compressed_image(fields: FieldsOf) -> RosObject:
    data = np.frombuffer(fields.data("data"), np.uint8)
    return make("sensor_msgs/CompressedImage", header=_header(fields), format=fields.text("format"), data=data)


def _image(fields: FieldsOf) -> RosObject:
    encoding = fields.text("encoding")
    return make(
        "sensor_msgs/Image",
        header=_header(fields),
        height=fields.integer("height"),
        width=fields.integer("width"),
        encoding=_IMAGE_ENCODINGS.get(encoding, encoding),
        is_bigendian=0,
        step=fields.integer("step"),
        data=np.frombuffer(fields.data("data"), np.uint8),
    )


def _camera_info(fields: FieldsOf) -> RosObject:
    """R and P may be left out, as of a camera that is alone."""
    intrinsics = _matrix(fields, "K", np.zeros((3, 3)))
    return make(
        "sensor_msgs/CameraInfo",
        header=_header(fields),
        height=fields.integer("height"),
        width=fields.integer("width"),
        distortion_model=fields.text("distortion_model"),
        d=fields.numbers("D"),
        k=intrinsics,
        r=_matrix(fields, "R", np.eye(3)),
        p=_matrix(fields, "P", np.column_stack([intrinsics.reshape(3, 3), np.zeros(3)])),
        binning_x=0,
        binning_y=0,
        roi=make("sensor_msgs/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )


def _matrix(fields: FieldsOf, name: str, instead: Array) -> Array:
    values = fields.numbers(name)
    if len(values) not in {0, instead.size}:
        raise MessageError(f"{name} has {len(values)} numbers, and not {instead.size}")
    return values if len(values) else instead.ravel()


def _transforms(fields: FieldsOf) -> RosObject:
    return TFMessage(tuple(_transform(part) for part in fields.parts("transforms"))).to_ros()


def _transform(fields: FieldsOf) -> Transform:
    fields.require("child_frame_id")
    frames = fields.text("parent_frame_id"), fields.text("child_frame_id")
    if not all(frames):
        raise MessageError("a transform does not name both of its frames")
    rotation = _vector(fields, "rotation", "xyzw")
    return Transform(fields.time_ns("timestamp"), *frames, _vector(fields, "translation", "xyz"), rotation)


def _pose(fields: FieldsOf) -> RosObject:
    return make("geometry_msgs/PoseStamped", header=_header(fields), pose=pose_to_ros(*pose_of(fields.part("pose"))))


def _poses(fields: FieldsOf) -> RosObject:
    poses = [pose_to_ros(*pose_of(part)) for part in fields.parts("poses")]
    return make("geometry_msgs/PoseArray", header=_header(fields), poses=poses)


def _cloud(fields: FieldsOf) -> RosObject:
    """Its points are put where its pose has them."""
    data, stride, parts = fields.data("data"), fields.integer("point_stride"), fields.parts("fields")
    if stride < 1:
        raise MessageError(f"points of {stride} bytes are none")
    points = np.frombuffer(data, np.uint8)[: len(data) // stride * stride].reshape(-1, stride)
    places = [(part.text("name"), part.integer("offset"), _datatype(part.choice("type", NUMBERS))) for part in parts]
    return make(
        "sensor_msgs/PointCloud2",
        header=_header(fields),
        height=1,
        width=len(points),
        fields=[make("sensor_msgs/PointField", name=n, offset=at, datatype=kind, count=1) for n, at, kind in places],
        is_bigendian=False,
        point_step=stride,
        row_step=points.size,
        data=_placed(points, places, pose_of(fields.part("pose"))).reshape(-1),
        is_dense=False,
    )


def _datatype(kind: int) -> int:
    if not 1 <= kind < len(_DATATYPES):
        raise MessageError(f"a field of points is of type {kind}, which there is not")
    return _DATATYPES[kind]


def _placed(
    points: NDArray[np.uint8], places: list[tuple[str, int, int]], pose: tuple[Array, Array]
) -> NDArray[np.uint8]:
    """Points (N, stride) in bytes, moved by a pose."""
    if is_origin(pose):
        return points
    columns = {name: (at, _FLOATS.get(kind, "")) for name, at, kind in places}
    if not all(columns.get(axis, (0, ""))[1] for axis in "xyz"):
        raise MessageError("a point cloud with a pose has no x, y and z in floats, which could be moved by it")
    points = points.copy()
    views = []
    for at, kind in (columns[axis] for axis in "xyz"):
        if at + int(kind[-1]) > points.shape[1]:
            raise MessageError("a field lies beyond the end of its point")
        views.append(np.ndarray((len(points),), kind, points.data, at, (points.shape[1],)))
    moved = apply(rigid(*pose), np.stack([np.asarray(view, np.float64) for view in views], axis=1))
    for view, values in zip(views, moved.T, strict=True):
        view[:] = values
    return points


def is_origin(pose: tuple[Array, Array]) -> bool:
    """Whether a pose is that of the frame itself.

    Raises:
        MessageError: it is none.
    """
    if not is_rigid(*pose):
        raise MessageError("its pose is none: it has no position or no orientation")
    return bool(np.abs(rigid(*pose) - np.eye(4)).max() < 1e-9)


def _fix(fields: FieldsOf) -> RosObject:
    """GNSS as the service, and a fix where there are numbers: Foxglove's type tells neither."""
    place = [fields.number(name) for name in ("latitude", "longitude", "altitude")]
    covariance = fields.numbers("position_covariance")
    if len(covariance) not in {0, 9}:
        raise MessageError(f"position_covariance has {len(covariance)} numbers, and not 9")
    return make(
        "sensor_msgs/NavSatFix",
        header=_header(fields),
        status=make("sensor_msgs/NavSatStatus", status=0 if np.isfinite(place[:2]).all() else -1, service=1),
        latitude=place[0],
        longitude=place[1],
        altitude=place[2],
        position_covariance=covariance if len(covariance) else np.zeros(9),
        position_covariance_type=fields.choice("position_covariance_type", COVARIANCES),
    )


def _log(fields: FieldsOf) -> RosObject:
    level = fields.choice("level", LEVELS)
    return make(
        "rcl_interfaces/Log",
        stamp=stamp_to_ros(fields.time_ns("timestamp")),
        level=_LEVELS[level] if 0 <= level < len(_LEVELS) else _LEVELS[0],
        name=fields.text("name"),
        msg=fields.text("message"),
        file=fields.text("file"),
        function="",
        line=fields.integer("line"),
    )


def _alike(ros_type: str) -> Callable[[FieldsOf], RosObject]:
    """Of a type that has the same fields in ROS 2."""

    def build(fields: FieldsOf) -> RosObject:
        kinds = typestore().fielddefs[full_name(ros_type)][1]
        return make(ros_type, **{name: _field(fields, name, kind) for name, kind in kinds})

    return build


def _field(fields: FieldsOf, name: str, kind: FieldType) -> object:
    node, content = kind
    if node == Nodetype.NAME:
        if content in _TIMES:
            seconds, rest = divmod(fields.time_ns(name), 10**9)
            return make(content, sec=seconds, nanosec=rest)
        return _alike(content)(fields.part(name) or _NOTHING)
    if node == Nodetype.BASE:
        if content[0] == "string":
            return fields.text(name)
        return fields.number(name) if content[0].startswith("float") else fields.integer(name)
    inner = content[0]
    if inner[0] == Nodetype.NAME:
        return [_alike(inner[1])(part) for part in fields.parts(name)]
    return np.frombuffer(fields.data(name), np.uint8) if inner[1][0] == "uint8" else fields.numbers(name)


COUNTERPARTS: Mapping[str, Counterpart] = {
    "LaserScan": Counterpart("sensor_msgs/msg/LaserScan", _scan, ("ranges",)),
    "CompressedImage": Counterpart("sensor_msgs/msg/CompressedImage", _compressed_image, ("data",)),
    "RawImage": Counterpart("sensor_msgs/msg/Image", _image, ("width", "height", "encoding", "data")),
    "CompressedVideo": Counterpart(
        "foxglove_msgs/msg/CompressedVideo", _alike("foxglove_msgs/CompressedVideo"), ("data", "format")
    ),
    "CameraCalibration": Counterpart("sensor_msgs/msg/CameraInfo", _camera_info, ("width", "height", "K")),
    "FrameTransform": Counterpart(
        "tf2_msgs/msg/TFMessage", lambda fields: TFMessage((_transform(fields),)).to_ros(), ("child_frame_id",)
    ),
    "FrameTransforms": Counterpart("tf2_msgs/msg/TFMessage", _transforms, ("transforms",)),
    "PoseInFrame": Counterpart("geometry_msgs/msg/PoseStamped", _pose, ("pose",)),
    "PosesInFrame": Counterpart("geometry_msgs/msg/PoseArray", _poses, ("poses",)),
    "PointCloud": Counterpart("sensor_msgs/msg/PointCloud2", _cloud, ("point_stride", "fields", "data")),
    "LocationFix": Counterpart("sensor_msgs/msg/NavSatFix", _fix, ("latitude", "longitude")),
    "Log": Counterpart("rcl_interfaces/msg/Log", _log, ("message",)),
    "ImageAnnotations": Counterpart("foxglove_msgs/msg/ImageAnnotations", _alike("foxglove_msgs/ImageAnnotations"), ()),
}
"""By the name that Foxglove gives the type; what is said nowhere in it is what ROS takes for unknown."""


def counterpart(connection: Connection) -> Counterpart | None:
    """What stands for the messages of a connection, None where they are not of a type of Foxglove that has one."""
    package, _, name = connection.message_type.replace("/msg/", ".").replace("/", ".").rpartition(".")
    if package.rpartition(".")[2] not in _PACKAGES or connection.message_encoding not in {"protobuf", "json", "cdr"}:
        return None
    found = COUNTERPARTS.get(name)
    if connection.message_encoding == "cdr" and found is not None and found.ros_type.startswith(_OWN_PACKAGE):
        return None  # as it is
    return found
