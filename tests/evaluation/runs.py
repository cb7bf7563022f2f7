"""A recording with one of everything that a run can hold, and changes to plant in it, for tests of the diff."""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap import records
from mcap_landmarks import channels
from mcap_landmarks.manifest import RUN, Manifest
from mcap_landmarks.messages.annotations import ImageAnnotations, Label, Outline
from mcap_landmarks.messages.codec import M, Message
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.messages.markers import Marker, MarkerArray, MarkerShape
from mcap_landmarks.messages.match import Condition, LandmarkMatch, Status
from mcap_landmarks.messages.numbers import UInt8
from mcap_landmarks.messages.poses import Odometry, PoseStamped, PoseWithCovarianceStamped
from mcap_landmarks.messages.poses import Path as PosePath
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Channel, Connection, RawMessage, Stamped

START_NS, STEP_NS, BUNDLES = 1_700_000_000 * 10**9, 10**8, 6
# Accidental matches expected of a good match: seldom as many as this.
ACCIDENTAL = 1.5e-15
STATUS = Channel("/status", UInt8)
FOREIGN = Connection("/foreign", "odd/msg/Thing", b"{}", "jsonschema", "json")
Row = int | tuple[int, ...]
Entry = tuple[Channel[Message], int, Message]
CONFIG = {"localize": {"max_sigma_m": 0.5}}


@dataclass(slots=True)
class Run:
    """A recording to write: its messages, foreign bytes by time, manifest and what else it holds."""

    entries: list[Entry]
    foreign: dict[int, bytes]
    config: dict[str, dict[str, object]]
    note: bytes = b"a note"
    verbatim: str = "same"

    def write(self, path: Path, group: str = "") -> Path:
        """Write it; messages of another `group` lie in other chunks, which changes nothing that matters."""
        metadata = {RUN: Manifest("localize", self.config).entries(), "other": {"key": self.verbatim}}
        with create_recording(path, metadata) as writer:
            for time_ns, data in self.foreign.items():
                writer.write(RawMessage(FOREIGN, time_ns, time_ns, 0, data))
            for channel, time_ns, message in self.entries:
                writer.add(Stamped(channel, time_ns, message), group and f"{group}{len(channel.topic) % 3}")
            writer.attach(records.Attachment(START_NS, START_NS, "note.txt", "text/plain", self.note))
        return path

    def index(self, topic: str, number: int) -> int:
        """Where the message of a topic with this number is."""
        return [i for i, entry in enumerate(self.entries) if entry[0].topic == topic][number]

    def edit(self, topic: str, change: Callable[[Any], Message], number: int = 2) -> None:
        """Change one message of a topic."""
        i = self.index(topic, number)
        channel, time_ns, message = self.entries[i]
        self.entries[i] = channel, time_ns, change(message)


def one_run(seed: int = 0) -> Run:
    """The same run for the same seed."""
    rng = np.random.default_rng(seed)
    times = [START_NS + i * STEP_NS for i in range(BUNDLES)]
    entries = [entry for i, time_ns in enumerate(times) for entry in _bundle(rng, i, time_ns)]
    pose = PoseStamped.planar(times[0], "map", [1.0, 2, 3])
    path = PosePath(times[0], "map", tuple(dataclasses.replace(pose, stamp_ns=time_ns) for time_ns in times))
    marker = Marker("landmarks", 0, MarkerShape.CYLINDER, np.array([1.0, 2, 0]), np.ones(3), (1.0, 0.5, 0.25, 1.0))
    markers = (marker, dataclasses.replace(marker, number=1, text="bench", points_m=rng.normal(size=(3, 3))))
    entries += [
        (channels.MAP_PATH, times[0], path),
        (channels.MAP_MARKERS, times[0], MarkerArray(times[0], "map", markers)),
        (channels.MAP, times[0], objects(rng, times[0], "map", 6)),
    ]
    return Run(entries, {time_ns: b'{"a": %d}' % i for i, time_ns in enumerate(times)}, CONFIG)


def objects(rng: np.random.Generator, stamp_ns: int, frame: str, count: int) -> SceneObjects:
    """Objects on a grid of 3 m, of three classes with two hypotheses each."""
    places = np.array([[3.0 * (i % 3), 3.0 * (i // 3)] for i in range(count)]) + rng.uniform(-0.5, 0.5, (count, 2))
    names = ("person", "suitcase", "bench")
    hypotheses = tuple(((names[i % 3], 0.75), (names[(i + 1) % 3], 0.25)) for i in range(count))
    spread = np.tile(np.diag([0.01, 0.02]), (count, 1, 1))
    return SceneObjects(
        stamp_ns, frame, tuple(f"t{i}" for i in range(count)), hypotheses, places, spread, np.full(count, 0.25)
    )


def _bundle(rng: np.random.Generator, i: int, time_ns: int) -> list[Entry]:
    corners = np.array([[10.0, 10], [200, 30], [400, 50]]) + rng.uniform(0, 5, (3, 2))
    boxes = np.hstack([corners, corners + rng.uniform(60, 120, (3, 2))])
    labels = ((("person", 0.9),), (("bench", 0.8),), (("person", 0.7),))
    pose, spread = rng.uniform(-3, 3, 3), np.diag([0.01, 0.02, 0.003])
    ranges = rng.uniform(1, 10, 40).astype(np.float32)
    ranges[3] = np.nan
    ranges[4] = np.inf
    color = (1.0, 0.0, 0.0, 1.0)
    outlines = tuple(Outline(np.repeat(box.reshape(2, 2), 2, axis=0), color, 2.0) for box in boxes)
    text = Label((1.0, 2.0), "person", 12.0, color, color)
    scan = LaserScan(time_ns, "base_scan", -np.pi, np.pi, 0.157, 0.0, 0.1, 0.1, 15.0, ranges, np.zeros(0, np.float32))
    asked = (Condition("objects", 4, 2, held=True), Condition("expected_accidental", ACCIDENTAL, 2e-3, held=True))
    match = LandmarkMatch(
        time_ns,
        "base_footprint",
        Status.LOCALIZED,
        ("t0", "t1"),
        ("l4", "l7"),
        np.array([0.01, 0.02]),
        expected_accidental=ACCIDENTAL,
        conditions=asked,
    )
    return [
        (channels.CAMERA_IMAGE, time_ns, CompressedImage(time_ns, "camera", "jpeg", rng.bytes(64))),
        (channels.SCAN, time_ns, scan),
        (channels.ODOMETRY, time_ns, Odometry.planar(time_ns, ("odom", "base"), pose, spread, (0.2, 0.1))),
        (channels.DETECTIONS, time_ns, Detections(time_ns, "camera", ("", "", ""), labels, boxes)),
        (channels.ANNOTATIONS, time_ns, ImageAnnotations(time_ns, outlines, (text,))),
        (channels.SCENE_OBJECTS, time_ns, objects(rng, time_ns, "base_footprint", 4)),
        (channels.MATCH, time_ns, match),
        (channels.POSE, time_ns, PoseStamped.planar(time_ns, "map", pose)),
        (channels.POSE_COVARIANCE, time_ns, PoseWithCovarianceStamped.planar(time_ns, "map", pose, spread)),
        (channels.TF, time_ns, TFMessage((Transform.planar(time_ns, ("map", "odom"), pose),))),
        (STATUS, time_ns, UInt8(i)),
    ]


def without(message: M, row: int, names: Sequence[str]) -> M:
    """A message whose lists `names` lack a row."""
    shorter = {
        name: np.delete(value, row, axis=0) if isinstance(value := getattr(message, name), np.ndarray)
        else (*value[:row], *value[row + 1 :])
        for name in names
    }  # fmt: skip
    return dataclasses.replace(message, **shorter)


def with_row(message: M, name: str, row: Row, value: object) -> M:
    """A message with another row in a list or array."""
    before = getattr(message, name)
    if isinstance(before, np.ndarray):
        after = before.copy()
        after[row] = value
    else:
        assert isinstance(row, int)
        after = (*before[:row], value, *before[row + 1 :])
    return dataclasses.replace(message, **{name: after})
