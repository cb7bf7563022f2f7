"""What a log looks like from Python: the bundled recordings, results, and logs that are odd."""

from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import mcap_landmarks as ml
import numpy as np
import pytest
from mcap_landmarks.api.arguments import Moment
from mcap_landmarks.channels import CAMERA_IMAGE, ODOMETRY, SCAN, TF, TRUTH_POSE
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import Odometry, PoseStamped
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.resources import resource
from mcap_landmarks.stage import Channel

from tests.diff.recordings import START_NS, STEP_NS, localized_log, write

DEMO = resource("recordings", "demo_localize.mcap")
GOLDEN = Path(__file__).parents[1] / "golden"
DEMO_START_NS = 1_767_225_600 * 10**9


def test_channels_have_their_roles_and_counts() -> None:
    with ml.open_log(DEMO) as log:
        roles = {channel.role: (channel.topic, channel.count) for channel in log.channels}
        assert roles["odometry"] == ("/odom", 698)
        assert roles["image"] == (CAMERA_IMAGE.topic, 70)
        assert log.start_ns == DEMO_START_NS
        shown = repr(log)
    assert "2422 messages" in shown
    assert "nav_msgs/msg/Odometry  odometry" in shown


def test_images_come_one_by_one_and_are_decoded_when_asked_for() -> None:
    with ml.open_log(DEMO) as log:
        first, second = (next(log.images()) for _ in range(2))
        both = list(zip(log.images(), log.scans(), strict=False))
    assert first.stamp_ns == second.stamp_ns == 1767225600013200331
    assert (first.topic, first.frame_id) == (CAMERA_IMAGE.topic, "camera_rgb_optical_frame")
    assert first.time == np.datetime64("2026-01-01T00:00:00.013200331")
    assert first.pixels.shape == (480, 640, 3)
    assert first.pixels.dtype == np.uint8
    assert len(both) == 70  # two readings of one file do not disturb each other


def test_scans_tell_where_their_beams_met_something() -> None:
    with ml.open_log(DEMO) as log:
        scan = next(log.scans())
    assert scan.ranges_m.shape == scan.angles_rad.shape == (360,)
    measured = (scan.ranges_m > scan.range_min_m) & (scan.ranges_m < scan.range_max_m)
    assert 0 < measured.sum() < 360
    np.testing.assert_allclose(np.linalg.norm(scan.points_xy, axis=1), scan.ranges_m[measured], rtol=1e-6)


def test_odometry_is_a_table_with_times_of_both_kinds() -> None:
    with ml.open_log(DEMO, end=DEMO_START_NS + 10**9) as log:
        odometry = log.odometry()
    assert odometry.fields[:3] == ("log_time_ns", "stamp_ns", "time")
    assert (odometry["log_time_ns"] < DEMO_START_NS + 10**9).all()
    assert odometry["time"].dtype == "datetime64[ns]"
    np.testing.assert_array_equal(odometry["time"].astype(np.int64), odometry["stamp_ns"])
    assert set(odometry["child_frame_id"]) == {"base_footprint"}
    steps = np.hypot(np.diff(odometry["x_m"]), np.diff(odometry["y_m"])) / (np.diff(odometry["stamp_ns"]) * 1e-9)
    np.testing.assert_allclose(steps.mean(), odometry["forward_mps"].mean(), rtol=0.2)


@pytest.mark.parametrize(
    ("start", "end"),
    [
        (DEMO_START_NS + 10**9, "2026-01-01T00:00:02Z"),
        (datetime(2026, 1, 1, 0, 0, 1, tzinfo=UTC), np.datetime64("2026-01-01T00:00:02")),
    ],
)
def test_a_span_may_be_given_as_any_moment(start: Moment, end: Moment) -> None:
    with ml.open_log(DEMO, start=start, end=end) as log:
        assert len(list(log.scans())) == 5
        assert len(log.odometry()) == 30
        assert len(log.ground_truth()) == 30


def test_results_are_tables() -> None:
    with ml.open_log(GOLDEN / "localize.mcap") as log:
        matches, poses, boxes, objects = log.matches(), log.poses(), log.detections(), log.scene_objects()
    assert len(matches) == len(poses) == 49
    assert set(matches["status"]) == {"localized"}
    assert all(len(row["object_ids"]) == len(row["residual_m"]) for row in matches)
    assert set(poses["topic"]) == {"/landmarks/pose_cov"}
    assert (poses["var_heading_rad2"] > 0).all()
    assert set(boxes["class"]) <= {
        "bench",
        "fire hydrant",
        "person",
        "potted plant",
        "sports ball",
        "suitcase",
        "chair",
    }
    assert (boxes["x_max_px"] > boxes["x_min_px"]).all()
    assert ((boxes["confidence"] > 0) & (boxes["confidence"] <= 1)).all()
    assert len(np.unique(objects["stamp_ns"])) == 49
    assert set(objects["frame_id"]) == {"base_footprint"}
    nearest = objects[objects["probability"] > 0.9]
    assert isinstance(nearest, ml.StructuredArray)


def test_what_failed_is_named(tmp_path: Path) -> None:
    with ml.open_log(localized_log(tmp_path / "log.mcap")) as log:
        matches = log.matches()
        assert list(matches["status"]) == ["localized", "localized", "ambiguous", "too_few_objects", "localized"]
        assert list(matches["failed"]) == [(), (), ("expected_accidental",), ("objects",), ()]
        assert len(log.scene_objects("/ground_truth/objects")) == 3


def test_what_is_not_there_is_told_at_once() -> None:
    with ml.open_log(DEMO) as log:
        for read in (log.matches, log.detections, log.clouds):
            with pytest.raises(ml.RecordingError, match=r"demo_localize\.mcap"):
                read()
        with pytest.raises(ml.UsageError, match="/odom is nav_msgs/msg/Odometry"):
            log.images("/odom")
        with pytest.raises(ml.UsageError, match="/odom is nav_msgs/msg/Odometry; choose a topic of vision_msgs"):
            log.detections("/odom")
    with ml.open_log(GOLDEN / "map.mcap") as log, pytest.raises(ml.RecordingError, match="no /ground_truth/pose"):
        log.ground_truth()
    with pytest.raises(ml.UsageError, match="no message lies between"):
        ml.open_log(DEMO, start="2030-01-01T00:00:00Z")
    with pytest.raises(ml.UsageError, match="start 2026-01-01T00:00:00: give RFC 3339 with an offset"):
        ml.open_log(DEMO, start=datetime(2026, 1, 1))  # noqa: DTZ001 - that is what is refused


def test_of_several_topics_one_is_chosen(tmp_path: Path) -> None:
    left, right = (Channel(f"/{side}/odom", Odometry) for side in ("left", "right"))
    message = Odometry.planar(START_NS, ("odom", "base"), (1.0, 2.0, 0.5), np.eye(3))
    path = write(tmp_path / "log.mcap", [(left, START_NS, message), (right, START_NS, message)])
    with ml.open_log(path) as log:
        with pytest.raises(ml.UsageError, match="/left/odom and /right/odom could be the odometry"):
            log.odometry()
        assert len(log.odometry("/right/odom")) == 1
    with ml.open_log(path, remap={"/left/odom": ODOMETRY.topic}) as log:
        assert len(log.odometry(ODOMETRY.topic)) == 1


def test_odometry_may_be_transforms(tmp_path: Path) -> None:
    step = Transform(START_NS, "odom", "base_link", np.array([1.0, 2.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]))
    with ml.open_log(write(tmp_path / "log.mcap", [(TF, START_NS, TFMessage((step,)))])) as log:
        odometry = log.odometry()
    assert odometry[["x_m", "y_m", "heading_rad", "forward_mps"]].tolist() == [(1.0, 2.0, 0.0, 0.0)]
    assert list(odometry["child_frame_id"]) == ["base_link"]


def test_clouds_are_points(tmp_path: Path) -> None:
    points = np.arange(6, dtype=np.float32).reshape(2, 3)
    path = write(tmp_path / "log.mcap", [(Channel("/points", PointCloud2), 7, PointCloud2(5, "lidar", points))])
    with ml.open_log(path) as log:
        (cloud,) = log.clouds()
        np.testing.assert_array_equal(cloud.points_m, points)
        assert (cloud.stamp_ns, cloud.log_time_ns, cloud.topic, cloud.frame_id) == (5, 7, "/points", "lidar")


def test_what_cannot_be_read_is_told_once_and_listed(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mcap", [(SCAN, START_NS + i * STEP_NS, scan_message()) for i in range(2)])
    content = path.read_bytes()
    path.write_bytes(content.replace(b"base_scan", b"base_sc\xff\xfe"))
    with ml.open_log(path) as log:
        with pytest.warns(ml.LossWarning, match=r"log\.mcap") as told:
            assert list(log.scans()) == []
        assert {one.filename for one in told} == {__file__}  # the caller's line, whoever finds out
        assert log.losses
        list(log.scans())  # and no warning once more


def scan_message() -> LaserScan:
    nothing = np.zeros(0, dtype=np.float32)
    ranges = np.ones(8, dtype=np.float32)
    return LaserScan(START_NS, "base_scan", 0.0, 6.0, 0.5, 0.0, 0.1, 0.1, 9.0, ranges, nothing)


def test_an_image_that_is_damaged_says_so_when_it_is_decoded(tmp_path: Path) -> None:
    image = CompressedImage(5, "camera", "jpeg", b"\xff\xd8 and nothing else")
    with ml.open_log(write(tmp_path / "log.mcap", [(CAMERA_IMAGE, 7, image)])) as log:
        (found,) = log.images()
        with pytest.raises(ml.MessageError, match="cut short"):
            assert found.pixels is None


def test_a_log_closes_itself(tmp_path: Path) -> None:
    pose = PoseStamped.planar(START_NS, "map", (1.0, 2.0, 0.5))
    path = write(tmp_path / "log.mcap", [(TRUTH_POSE, START_NS, pose)])
    log = ml.open_log(path, lenient=True)
    assert len(log.ground_truth()) == 1
    log.close()
    for read in (log.ground_truth, log.poses, log.odometry, log.scans, log.clouds, log.matches):
        with pytest.raises(ml.UsageError, match="the log is closed"):
            read()


def test_what_is_read_one_by_one_ends_when_the_log_is_closed() -> None:
    with ml.open_log(DEMO) as log:
        begun, new = log.scans(), log.scans()
        next(begun)
    for scans in (begun, new):
        with pytest.raises(ml.UsageError, match="the log is closed"):
            next(scans)


@pytest.mark.parametrize(
    "given", [np.datetime64("NaT"), True, 1.5, date(2026, 1, 1), timedelta(1), np.timedelta64(1, "s"), [1], "yesterday"]
)
def test_what_is_no_moment_is_refused(given: Moment) -> None:
    with pytest.raises(ml.UsageError, match=r"start .*: give RFC 3339"):
        ml.open_log(DEMO, start=given)


def test_arguments_of_a_wrong_type_are_named() -> None:
    with pytest.raises(ml.UsageError, match="remap 'x' is no mapping"):
        ml.open_log(DEMO, remap="x")  # type: ignore[arg-type] # that is what is refused
    with pytest.raises(ml.UsageError, match="path is of type int"):
        ml.open_log(3)  # type: ignore[arg-type] # that is what is refused
