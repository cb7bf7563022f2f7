"""Foxglove's types in protobuf and JSON convert to what the robot recorded in ROS 2."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.messages.codec import Message, decode
from mcap_landmarks.messages.images import CameraInfo, CompressedImage
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.recording.reader import open_recording

from tests.cases.steps import RECORDINGS
from tests.cli.calls import call

CASES = ("foxglove_json", "foxglove_protobuf", "foxglove_protobuf_ros_odom")
TYPES: dict[str, type[Message]] = {
    "/scan": LaserScan,
    "/camera/image_raw/compressed": CompressedImage,
    "/camera/camera_info": CameraInfo,
    "/tf_static": TFMessage,
}


def read(path: Path, topic: str) -> dict[int, Message]:
    with open_recording(path) as recording:
        raws = recording.messages(recording.connections(topic))
        return {raw.log_time_ns: decode(TYPES[topic], raw.data) for raw in raws}


def values(message: Message) -> list[object]:
    """What both formats tell; where nothing came back, JSON has null."""
    if isinstance(message, LaserScan):
        ranges = np.where(np.isfinite(message.ranges_m), message.ranges_m, 0)
        return [message.stamp_ns, message.frame_id, message.angle_min_rad, message.angle_max_rad, ranges.tolist()]
    if isinstance(message, CompressedImage):
        return [message.stamp_ns, message.frame_id, message.data]
    if isinstance(message, CameraInfo):
        matrices = message.distortion, message.intrinsics, message.rectification, message.projection
        return [message.stamp_ns, message.width_px, message.distortion_model, *(one.tolist() for one in matrices)]
    assert isinstance(message, TFMessage)
    return [
        [one.stamp_ns, one.frame_id, one.child_frame_id, one.translation_m.tolist(), one.rotation_xyzw.tolist()]
        for one in message.transforms
    ]


@pytest.mark.parametrize("name", CASES)
def test_what_was_recorded_comes_back(name: str, case_input: Callable[[str], Path], tmp_path: Path) -> None:
    output = tmp_path / "out.mcap"
    assert call("convert", case_input(name) / f"{name}.mcap", "-o", output) == 0
    for topic in TYPES:
        found, recorded = read(output, topic), read(RECORDINGS / "demo_localize.mcap", topic)
        assert found
        assert all(values(message) == values(recorded[time_ns]) for time_ns, message in found.items())
