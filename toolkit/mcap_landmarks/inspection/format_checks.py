"""Topics whose messages no stage reads as they are: of ROS 1, of other encodings, of types made or named otherwise."""

from collections.abc import Collection, Iterator, Sequence
from importlib.util import find_spec

from mcap_landmarks.inspection.finding import Finding
from mcap_landmarks.messages.typestore import full_name
from mcap_landmarks.messages.video import CompressedVideo, TheoraPacket
from mcap_landmarks.sources import counterpart
from mcap_landmarks.stage import ChannelSummary, Connection
from mcap_landmarks.vision.video_decoder import INSTALL

_CONVERT = "convert it first: mcap-landmarks convert LOG -o OUT.mcap"
_SENSED = (
    "LaserScan", "MultiEchoLaserScan", "PointCloud2", "PointCloud", "CompressedImage", "Image", "RawImage",
    "CameraInfo", "CameraCalibration", "Odometry", "PoseStamped", "PoseInFrame", "TFMessage", "FrameTransform",
    "FrameTransforms", "Detection2DArray", "Detection3DArray",
)  # fmt: skip
"""What the types are called, in ROS and in Foxglove's schemas, that stages could use; scans first."""


def check_formats(channels: Sequence[ChannelSummary]) -> Iterator[Finding]:
    """The topics of a log that stages would read if they were of CDR, as ROS 2 writes it, and named as there."""
    sensed = [entry.connection for entry in channels if _name(entry.connection) in _SENSED]
    for connection in sorted(sensed, key=lambda one: _SENSED.index(_name(one))):
        problem = unread(connection)
        if problem:
            yield Finding("problem", "format", connection.topic, *problem)
        elif not connection.schema:
            text = f"it has no definition of {connection.message_type}"
            yield Finding("warning", "format", connection.topic, text, "stages read it; other tools cannot")


def check_videos(images: Collection[str], channels: Sequence[ChannelSummary]) -> Iterator[Finding]:
    """Of the topics that are read as images, those with videos that cannot be decoded here."""
    if find_spec("av") is None:
        for connection in (entry.connection for entry in channels if entry.connection.topic in images):
            if connection.read_as in {CompressedVideo.ROS_TYPE, TheoraPacket.ROS_TYPE}:
                text = "it is a video, which is read with PyAV, and that is not installed"
                yield Finding("problem", "image", connection.topic, text, INSTALL)


def _name(connection: Connection) -> str:
    """The last part of a type's name."""
    return connection.message_type.replace(".", "/").rpartition("/")[2]


def unread(connection: Connection) -> tuple[str, str] | None:
    """Why no stage reads a connection, and what to do; None where nothing is in the way."""
    encoding, ros_type = connection.message_encoding, connection.message_type
    if encoding == "ros1":
        return f"its messages ({ros_type}) are of ROS 1", _CONVERT
    becomes = counterpart(connection)
    if encoding != "cdr":
        what = f"its messages ({ros_type}) are {encoding or 'of no named encoding'}, and only CDR is read"
        return what, _CONVERT if becomes else "record the log as ROS 2 messages in CDR"
    if becomes:
        return f"its messages are of Foxglove's type {ros_type}, in place of {becomes.ros_type}", _CONVERT
    if full_name(ros_type) != ros_type:
        return f"its type is called {ros_type} in place of {full_name(ros_type)}", _CONVERT
    return None


def told_formats(channels: Sequence[ChannelSummary]) -> str:
    """What is to be said of such topics where something is missing: the first of them, with what to do; else empty."""
    found = [one for one in check_formats(channels) if one.level == "problem"]
    others = f" (and {len(found) - 1} more such topics)" if len(found) > 1 else ""
    return f"{found[0].topic}{others}: {found[0].text}; {found[0].remedy}" if found else ""
