"""MCAP files with messages of Foxglove's types in protobuf, JSON and CDR, written without the toolkit."""

import base64
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from google.protobuf import timestamp_pb2
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.json_format import ParseDict
from google.protobuf.message_factory import GetMessageClass
from mcap.writer import Writer

STAMP_NS = 1_700_000_000_250_000_000
STAMP = {"sec": STAMP_NS // 10**9, "nsec": STAMP_NS % 10**9}
Message = Mapping[str, object]

_KINDS = {
    "double": FieldDescriptorProto.TYPE_DOUBLE,
    "fixed32": FieldDescriptorProto.TYPE_FIXED32,
    "string": FieldDescriptorProto.TYPE_STRING,
    "bytes": FieldDescriptorProto.TYPE_BYTES,
    "time": FieldDescriptorProto.TYPE_MESSAGE,
}
_TYPES = {
    "Vector3": "x double, y double, z double",
    "Quaternion": "x double, y double, z double, w double",
    "Pose": "position Vector3, orientation Quaternion",
    "PackedElementField": "name string, offset fixed32, type fixed32",
    "FrameTransform": "timestamp time, parent_frame_id string, child_frame_id string, translation Vector3, "
    "rotation Quaternion",
    "FrameTransforms": "transforms FrameTransform*",
    "LaserScan": "timestamp time, frame_id string, pose Pose, start_angle double, end_angle double, ranges double*, "
    "intensities double*",
    "CompressedImage": "timestamp time, frame_id string, data bytes, format string",
    "CompressedVideo": "timestamp time, frame_id string, data bytes, format string",
    "RawImage": "timestamp time, frame_id string, width fixed32, height fixed32, encoding string, step fixed32, "
    "data bytes",
    "CameraCalibration": "timestamp time, frame_id string, width fixed32, height fixed32, distortion_model string, "
    "D double*, K double*, R double*, P double*",
    "PoseInFrame": "timestamp time, frame_id string, pose Pose",
    "PosesInFrame": "timestamp time, frame_id string, poses Pose*",
    "PointCloud": "timestamp time, frame_id string, pose Pose, point_stride fixed32, fields PackedElementField*, "
    "data bytes",
    "LocationFix": "timestamp time, frame_id string, latitude double, longitude double, altitude double, "
    "position_covariance double*, position_covariance_type fixed32",
    "Log": "timestamp time, level fixed32, message string, name string, file string, line fixed32",
    "Point2": "x double, y double",
    "Color": "r double, g double, b double, a double",
    "CircleAnnotation": "timestamp time, position Point2, diameter double, thickness double, fill_color Color",
    "ImageAnnotations": "circles CircleAnnotation*",
}  # fmt: skip


def fields(name: str) -> list[tuple[str, str, bool]]:
    """Name, kind and whether it is repeated, of each field of a type."""
    parts = (part.split() for part in _TYPES[name].split(", "))
    return [(field, kind.rstrip("*"), kind.endswith("*")) for field, kind in parts]


def descriptors(name: str, package: str = "foxglove", *, with_time: bool = True) -> FileDescriptorSet:
    """The schema of a type: one file for each type that it needs, those that others need last."""
    found: dict[str, FileDescriptorProto] = {}

    def add(one: str) -> None:
        file = found[one] = FileDescriptorProto(name=f"{package}/{one}.proto", package=package, syntax="proto3")
        message = file.message_type.add(name=one)
        for number, (field, kind, many) in enumerate(fields(one), 1):
            label = FieldDescriptorProto.LABEL_REPEATED if many else FieldDescriptorProto.LABEL_OPTIONAL
            entry = message.field.add(
                name=field, number=number, label=label, type=_KINDS.get(kind, FieldDescriptorProto.TYPE_MESSAGE)
            )
            needed = "google/protobuf/timestamp.proto" if kind == "time" else f"{package}/{kind}.proto"
            if kind == "time":
                entry.type_name = ".google.protobuf.Timestamp"
            elif kind in _TYPES:
                entry.type_name = f".{package}.{kind}"
                if kind not in found:
                    add(kind)
            if entry.type_name and needed not in file.dependency:
                file.dependency.append(needed)

    add(name)
    if with_time:
        time = FileDescriptorProto()
        timestamp_pb2.DESCRIPTOR.CopyToProto(time)
        return FileDescriptorSet(file=[*found.values(), time])
    return FileDescriptorSet(file=found.values())


def protobuf(name: str, message: Message) -> bytes:
    """A message by its fields, whose times are as in JSON."""
    pool = DescriptorPool()
    for file in reversed(descriptors(name).file):
        _add(pool, file, {one.name: one for one in descriptors(name).file})
    content = GetMessageClass(pool.FindMessageTypeByName(f"foxglove.{name}"))()
    return ParseDict(_plain(message, rfc_3339=True), content).SerializeToString()


def _add(pool: DescriptorPool, file: FileDescriptorProto, files: Mapping[str, FileDescriptorProto]) -> None:
    try:
        pool.FindFileByName(file.name)
    except KeyError:
        for needed in file.dependency:
            _add(pool, files[needed], files)
        pool.AddSerializedFile(file.SerializeToString())


def in_json(message: Message, *, rfc_3339: bool = False) -> bytes:
    """A message in JSON, with bytes in base64."""
    return json.dumps(_plain(message, rfc_3339=rfc_3339)).encode()


def _plain(value: object, *, rfc_3339: bool) -> object:
    if value == STAMP and rfc_3339:
        return "2023-11-14T22:13:20.250Z"
    if isinstance(value, Mapping):
        return {key: _plain(inner, rfc_3339=rfc_3339) for key, inner in value.items()}
    if isinstance(value, list):
        return [_plain(inner, rfc_3339=rfc_3339) for inner in value]
    return base64.b64encode(value).decode() if isinstance(value, bytes) else value


Topic = tuple[str, str, bytes, str, str, Sequence[bytes]]
"""Topic, name of the schema, schema, its encoding, that of the messages, and the messages."""


def write(path: Path, *topics: Topic) -> Path:
    """A file with a message of each topic every 0.1 s."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        for topic, name, schema, schema_encoding, encoding, messages in topics:
            schema_id = writer.register_schema(name, schema_encoding, schema)
            channel = writer.register_channel(topic, encoding, schema_id)
            for i, data in enumerate(messages):
                writer.add_message(channel, STAMP_NS + i * 10**8, data, STAMP_NS + i * 10**8)
        writer.finish()
    return path


def of_protobuf(topic: str, name: str, *messages: Message, schema: bytes | None = None) -> Topic:
    """A topic of one of Foxglove's types in protobuf."""
    text = descriptors(name).SerializeToString() if schema is None else schema
    return topic, f"foxglove.{name}", text, "protobuf", "protobuf", [protobuf(name, one) for one in messages]


def of_json(topic: str, name: str, *messages: Message) -> Topic:
    """The same in JSON."""
    schema = json.dumps({"title": f"foxglove.{name}", "type": "object"}).encode()
    return topic, f"foxglove.{name}", schema, "jsonschema", "json", [in_json(one) for one in messages]
