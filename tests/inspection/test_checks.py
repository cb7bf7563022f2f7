"""Every check finds what was planted, and nothing where nothing was."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_IMAGE, CAMERA_INFO, ODOMETRY, SCAN, SCENE_OBJECTS, TF_STATIC
from mcap_landmarks.inspection.finding import Finding
from mcap_landmarks.inspection.info import describe
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.progress import unwatched
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Channel, RawMessage, Stamped

from tests.cli.logs import write
from tests.runs.chain import STEP_NS, raw_messages

SECOND = 10**9
COUNT = 40

Change = Callable[[Stamped], Stamped | None]


pytestmark = pytest.mark.usefixtures("cached_network")


def findings(tmp_path: Path, change: Change, second: bool = False) -> list[Finding]:
    """What is found in a changed log, which may have a second camera without a CameraInfo."""
    content = [changed for stamped in raw_messages(COUNT) if (changed := change(stamped)) is not None]
    images = [stamped for stamped in content if stamped.channel == CAMERA_IMAGE] if second else []
    rear = Channel("/rear/image_raw", CAMERA_IMAGE.message)
    for one in images:
        message = dataclasses.replace(one.message, frame_id="rear")
        content.append(Stamped(rear, one.log_time_ns, message))
    content.sort(key=lambda stamped: stamped.log_time_ns)
    (log,) = describe(write(tmp_path / "log.mcap", content), {}, unwatched)
    return list(log.findings or ())


def of(channel: Channel, change: Change) -> Change:
    return lambda stamped: change(stamped) if stamped.channel == channel else stamped


def stamped_by(clock: Callable[[int], int]) -> Change:
    def change(stamped: Stamped) -> Stamped:
        message = dataclasses.replace(stamped.message, stamp_ns=clock(stamped.log_time_ns))
        return Stamped(stamped.channel, stamped.log_time_ns, message)

    return change


def blind(stamped: Stamped, beams: slice) -> Stamped:
    ranges = np.full(180, 2.0, np.float32)
    ranges[beams] = np.inf
    return Stamped(stamped.channel, stamped.log_time_ns, dataclasses.replace(stamped.message, ranges_m=ranges))


def late(stamped: Stamped, shift_ns: int) -> Stamped:
    return Stamped(stamped.channel, stamped.log_time_ns + shift_ns, stamped.message)


def every(stamped: Stamped, period_ns: int) -> Stamped | None:
    return stamped if stamped.log_time_ns % period_ns == 0 else None


def later(stamped: Stamped | None) -> Stamped | None:
    """Logged by a clock that runs a little slow: for each second 1.001 s."""
    return stamped and Stamped(stamped.channel, stamped.log_time_ns * 1001 // 1000, stamped.message)


def without(first: int, last: int) -> Change:
    return lambda stamped: None if first * STEP_NS <= stamped.log_time_ns < last * STEP_NS else stamped


def changed(stamped: Stamped, **values: object) -> Stamped:
    return Stamped(stamped.channel, stamped.log_time_ns, dataclasses.replace(stamped.message, **values))


def uncalibrated(stamped: Stamped) -> Stamped:
    return Stamped(stamped.channel, 1, dataclasses.replace(stamped.message, intrinsics=np.zeros((3, 3))))


def everywhere(stamped: Stamped) -> Stamped:
    return blind(stamped, slice(0, 0)) if stamped.channel == SCAN else stamped


PLANTED: dict[str, tuple[Change, set[tuple[str, str, str]]]] = {
    "nothing": (lambda stamped: stamped, set()),
    "slow images": (
        of(CAMERA_IMAGE, lambda s: every(s, 2 * SECOND)),
        {("rate", "/camera/image_raw/compressed", "0.5 Hz is slow"), ("partners", "/scan", "28 % of its messages")},
    ),
    "images at nearly the least rate": (
        of(CAMERA_IMAGE, lambda s: later(every(s, SECOND))),
        {("partners", "/scan", "of its messages")},
    ),
    "a gap": (
        of(SCAN, without(10, 20)),
        {("gap", "/scan", "1 gap, the longest of 2.2 s after 1970-01-01T00:00:01.800000000Z")},
    ),
    "a gap in odometry": (of(ODOMETRY, without(5, 35)), {("gap", "/odom", "6.2 s"), ("partners", "/scan", "/odom")}),
    "no stamps": (of(SCAN, stamped_by(lambda _: 0)), {("stamps", "/scan", "40 of 40 stamps are zero")}),
    "stamps that go back": (
        of(ODOMETRY, stamped_by(lambda now: now - SECOND * (now == 10 * STEP_NS))),
        {("stamps", "/odom", "1 of 40 messages have a stamp that cannot be")},
    ),
    "a clock that is set back": (
        of(ODOMETRY, stamped_by(lambda now: now - SECOND * (now >= 10 * STEP_NS))),
        {("stamps", "/odom", "set back once, first by 1.0 s"), ("odometry", "/odom", "cut into 2 pieces")},
    ),
    "a clock that is late": (
        of(CAMERA_IMAGE, stamped_by(lambda now: now - 300_000_000)),
        {("clock", "/camera/image_raw/compressed", "0.3 s before those of /odom")},
    ),
    "another clock": (
        of(SCAN, stamped_by(lambda now: now + 3600 * SECOND)),
        {
            ("stamps", "/scan", "3.6e+03 s after log times"),
            ("clock", "/scan", "after those of /odom"),
            ("partners", "/scan", "0 % of its messages have one of /odom"),
            ("partners", "/scan", "0 % of its messages have one of /camera"),
        },
    ),
    "few images": (
        of(CAMERA_IMAGE, without(0, 20)),
        {("partners", "/scan", "have one of /camera/image_raw/compressed within 0.25 s")},
    ),
    "no transforms": (
        of(TF_STATIC, lambda _: None),
        {("frames", "/scan", "nothing says where the LiDAR"), ("frames", "/camera/camera_info", "from camera to")},
    ),
    "no odometry": (
        of(ODOMETRY, lambda _: None),
        {("frames", "", "there is no odometry"), ("scan", "/scan", "a scan takes 0.1 s and cannot be de-skewed")},
    ),
    "no camera_info": (of(CAMERA_INFO, lambda _: None), {("camera", "/camera/image_raw/compressed", "no camera_info")}),
    "camera_info from before a cut": (of(CAMERA_INFO, lambda s: late(s, 7 * SECOND)), set()),
    "no calibration": (of(CAMERA_INFO, uncalibrated), {("camera", "/camera/camera_info", "no focal length")}),
    "a second camera": (
        lambda stamped: stamped,
        {("camera", "", "images are on 2 topics"), ("camera", "/rear/image_raw", "no camera_info goes with")},
    ),
    "blind beams": (
        of(SCAN, lambda s: blind(s, slice(45, 60))),
        {("beams", "/scan", "15 of 180 beams never returned anything in 40 scans: 90 to 118 deg")},
    ),
    "scans in millimetres": (
        of(SCAN, lambda s: changed(s, ranges_m=np.full(180, 2000.0, np.float32))),
        {("scan", "/scan", "40 of 40 scans in millimetres")},
    ),
    "scans without limits": (of(SCAN, lambda s: changed(s, range_min_m=0.0, range_max_m=0.0)), set()),
    "scans that cannot be read": (
        of(SCAN, lambda s: changed(s, angle_increment_rad=0.01)),
        {("scan", "/scan", "40 of 40 scans cannot be read: a scan's angle_increment contradicts its limits")},
    ),
    "images of another size": (
        of(CAMERA_INFO, lambda s: changed(s, width_px=640, height_px=480)),
        {("camera", "/camera/camera_info", "is of 640 x 480 pixels, but the images are of 64 x 48")},
    ),
    "binning": (
        of(CAMERA_INFO, lambda s: changed(s, width_px=128, height_px=96, binning=(2, 2))),
        set(),
    ),
    "a blind LiDAR": (of(SCAN, lambda s: blind(s, slice(0, 180))), {("beams", "/scan", "no beam returned anything")}),
}


@pytest.mark.parametrize("name", PLANTED)
def test_what_is_planted_is_found_and_only_that(tmp_path: Path, name: str) -> None:
    change, expected = PLANTED[name]

    def seeing(stamped: Stamped) -> Stamped | None:  # all beams return something, but for what is planted
        return change(everywhere(stamped))

    found = findings(tmp_path, seeing, second=name == "a second camera")
    assert {(finding.check, finding.topic) for finding in found} == {(check, topic) for check, topic, _ in expected}
    for check, topic, words in expected:
        texts = [finding.text for finding in found if (finding.check, finding.topic) == (check, topic)]
        assert any(words in text for text in texts), texts
    assert all(finding.remedy for finding in found)


@pytest.mark.parametrize(("topic", "said"), [(SCENE_OBJECTS.topic, []), ("/tags", ["/tags"])])
def test_results_have_the_stamps_of_what_they_were_made_from(tmp_path: Path, topic: str, said: list[str]) -> None:
    def logged_late(stamped: Stamped) -> Stamped:
        if stamped.channel != SCAN:
            return stamped
        nothing = (), (), np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0)
        scene = SceneObjects(stamped.log_time_ns, "base_footprint", *nothing)
        return Stamped(Channel(topic, SceneObjects), stamped.log_time_ns + SECOND, scene)

    assert [finding.topic for finding in findings(tmp_path, logged_late) if finding.check == "clock"] == said


@pytest.mark.parametrize(("after_ns", "said"), [(STEP_NS + 3_000_000, []), (3 * STEP_NS, ["/points"])])
def test_clouds_may_be_logged_a_turn_after_their_stamp(tmp_path: Path, after_ns: int, said: list[str]) -> None:
    def as_cloud(stamped: Stamped) -> Stamped:
        if stamped.channel != SCAN:
            return stamped
        cloud = PointCloud2(stamped.log_time_ns, "base_scan", np.ones((4, 3), np.float32))
        return Stamped(Channel("/points", PointCloud2), stamped.log_time_ns + after_ns, cloud)

    assert [finding.topic for finding in findings(tmp_path, as_cloud) if finding.check == "clock"] == said


def test_problems_come_first(tmp_path: Path) -> None:
    found = findings(
        tmp_path, lambda s: of(SCAN, lambda t: blind(t, slice(0, 180)))(s) if s.channel != ODOMETRY else None
    )
    assert [finding.level for finding in found] == ["problem", "warning", "warning"]


def test_a_message_that_does_not_fit_its_type_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with create_recording(path) as writer:
        for stamped in raw_messages(COUNT):
            writer.add(everywhere(stamped))
        writer.write(RawMessage(writer.connection(SCAN), 50 * STEP_NS, 50 * STEP_NS, 0, b"\0\1\0\0"))
    (log,) = describe(path, {}, unwatched)
    assert ("messages", "/scan") in {(finding.check, finding.topic) for finding in log.findings or ()}
