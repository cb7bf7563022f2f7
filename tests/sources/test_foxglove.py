"""Foxglove's types become their counterparts of ROS 2, whatever they are encoded in; what is none is told."""

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet
from mcap.reader import make_reader
from mcap_landmarks.errors import MessageError
from mcap_landmarks.inspection.info import describe
from mcap_landmarks.messages.typestore import RosObject, typestore
from mcap_landmarks.runs.conversion import Converted
from mcap_landmarks.sources._foxglove_fields import COVARIANCES, JsonFields
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.runs.conversion import doctor, one
from tests.sources.foxglove import (
    STAMP,
    STAMP_NS,
    Message,
    Topic,
    descriptors,
    in_json,
    of_json,
    of_protobuf,
    protobuf,
    write,
)

HEAD: Message = {"timestamp": STAMP, "frame_id": "camera"}
ORIGIN = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
TURNED = {"position": {"x": 1.0, "y": 2.0, "z": 0.5}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.6, "w": 0.8}}
SCAN: Message = {**HEAD, "pose": ORIGIN, "start_angle": -1.0, "end_angle": 1.0, "ranges": [1.0, 2.0, 3.0, 4.0, 0.1]}
POINTS = np.array([[1, 2, 3, 9], [4, 5, 6, 8]], np.float32)
MESSAGES: dict[str, Message] = {
    "LaserScan": {**SCAN, "intensities": [7.0] * 5},
    "CompressedImage": {**HEAD, "data": b"\xff\xd8 pixels", "format": "jpeg"},
    "CompressedVideo": {**HEAD, "data": b"\0\0\0\1", "format": "h264"},
    "RawImage": {**HEAD, "width": 2, "height": 1, "encoding": "yuyv", "step": 4, "data": b"\1\2\3\4"},
    "CameraCalibration": {**HEAD, "width": 640, "height": 480, "distortion_model": "plumb_bob",
                          "D": [0.1, 0.2, 0.0, 0.0, 0.0], "K": [500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0]},
    "FrameTransform": {"timestamp": STAMP, "parent_frame_id": "odom", "child_frame_id": "base",
                       "translation": TURNED["position"], "rotation": TURNED["orientation"]},
    "PoseInFrame": {**HEAD, "pose": TURNED},
    "PosesInFrame": {**HEAD, "poses": [TURNED, ORIGIN]},
    "PointCloud": {**HEAD, "pose": ORIGIN, "point_stride": 16, "data": POINTS.tobytes(), "fields": [
        {"name": name, "offset": 4 * i, "type": 7} for i, name in enumerate(("x", "y", "z", "intensity"))]},
    "LocationFix": {**HEAD, "latitude": 48.1, "longitude": 11.5, "altitude": 520.0,
                    "position_covariance": [1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0],
                    "position_covariance_type": 3},
    "Log": {"timestamp": STAMP, "level": 3, "message": "hot", "name": "motor", "file": "motor.py", "line": 7},
    "ImageAnnotations": {"circles": [{"timestamp": STAMP, "position": {"x": 3.0, "y": 4.0}, "diameter": 2.0,
                                      "thickness": 1.0, "fill_color": {"r": 1.0, "g": 0.0, "b": 0.0, "a": 0.5}}]},
}  # fmt: skip
MESSAGES["FrameTransforms"] = {"transforms": [MESSAGES["FrameTransform"], MESSAGES["FrameTransform"]]}
MEANT = {
    "LaserScan": "sensor_msgs/msg/LaserScan",
    "CompressedImage": "sensor_msgs/msg/CompressedImage",
    "CompressedVideo": "foxglove_msgs/msg/CompressedVideo",
    "RawImage": "sensor_msgs/msg/Image",
    "CameraCalibration": "sensor_msgs/msg/CameraInfo",
    "FrameTransform": "tf2_msgs/msg/TFMessage",
    "FrameTransforms": "tf2_msgs/msg/TFMessage",
    "PoseInFrame": "geometry_msgs/msg/PoseStamped",
    "PosesInFrame": "geometry_msgs/msg/PoseArray",
    "PointCloud": "sensor_msgs/msg/PointCloud2",
    "LocationFix": "sensor_msgs/msg/NavSatFix",
    "Log": "rcl_interfaces/msg/Log",
    "ImageAnnotations": "foxglove_msgs/msg/ImageAnnotations",
}


def read(path: Path) -> dict[str, list[RosObject]]:
    """The messages of a file by topic, as the mcap package reads them and rosbags decodes them."""
    found: dict[str, list[RosObject]] = {}
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            assert (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg")
            decoded = typestore().deserialize_cdr(message.data, schema.name)
            found.setdefault(channel.topic, []).append(decoded)
    return found


def convert(tmp_path: Path, *topics: Topic) -> tuple[Converted, dict[str, list[RosObject]]]:
    done = one(write(tmp_path / "in.mcap", *topics), tmp_path / "out.mcap")
    assert doctor(tmp_path / "out.mcap") == []
    return done, read(tmp_path / "out.mcap")


def pose_of(ros: RosObject) -> list[float]:
    place, turn = ros.position, ros.orientation
    return [place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]


@pytest.mark.parametrize("encoding", ["protobuf", "json"])
def test_every_type_becomes_its_counterpart(encoding: str, tmp_path: Path) -> None:
    make = of_protobuf if encoding == "protobuf" else of_json
    done, found = convert(tmp_path, *(make(f"/{name}", name, message) for name, message in MESSAGES.items()))
    assert (done.lost, done.losses, done.notes, done.topics.total()) == (0, [], [], len(MEANT))
    (scan,), (image,), (raw,), (info,) = (
        found[f"/{name}"] for name in ("LaserScan", "CompressedImage", "RawImage", "CameraCalibration")
    )
    for ros in (scan, image, raw, info):
        assert (ros.header.stamp.sec * 10**9 + ros.header.stamp.nanosec, ros.header.frame_id) == (STAMP_NS, "camera")
    assert (scan.angle_min, scan.angle_max, scan.angle_increment, scan.range_min) == (-1.0, 1.0, 0.5, 0.0)
    assert scan.ranges.tolist() == [1.0, 2.0, 3.0, 4.0, np.float32(0.1)]
    assert scan.intensities.tolist() == [7.0] * 5
    assert scan.range_max < np.inf
    assert (scan.ranges <= scan.range_max).all()
    assert (image.format, image.data.tobytes()) == ("jpeg", b"\xff\xd8 pixels")
    assert (raw.width, raw.height, raw.encoding, raw.step) == (2, 1, "yuv422_yuy2", 4)
    assert raw.data.tobytes() == b"\1\2\3\4"
    assert (info.width, info.height, info.distortion_model, info.d[1]) == (640, 480, "plumb_bob", 0.2)
    assert info.k.tolist() == MESSAGES["CameraCalibration"]["K"]
    assert info.r.tolist() == np.eye(3).ravel().tolist()
    assert info.p.tolist() == [500, 0, 320, 0, 0, 501, 240, 0, 0, 0, 1, 0]
    _check_places(found)
    (video,), (fix,), (log,) = found["/CompressedVideo"], found["/LocationFix"], found["/Log"]
    assert (video.format, video.data.tobytes(), video.timestamp.nanosec) == ("h264", b"\0\0\0\1", 250_000_000)
    assert (fix.latitude, fix.longitude, fix.altitude, fix.position_covariance_type) == (48.1, 11.5, 520.0, 3)
    assert (fix.status.status, fix.position_covariance[8]) == (0, 3.0)
    assert (log.level, log.msg, log.name, log.line) == (30, "hot", "motor", 7)
    (circle,) = found["/ImageAnnotations"][0].circles
    assert (circle.position.x, circle.position.y, circle.diameter, circle.fill_color.a) == (3.0, 4.0, 2.0, 0.5)


def _check_places(found: dict[str, list[RosObject]]) -> None:
    for topic, count in (("/FrameTransform", 1), ("/FrameTransforms", 2)):
        transforms = found[topic][0].transforms
        assert len(transforms) == count
        for ros in transforms:
            assert (ros.header.frame_id, ros.child_frame_id, ros.header.stamp.nanosec) == ("odom", "base", 250_000_000)
            assert (ros.transform.translation.y, ros.transform.rotation.z, ros.transform.rotation.w) == (2.0, 0.6, 0.8)
    (pose,), (poses,), (cloud,) = found["/PoseInFrame"], found["/PosesInFrame"], found["/PointCloud"]
    assert pose_of(pose.pose) == [1.0, 2.0, 0.5, 0.0, 0.0, 0.6, 0.8]
    assert [pose_of(ros) for ros in poses.poses] == [pose_of(pose.pose), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]
    assert [(field.name, field.offset, field.datatype, field.count) for field in cloud.fields] == [
        ("x", 0, 7, 1), ("y", 4, 7, 1), ("z", 8, 7, 1), ("intensity", 12, 7, 1)
    ]  # fmt: skip
    assert (cloud.height, cloud.width, cloud.point_step, cloud.row_step) == (1, 2, 16, 32)
    assert cloud.data.tobytes() == POINTS.tobytes()


def test_the_table_says_what_is_meant(tmp_path: Path) -> None:
    write(tmp_path / "in.mcap", *(of_json(f"/{name}", name, message) for name, message in MESSAGES.items()))
    one(tmp_path / "in.mcap", tmp_path / "out.mcap")
    with (tmp_path / "out.mcap").open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert summary is not None
        assert reader.get_header().profile == "ros2"
    types = {one.topic: summary.schemas[one.schema_id].name for one in summary.channels.values()}
    assert types == {f"/{name}": ros_type for name, ros_type in MEANT.items()}
    assert all("durability" in one.metadata["offered_qos_profiles"] for one in summary.channels.values())


def test_json_may_be_as_protobuf_writes_it(tmp_path: Path) -> None:
    """Names with capitals, times as text, numbers that are not finite as text; other writers have null for those."""
    other = {
        "timestamp": "2023-11-14T23:13:20.25+01:00", "frameId": "camera", "startAngle": -1, "endAngle": 1,
        "ranges": [1, "Infinity", None, "NaN", 0.5],
    }  # fmt: skip
    _, found = convert(tmp_path, of_json("/scan", "LaserScan", other))
    (scan,) = found["/scan"]
    assert (scan.header.frame_id, scan.angle_min, scan.header.stamp.nanosec) == ("camera", -1.0, 250_000_000)
    assert scan.header.stamp.sec == STAMP["sec"]
    assert np.array_equal(scan.ranges, np.array([1, np.inf, np.nan, np.nan, 0.5], np.float32), equal_nan=True)


def test_schemas_may_leave_out_what_every_library_has(tmp_path: Path) -> None:
    schema = descriptors("LaserScan", with_time=False).SerializeToString()
    done, found = convert(tmp_path, of_protobuf("/scan", "LaserScan", SCAN, schema=schema))
    assert (done.losses, len(found["/scan"])) == ([], 1)


def test_foxglove_messages_of_ros2_become_standard_ones(tmp_path: Path) -> None:
    text = (
        "builtin_interfaces/Time timestamp\nstring frame_id\nuint32 width\nuint32 height\nstring distortion_model\n"
        "float64[] d\nfloat64[9] k\nfloat64[9] r\nfloat64[12] p\n"
        f"{'=' * 80}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )
    name, store = "foxglove_msgs/msg/CameraCalibration", get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, name))
    time = store.types["builtin_interfaces/msg/Time"](sec=STAMP["sec"], nanosec=STAMP["nsec"])
    values = MESSAGES["CameraCalibration"]
    message = store.types[name](
        time, "camera", 640, 480, "plumb_bob", np.array(values["D"]), np.array(values["K"]), np.eye(3).ravel(),
        np.arange(12.0),
    )  # fmt: skip
    data = bytes(store.serialize_cdr(message, name))
    done, found = convert(tmp_path, ("/info", name, text.encode(), "ros2msg", "cdr", [data]))
    (info,) = found["/info"]
    assert (done.losses, info.k.tolist(), info.p[11]) == ([], values["K"], 11.0)


class TestScansWithAPose:
    """LaserScan has no pose: where it is not the frame's own, the scans get a frame of their own."""

    def test_a_transform_says_where_they_are(self, tmp_path: Path) -> None:
        scans = [{**SCAN, "pose": TURNED}] * 3
        static = {**MESSAGES["FrameTransform"], "parent_frame_id": "base", "child_frame_id": "camera"}
        topics = (
            of_protobuf("/front/scan", "LaserScan", *scans),
            of_protobuf("/tf_static", "FrameTransforms", {"transforms": [static]}),
        )
        done, found = convert(tmp_path, *topics)
        assert done.losses == []
        assert {ros.header.frame_id for ros in found["/front/scan"]} == {"camera/front/scan"}
        transforms = [ros for message in found["/tf_static"] for ros in message.transforms]
        (ours,) = (ros for ros in transforms if ros.child_frame_id == "camera/front/scan")
        assert (ours.header.frame_id, ours.transform.translation.x, ours.transform.rotation.z) == ("camera", 1.0, 0.6)
        assert len(transforms) == 2
        with (tmp_path / "out.mcap").open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        assert len(summary.channels) == 2
        (info,) = describe(tmp_path / "in.mcap", {})
        assert [one.message_type for one in info.channels] == ["foxglove.LaserScan", "foxglove.FrameTransforms"]

    def test_one_that_moves_is_told(self, tmp_path: Path) -> None:
        done, found = convert(tmp_path, of_json("/scan", "LaserScan", SCAN, {**SCAN, "pose": TURNED}, SCAN))
        assert (len(found["/scan"]), done.lost) == (2, 1)
        assert "another than that of the first scan" in done.losses[0]


def test_points_are_put_where_their_cloud_is(tmp_path: Path) -> None:
    """0.6, 0.8 is a turn by 2 atan(0.75): x = 0.28 x - 0.96 y, y = 0.96 x + 0.28 y."""
    _, found = convert(tmp_path, of_protobuf("/points", "PointCloud", {**MESSAGES["PointCloud"], "pose": TURNED}))
    points = np.frombuffer(found["/points"][0].data.tobytes(), np.float32).reshape(-1, 4)
    for moved, (x, y, z, rest) in zip(points, POINTS, strict=True):
        assert moved == pytest.approx([0.28 * x - 0.96 * y + 1, 0.96 * x + 0.28 * y + 2, z + 0.5, rest], abs=1e-5)


def test_other_channels_are_carried_as_they_are(tmp_path: Path) -> None:
    """Of a program's own JSON, of a type of Foxglove that ROS 2 has none for, and without any encoding."""
    grid = ("/grid", "foxglove.Grid", b"{}", "jsonschema", "json", [in_json({"data": b"abc"})])
    own = ("/own", "acme.LaserScan", b"schema", "protobuf", "protobuf", [b"\x08\x01", b"\x08\x02"])
    none = ("/none", "", b"", "", "", [b"bytes"])
    path = write(tmp_path / "in.mcap", grid, own, none, of_json("/scan", "LaserScan", SCAN))
    done = one(path, tmp_path / "out.mcap")
    assert (done.lost, done.topics) == (0, {"/grid": 1, "/own": 2, "/none": 1, "/scan": 1})
    (note,) = done.notes
    assert "no longer ros2" in note
    assert "/grid (json)" in note
    assert doctor(tmp_path / "out.mcap") == []
    with (tmp_path / "out.mcap").open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == ""
        found = [
            (schema.name if schema else None, channel.message_encoding, channel.metadata, message.data)
            for schema, channel, message in reader.iter_messages(["/own", "/none", "/grid"])
        ]
    assert ("acme.LaserScan", "protobuf", {}, b"\x08\x02") in found
    assert len(found) == 4


File = FileDescriptorProto


def _set(*files: File) -> bytes:
    return FileDescriptorSet(file=files).SerializeToString()


SOUND = list(descriptors("LaserScan").file)
HOSTILE = {
    "no descriptors": b"not a schema",
    "nothing": b"",
    "a missing file": _set(*(file for file in SOUND if not file.name.endswith("Pose.proto"))),
    "another type": descriptors("Log").SerializeToString(),
    "a type twice": _set(*SOUND, File(name="x.proto", package="foxglove", message_type=SOUND[0].message_type)),
    "files that need each other": _set(
        File(name="a.proto", dependency=["b.proto"]), File(name="b.proto", dependency=["a.proto"])
    ),
    "a tower": b"\x0a\xff\x7f" + b"\x22\xfd\x7f\x1a\xfa\x7f" * 2000,
    "other kinds of fields": _set(*(
        File.FromString(file.SerializeToString().replace(b"ranges", b"rangez")) for file in SOUND
    )),
}  # fmt: skip


def test_a_schema_that_cannot_be_understood_costs_its_topic(tmp_path: Path) -> None:
    topics = [of_protobuf(f"/{i}", "LaserScan", SCAN, SCAN, schema=schema) for i, schema in enumerate(HOSTILE.values())]
    path = write(tmp_path / "in.mcap", *topics, of_json("/ok", "LaserScan", SCAN))
    done = one(path, tmp_path / "out.mcap")
    *of_schemas, of_fields = [topic[0] for topic in topics]
    assert sorted(topic.topic for topic in done.left_out) == of_schemas
    assert done.topics == {"/ok": 1, of_fields: 0}
    assert (done.lost, len(done.losses)) == (2 * len(topics), 1)


WRONG: dict[str, tuple[str, Sequence[bytes]]] = {
    "no protobuf": ("protobuf", [b"\xff" * 9]),
    "a tower of groups": ("protobuf", [b"\x0b" * 5000]),
    "cut short": ("protobuf", [protobuf("LaserScan", SCAN)[:-3]]),
    "no JSON": ("json", [b"{"]),
    "a tower of lists": ("json", [b"[" * 100_000]),
    "a list": ("json", [b"[1]"]),
    "no ranges": ("json", [b'{"ranges": null}']),
    "ranges of text": ("json", [b'{"ranges": ["far"]}']),
    "a range": ("json", [b'{"ranges": 3}']),
    "an angle of text": ("json", [b'{"ranges": [], "start_angle": "left"}']),
    "a pose of nothing": ("json", [in_json({**SCAN, "pose": {"position": {"x": float("nan")}}})]),
    "a time of text": ("json", [in_json({**SCAN, "timestamp": "soon"})]),
    "a time of millennia": ("json", [in_json({**SCAN, "timestamp": {"sec": 2**40, "nsec": 0}})]),
}


def test_a_message_that_is_none_is_counted(tmp_path: Path) -> None:
    topics = []
    for i, (encoding, messages) in enumerate(WRONG.values()):
        good = (of_protobuf if encoding == "protobuf" else of_json)(f"/{i}", "LaserScan", SCAN)
        topics.append((*good[:-1], [*good[-1], *messages]))
    done = one(write(tmp_path / "in.mcap", *topics), tmp_path / "out.mcap")
    assert done.topics == {topic[0]: 1 for topic in topics}
    assert (done.lost, len(done.losses)) == (len(topics), len(topics))


def test_many_parts_are_refused_before_they_are_objects(tmp_path: Path) -> None:
    many = struct.pack("<BB", 0x1A, 0) * 70_000
    topic = of_protobuf("/poses", "PosesInFrame", MESSAGES["PosesInFrame"])
    done = one(write(tmp_path / "in.mcap", (*topic[:-1], [*topic[-1], many])), tmp_path / "out.mcap")
    assert (done.topics["/poses"], done.lost) == (1, 1)
    assert "70000" in done.losses[0]


def test_numbers_with_names_may_be_their_names() -> None:
    """As protobuf's own JSON has them."""
    fields = JsonFields({"type": "DIAGONAL_KNOWN", "other": 3, "none": "KNOWN TO NOBODY"})
    assert (fields.choice("type", COVARIANCES), fields.choice("other", COVARIANCES)) == (2, 3)
    with pytest.raises(MessageError, match="none is no number"):
        fields.choice("none", COVARIANCES)
