"""What fuzzing begins with: small valid inputs of every target, written anew each time."""

import io
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

from mcap.writer import CompressionType, IndexType, Writer
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.maps.exchange import export_map
from mcap_landmarks.messages.typestore import definition

from tests.fuzz.targets import ENCODINGS, FORMS, FOXGLOVE, KINDS, PARTS, message_types
from tests.maps.examples import small_map
from tests.sources import bags, foxglove

STRING = b"\0\1\0\0\5\0\0\0word\0"


def recordings() -> Iterator[bytes]:
    """MCAP files without checksums, so that what is changed is read, of every compression and without summary."""
    for compression in CompressionType:
        for summary in (True, False):
            stream = io.BytesIO()
            kinds = IndexType.ALL if summary else IndexType.NONE
            writer = Writer(
                stream, 200, compression, enable_crcs=False, index_types=kinds, use_statistics=summary,
                use_summary_offsets=summary, repeat_channels=summary, repeat_schemas=summary,
                use_chunking=compression is not CompressionType.NONE or summary,
            )  # fmt: skip
            writer.start("ros2", "fuzz")
            text = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
            scan = writer.register_schema(
                "sensor_msgs/msg/LaserScan", "ros2msg", definition("sensor_msgs/msg/LaserScan").encode()
            )
            channels = [writer.register_channel("/talk", "cdr", text), writer.register_channel("/scan", "cdr", scan)]
            for i, time_ns in enumerate(bags.times(4)):
                beams = bytes(
                    bags.HUMBLE.serialize_cdr(bags.scan(bags.HUMBLE, time_ns, 3), "sensor_msgs/msg/LaserScan")
                )
                writer.add_message(channels[i % 2], time_ns, beams if i % 2 else STRING, time_ns, i)
            writer.add_attachment(1, 1, "notes.txt", "text/plain", b"what was seen")
            writer.add_metadata("rosbag2", {"serialized_metadata": "ros_distro: humble\ncustom_data:\n  a: b\n"})
            writer.finish()
            yield stream.getvalue()


def _in_folder(folder: Path) -> Iterator[tuple[str, bytes]]:
    for compression in (None, "bz2", "lz4"):
        yield "bag", bags.write_ros1(folder / f"{compression}.bag", 2, compression, 200).read_bytes()
    yield "db3", bags.write_plain_db3(folder / "plain.db3", 2).read_bytes()
    for mode in (None, "message"):
        bag = bags.write_ros2(folder / f"bag_{mode}", "sqlite3", mode, 2)
        content = next(bag.glob("*.db3*")).read_bytes()
        yield "db3", content
        yield "rosbag2", (bag / "metadata.yaml").read_bytes() + PARTS + content
    for number, form in enumerate(FORMS):
        export_map(folder / f"map.{form}", small_map(), form)
        yield "maps", bytes([number]) + (folder / f"map.{form}").read_bytes()
    write_map(folder / "map.db", small_map())
    yield "databases", (folder / "map.db").read_bytes()


def _foxglove() -> Iterator[bytes]:
    fields = {
        "LaserScan": {"ranges": [1.0, 2.0], "start_angle": 0.0, "end_angle": 1.0, "intensities": []},
        "FrameTransforms": {"transforms": [{"parent_frame_id": "a", "child_frame_id": "b", "rotation": {"w": 1.0}}]},
        "PointCloud": {"point_stride": 4, "fields": [{"name": "x", "offset": 0, "type": 7}], "data": bytes(8)},
        "CameraCalibration": {"K": [1.0] * 9, "width": 4, "height": 4},
        "RawImage": {"width": 2, "height": 2, "step": 2, "encoding": "mono8", "data": bytes(4)},
        "CompressedImage": {"format": "png", "data": bytes(4)},
        "PoseInFrame": {"pose": {"position": {"x": 1.0}}},
        "LocationFix": {"latitude": 1.0, "position_covariance": [1.0] * 9, "position_covariance_type": 2},
    }
    for name, message in fields.items():
        given = {"timestamp": foxglove.STAMP, "frame_id": "a"} | message if name != "FrameTransforms" else message
        place = FOXGLOVE.index(name)
        protobuf = foxglove.descriptors(name).SerializeToString() + PARTS + foxglove.protobuf(name, given)
        yield bytes([ENCODINGS.index("protobuf"), place]) + protobuf
        yield bytes([ENCODINGS.index("json"), place]) + PARTS + foxglove.in_json(given)


def _definitions() -> Iterator[bytes]:
    nested = f"{'=' * 80}\nMSG: odd/Other\nfloat64[3] p\nstring<=5 s\n"
    texts = {
        "msg": f"uint8 LEVEL=3\nodd/Other[] others\nstring n \"a\"\nbool[<=4] flags\nstd_msgs/Header header\n{nested}",
        "ros1": f"Header header\nodd/Other[2] others\ntime t\nstring A=b # c\n{nested}",
        "idl": "module odd { module msg { struct Thing { sequence<double, 3> p; string<5> s; long a[2]; }; }; };",
        "srv": "uint8 a\n---\nstring b\n",
        "action": "uint8 a\n---\nstring b\n---\nfloat32 c\n",
    }  # fmt: skip
    for kind, text in texts.items():
        yield bytes([KINDS.index(kind)]) + text.encode() + PARTS + b"\0\1\0\0" + bytes(40)


def seeds() -> Iterator[tuple[str, bytes]]:
    """Every input, with the name of its target."""
    yield from (("mcap", content) for content in recordings())
    with tempfile.TemporaryDirectory() as name:
        yield from _in_folder(Path(name))
    for number in range(len(message_types())):
        yield "cdr", bytes([number]) + b"\0\1\0\0" + bytes(200)
    yield from (("definitions", content) for content in _definitions())
    yield from (("foxglove", content) for content in _foxglove())
    edge = {"parent": "base_link", "child": "laser", "xyz": [0.1, 0.0, 0.2], "rpy": [0.0, 0.0, 3.1]}
    toml = '[[transforms]]\nparent = "a"\nchild = "b"\nxyz = [0.1, 0, 1e3]\nquaternion = [0, 0, 0, 1]\n'
    yield "settings", b"\0" + toml.encode()
    yield "settings", b"\1" + json.dumps({"transforms": [edge]}).encode()
    yield "settings", b'\2[localize]\nmax_sigma_m = 0.3\n[fuse]\nbearing_gate = 4\n[detect]\nmodel = "a.onnx"\n'


def write(folder: Path) -> None:
    """Put every input into the folder of its target."""
    for number, (target, content) in enumerate(seeds()):
        (folder / target).mkdir(parents=True, exist_ok=True)
        (folder / target / f"seed_{number}").write_bytes(content)
