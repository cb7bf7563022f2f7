"""The page of a log of an hour: how long it takes to write, and how large it is.

The log repeats the golden results of the demo and what its robot recorded then, with the stamps moved: 36,000 bundles
at 10 Hz, each with an image, a scan, detections, clusters, objects, match and pose. The verb runs in a process.
"""

import json
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from mcap_landmarks import channels
from mcap_landmarks.messages.codec import Message, decode, encode
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.messages.match import Condition, LandmarkMatch, Status
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import RecordingWriter, create_recording
from mcap_landmarks.resources import resource
from mcap_landmarks.stage import Channel, RawMessage

from tests.benchmark.rows import Row

BUNDLES, STEP_NS, START_NS = 36_000, 10**8, 1_700_000_000 * 10**9
SECONDS, MEGABYTES = 30.0, 15.0
FAILING = 50
"""One in so many bundles is not localized."""
_GOLDEN = Path(__file__).parents[1] / "golden" / "localize.mcap"
_OF_BUNDLE = (
    channels.SCAN,
    channels.SCAN_OBJECTS,
    channels.SCENE_OBJECTS,
    channels.MATCH,
    channels.POSE,
    channels.POSE_COVARIANCE,
)
_OF_IMAGE = (channels.CAMERA_IMAGE, channels.CAMERA_INFO, channels.DETECTIONS, channels.TRUTH_DETECTIONS)
_OF_POSE = (channels.POSE, channels.POSE_COVARIANCE)
_ONCE = (channels.MAP, channels.TRUTH_OBJECTS, channels.TF_STATIC)
_STAGES: dict[Channel[Message], str] = {
    channels.DETECTIONS: "detect",
    channels.SCAN_OBJECTS: "cluster",
    channels.SCENE_OBJECTS: "fuse",
    **dict.fromkeys((channels.MAP, channels.MATCH, channels.POSE, channels.POSE_COVARIANCE), "localize"),
}
"""Which stage writes which channel: results of each lie in chunks of their own."""
_BUNDLES, _MOVED = 49, 60
"""Bundles of the golden results, and how often each image is there."""
_END_NS = 1_767_225_610 * 10**9
_CHILD = "import sys; from mcap_landmarks.cli.main import run; run(['report', *sys.argv[1:], '--json'])"


def page_hour(quick: bool) -> Iterator[Row]:
    """Seconds and size of the page; quick: of ten minutes, the seconds then as if of an hour."""
    count = BUNDLES // 6 if quick else BUNDLES
    with tempfile.TemporaryDirectory() as name:
        log, page = Path(name) / "hour.mcap", Path(name) / "page.html"
        write_hour(log, count)
        start = time.perf_counter()
        command = [sys.executable, "-c", _CHILD, str(log), "-o", str(page)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        seconds = time.perf_counter() - start
        told = json.loads(done.stdout)["results"][0]
        if told["all"] != count:
            raise RuntimeError(f"the page is of {told['all']} bundles instead of {count}")
        peers = {
            "log in MB": log.stat().st_size / 1e6,
            **{key: float(told[key]) for key in ("shown", "detailed", "pictures")},
        }
        yield Row("page_hour", seconds, "s", at_most=SECONDS, cases=count, peers=peers)
        yield Row("page_hour size", page.stat().st_size / 1e6, "MB", at_most=MEGABYTES, cases=count)


def write_hour(path: Path, count: int) -> None:
    """Write a log of so many bundles: messages are encoded once, and their stamps written over."""
    found = _sources()
    with create_recording(path) as writer:
        for channel in _ONCE:
            _add(writer, channel, START_NS, found[channel][0])
        for i in range(count):
            now = START_NS + i * STEP_NS
            for channel in (channels.ODOMETRY, channels.TRUTH_POSE):
                for part in range(3):
                    _add(writer, channel, now + part * STEP_NS // 3, _at(found[channel], 3 * i + part, 3 * _BUNDLES))
            for channel in (*_OF_IMAGE, *_OF_BUNDLE):
                if channel == channels.MATCH and i % FAILING == 1:
                    _add(writer, channel, now, _failed())
                elif channel not in _OF_POSE or i % FAILING != 1:
                    _add(writer, channel, now, _at(found[channel], i, len(found[channel])))


def _at(rows: list[bytes], place: int, whole: int) -> bytes:
    """One of some messages that are spread evenly over so many places, which are gone through again and again."""
    return rows[place % whole * len(rows) // whole]


def _add(writer: RecordingWriter, channel: Channel[Message], stamp_ns: int, data: bytes) -> None:
    connection = writer.connection(channel, _STAGES.get(channel, ""))
    stamped = data[:4] + struct.pack("<iI", *divmod(stamp_ns, 10**9)) + data[12:]
    writer.write(RawMessage(connection, stamp_ns, stamp_ns, 0, stamped if channel not in _ONCE else data))


@cache
def _failed() -> bytes:
    conditions = (Condition("expected_accidental", 0.3, 2e-3, held=False),)
    return encode(LandmarkMatch(START_NS, "base_footprint", Status.AMBIGUOUS, conditions=conditions))


def _sources() -> dict[Channel[Message], list[bytes]]:
    """The messages of every channel, in the order of time, of the first ten seconds of the demo and their results.

    Images are there many times, each moved to the side by another number of pixels: none is like another.
    """
    wanted = (*_OF_BUNDLE, *_OF_IMAGE, *_ONCE, channels.ODOMETRY, channels.TRUTH_POSE)
    found: dict[Channel[Message], list[bytes]] = {channel: [] for channel in wanted}
    by_topic = {channel.topic: channel for channel in wanted}
    for log in (resource("recordings", "demo_localize.mcap"), _GOLDEN):
        with open_recording(log) as recording:
            for raw in recording.messages(end_ns=_END_NS):
                channel = by_topic.get(raw.connection.topic)
                if channel is not None:
                    found[channel].append(bytes(raw.data))
    images = [decode(channels.CAMERA_IMAGE.message, data) for data in found[channels.CAMERA_IMAGE]]
    found[channels.CAMERA_IMAGE] = [_moved(image, 5 * i + 1) for i in range(_MOVED) for image in images]
    return found


def _moved(image: CompressedImage, pixels: int) -> bytes:
    bgr = np.roll(cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_COLOR), pixels, axis=1)
    data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, 80])[1].tobytes()
    return encode(replace(image, data=data, format="jpeg"))
