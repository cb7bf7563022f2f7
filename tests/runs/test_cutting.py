"""An output that is cut with a start holds all that its stages need: what was said once before the cut comes along."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_INFO, MAP, TF, TF_STATIC, TRUTH_OBJECTS
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.manifest import RUN
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.messages.qos import KEY
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.progress import unwatched
from mcap_landmarks.recording.latched import latched
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.runs.bundles import Span
from mcap_landmarks.runs.convert import convert
from mcap_landmarks.runs.output_formats import OutputForm
from mcap_landmarks.runs.pipeline import LogRun, run_stages
from mcap_landmarks.runs.plan import Request
from mcap_landmarks.runs.splitting import Split
from mcap_landmarks.runs.topic_selection import Selection
from mcap_landmarks.stage import Connection, RawMessage, Stamped

from tests.maps.examples import small_map
from tests.runs.chain import STEP_NS, raw_messages, two_posts
from tests.sources.bags import times, write_ros1

ALL = ["detect", "cluster", "fuse", "localize"]
START_NS = 3 * STEP_NS


def turned(stamp_ns: int, frame: str, x_m: float) -> Stamped:
    transform = Transform.planar(stamp_ns, ("base_footprint", frame), (x_m, 0, 0))
    return Stamped(TF_STATIC, stamp_ns, TFMessage((transform,)))


def messages() -> list[Stamped]:
    """The small log, with transforms that come one by one, one of them again, and truth that comes once."""
    first, info, *rest = raw_messages()
    wheel, mast = turned(2, "wheel", 0.1), turned(2, "mast", 0.2)
    none = np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0)
    truth = Stamped(TRUTH_OBJECTS, 3, SceneObjects(3, "map", (), (), *none))
    assert isinstance(info.message, CameraInfo)
    later = Stamped(CAMERA_INFO, STEP_NS, dataclasses.replace(info.message, stamp_ns=STEP_NS))
    return sorted([first, info, wheel, mast, truth, turned(4, "wheel", 0.3), later, *rest], key=lambda s: s.log_time_ns)


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """A folder with a log, a detector and a map."""
    write_log(tmp_path / "log.mcap", messages())
    two_posts(tmp_path / "model.onnx")
    write_map(tmp_path / "map.db", small_map())
    return tmp_path


def write_log(path: Path, stamped: list[Stamped]) -> None:
    with create_recording(path) as writer:
        for message in stamped:
            writer.add(message)


def cut(here: Path, log: str, out: str, start_ns: int | None = START_NS, **changes: object) -> LogRun:
    files = {"model": here / "model.onnx", "map": here / "map.db"}
    request = Request(here / log, files=files, span=Span(start_ns=start_ns))
    request = dataclasses.replace(request, **changes)  # type: ignore[arg-type] # fields of it
    return run_stages(request, here / out, ALL, "run")


def of_topic(path: Path, topic: str) -> list[RawMessage]:
    with open_recording(path) as recording:
        return [raw._replace(data=bytes(raw.data)) for raw in recording.messages(recording.connections(topic))]


def results(path: Path) -> list[tuple[str, int, bytes]]:
    with open_recording(path) as recording:
        found = [(raw.connection.topic, raw.log_time_ns, bytes(raw.data)) for raw in recording.messages()]
    return sorted(entry for entry in found if entry[0].startswith("/landmarks/"))


@pytest.mark.slow
def test_the_latest_of_every_frame_and_camera_come_along(here: Path) -> None:
    run = cut(here, "log.mcap", "out.mcap")
    before = of_topic(here / "out.mcap", TF_STATIC.topic)
    assert {raw.log_time_ns for raw in before} == {START_NS}
    frames = {step.child_frame_id: step for raw in before for step in decode(TFMessage, raw.data).transforms}
    stamps = {name: step.stamp_ns for name, step in frames.items()}
    assert stamps == {"base_scan": 1, "camera": 1, "mast": 2, "wheel": 4}
    assert frames["wheel"].translation_m[0] == 0.3
    assert len(before) == 3  # the wheel's first place is no longer true
    (info,) = of_topic(here / "out.mcap", CAMERA_INFO.topic)
    assert (info.log_time_ns, info.publish_time_ns) == (START_NS, STEP_NS)
    assert decode(CameraInfo, info.data).stamp_ns == STEP_NS
    assert [raw.log_time_ns for raw in of_topic(here / "out.mcap", TRUTH_OBJECTS.topic)] == [START_NS]
    (note,) = run.notes
    assert note.endswith("at it: /camera/camera_info, /ground_truth/objects, /tf_static (3)")
    with open_recording(here / "out.mcap") as recording:
        assert recording.start_ns == START_NS
        told = json.loads(recording.metadata[RUN]["carried"])
    assert told == {"/camera/camera_info": 1, "/ground_truth/objects": 1, "/tf_static": 3}


@pytest.mark.slow
def test_a_cut_log_gives_by_itself_what_it_gave_within_the_whole(here: Path) -> None:
    cut(here, "log.mcap", "out.mcap")
    run = cut(here, "out.mcap", "again.mcap", None, force=True)
    assert {stage.state for stage in run.stages} == {"ran"}
    assert results(here / "again.mcap") == results(here / "out.mcap")
    assert any(topic == MAP.topic for topic, _, _ in results(here / "again.mcap"))
    reused = cut(here, "out.mcap", "third.mcap", None)
    assert {stage.state for stage in reused.stages} == {"reused"}
    assert run.notes == reused.notes == ()


@pytest.mark.slow
def test_the_same_cut_is_reused_and_told_again(here: Path) -> None:
    first = cut(here, "log.mcap", "out.mcap")
    data = (here / "out.mcap").read_bytes()
    again = cut(here, "log.mcap", "out.mcap")
    assert {stage.state for stage in again.stages} == {"reused"}
    assert again.notes == first.notes
    cut(here, "log.mcap", "other.mcap", force=True)
    assert (here / "out.mcap").read_bytes() == (here / "other.mcap").read_bytes() == data


@pytest.mark.slow
def test_without_static_transforms_the_others_hold(here: Path) -> None:
    moved = [dataclasses.replace(one, channel=TF) if one.channel == TF_STATIC else one for one in messages()]
    write_log(here / "log.mcap", moved)
    cut(here, "log.mcap", "out.mcap")
    assert {raw.log_time_ns for raw in of_topic(here / "out.mcap", TF.topic)} >= {START_NS}
    frames = {
        step.child_frame_id
        for raw in of_topic(here / "out.mcap", TF.topic)
        for step in decode(TFMessage, raw.data).transforms
    }
    assert {"base_scan", "camera", "mast", "wheel"} <= frames
    beside = Stamped(TF_STATIC, 5, TFMessage((Transform.planar(5, ("base_footprint", "arm"), np.zeros(3)),)))
    write_log(here / "log.mcap", [*moved[:6], beside, *moved[6:]])
    cut(here, "log.mcap", "out.mcap", overwrite=True)
    assert "mast" not in str(of_topic(here / "out.mcap", TF.topic))


@pytest.mark.parametrize(
    ("topic", "kind", "durability", "lasts"),
    [
        ("/map", "nav_msgs/msg/OccupancyGrid", "1", True),
        ("/map", "nav_msgs/msg/OccupancyGrid", "transient_local", True),
        ("/map", "nav_msgs/msg/OccupancyGrid", "2", False),
        ("/map", "nav_msgs/msg/OccupancyGrid", "volatile", False),
        ("/robot1/tf_static", "tf2_msgs/msg/TFMessage", "2", True),
        ("/tf_static", "std_msgs/msg/String", "2", False),
        ("/left/camera_info", "sensor_msgs/msg/CameraInfo", "2", True),
        ("/rosout", "rcl_interfaces/msg/Log", "1", False),
        ("/add/_service_event", "example_interfaces/srv/AddTwoInts_Event", "1", False),
    ],
)
def test_what_lasts(topic: str, kind: str, durability: str, lasts: bool) -> None:
    several = f"- history: 1\n  durability: 2\n  depth: 1\n- history: 1\n  durability: {durability}\n  depth: 1"
    connection = Connection(topic, kind, b"", metadata={KEY: several})
    assert latched([connection]) == [connection] * lasts


@pytest.mark.slow
def test_whole_logs_and_results_alone_carry_nothing(here: Path) -> None:
    assert cut(here, "log.mcap", "a.mcap", None).notes == ()
    assert cut(here, "log.mcap", "b.mcap", 1).notes == ()
    assert cut(here, "log.mcap", "c.mcap", results_only=True).notes == ()
    for name in ("a.mcap", "b.mcap", "c.mcap"):
        with open_recording(here / name) as recording:
            assert "carried" not in recording.metadata[RUN]


@pytest.mark.slow
def test_conversion_cuts_the_same_way(here: Path) -> None:
    conversion = convert([here / "log.mcap"], here / "out.mcap", Selection((), START_NS), {}, unwatched)
    (done,) = conversion.outputs
    cut(here, "log.mcap", "cut.mcap")
    for topic in (TF_STATIC.topic, CAMERA_INFO.topic, TRUTH_OBJECTS.topic):
        found = [raw[1:] for raw in of_topic(here / "out.mcap", topic)]
        assert found == [raw[1:] for raw in of_topic(here / "cut.mcap", topic)]
    assert done.notes == [cut(here, "log.mcap", "cut.mcap").notes[0]]
    assert done.declared == done.topics.total()
    only = convert([here / "log.mcap"], here / "scans.mcap", Selection(("/scan",), START_NS), {}, unwatched)
    assert only.outputs[0].notes == []


def test_the_parts_of_a_split_begin_as_cuts_at_their_starts_do(tmp_path: Path) -> None:
    """Each holds what the one before held, and what came since: frames are told at different rates, some but once."""
    log, parts, names = tmp_path / "log.mcap", tmp_path / "parts", ["a", "b", "c", "d", "e"]
    frames = [(i, names[: 1 + i // 10] if i % 7 == 0 else [names[i * i % 3]]) for i in range(40)]
    moved = [
        Stamped(TF, i * STEP_NS, TFMessage(tuple(Transform.planar(i, ("base", one), (i, 0, 0)) for one in ones)))
        for i, ones in frames
    ]
    write_log(log, moved)
    form = OutputForm(Split(duration_ns=9 * STEP_NS))
    outputs = convert([log], parts, Selection(), {}, unwatched, form=form).outputs
    assert len(outputs) == 5
    for number, output in enumerate(outputs):
        alone = tmp_path / "alone.mcap"
        within = (9 * number * STEP_NS or None, 9 * (number + 1) * STEP_NS)
        convert([log], alone, Selection((), *within), {}, unwatched, overwrite=True)
        both = [[raw[1:] for raw in of_topic(path, TF.topic)] for path in (output.path, alone)]
        assert both[0] == both[1]


def test_what_a_ros_1_bag_latched_comes_along_unless_nothing_follows(tmp_path: Path) -> None:
    source, at_ns = write_ros1(tmp_path / "a.bag"), times(40)
    (done,) = convert([source], tmp_path / "out.mcap", Selection((), at_ns[30], at_ns[33]), {}, unwatched).outputs
    assert done.topics == {"/scan": 3, "/talk": 4}
    assert [raw.log_time_ns for raw in of_topic(tmp_path / "out.mcap", "/talk")][:2] == [at_ns[30], at_ns[30] + 1]
    assert of_topic(tmp_path / "out.mcap", "/talk")[0].publish_time_ns == at_ns[29] + 1
    assert done.notes == ["the latest from before the start is carried over and logged at it: /talk"]
    assert done.dropped == {"messages outside the time range": 73}
    with pytest.raises(RecordingError, match="no message lies in the time range"):
        convert([source], tmp_path / "none.mcap", Selection((), at_ns[39] + 2), {}, unwatched)
