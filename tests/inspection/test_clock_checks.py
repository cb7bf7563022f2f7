"""Clocks that are apart, and odometry that does not follow the robot, are told from how the robot turns."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import ODOMETRY, SCAN, TF_STATIC
from mcap_landmarks.geometry.se2 import Array, inverse, transform_points
from mcap_landmarks.inspection.finding import Finding
from mcap_landmarks.inspection.info import describe
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.progress import unwatched
from mcap_landmarks.stage import Channel, Stamped

from tests.cli.logs import write
from tests.lidar.rooms import FULL, POSTS, scan

SECOND = 10**9
FRAMES = ("odom", "base_footprint")
TAGS = Channel("/tags", SceneObjects)

Change = Callable[[Stamped], Stamped | None]


def pose(now_ns: int) -> Array:
    """Where the robot is: it drives to and fro, and turns never twice alike."""
    t = now_ns / SECOND
    return np.array([0.5 * np.sin(0.3 * t), 0.2 * np.sin(0.5 * t), 0.8 * np.sin(0.9 * t) + 0.5 * np.sin(1.7 * t + 1)])


def odometry(every_ns: int = SECOND // 20) -> list[Stamped]:
    return [
        Stamped(ODOMETRY, now, Odometry.planar(now, FRAMES, pose(now), np.zeros((3, 3))))
        for now in range(SECOND, 31 * SECOND, every_ns)
    ]


def objects() -> list[Stamped]:
    """What a robot with tags as landmarks logs."""
    rng, found = np.random.default_rng(1), odometry()
    ids, covariances = tuple(f"tag {i}" for i in range(len(POSTS))), np.tile(1e-4 * np.eye(2), (len(POSTS), 1, 1))
    for now in range(3 * SECOND, 29 * SECOND, SECOND // 5):
        places = transform_points(inverse(pose(now)), POSTS) + rng.normal(0, 0.01, POSTS.shape)
        classes = tuple(((name, 1.0),) for name in ids)
        scene = SceneObjects(now, FRAMES[1], ids, classes, places, covariances, np.zeros(len(ids)))
        found.append(Stamped(TAGS, now, scene))
    return found


def scans(upside_down: bool = False) -> list[Stamped]:
    """What a robot with a LiDAR logs."""
    turned = np.array([1.0, 0.0, 0.0, 0.0]) if upside_down else np.array([0.0, 0.0, 0.0, 1.0])
    mount = Transform(SECOND, FRAMES[1], "laser", np.array([0.0, 0.0, 0.2]), turned)
    found = [Stamped(TF_STATIC, SECOND, TFMessage((mount,))), *odometry()]
    step, none = float(FULL[1]), np.zeros(0, np.float32)
    for now in range(3 * SECOND, 23 * SECOND, SECOND // 5):
        ranges = scan(-FULL if upside_down else FULL, pose(now)).astype(np.float32)
        message = LaserScan(now, "laser", 0.0, 359 * step, step, 0.0, 0.2, 0.1, 12.0, ranges, none)
        found.append(Stamped(SCAN, now, message))
    return found


def clocks(tmp_path: Path, content: list[Stamped], change: Change = lambda stamped: stamped) -> list[Finding]:
    """What is said of clocks."""
    changed = [after for stamped in content if (after := change(stamped)) is not None]
    path = write(tmp_path / "log.mcap", sorted(changed, key=lambda stamped: stamped.log_time_ns))
    (log,) = describe(path, {}, unwatched)
    return [finding for finding in log.findings or () if finding.check == "clock"]


def late(channel: Channel, by_ns: int) -> Change:
    """Stamps of a channel that are late, log times that are not."""

    def change(stamped: Stamped) -> Stamped:
        if stamped.channel != channel:
            return stamped
        message = dataclasses.replace(stamped.message, stamp_ns=stamped.message.stamp_ns + by_ns)
        return Stamped(channel, stamped.log_time_ns, message)

    return change


def moved(motion: Callable[[int, Array], Array]) -> Change:
    """Odometry with other poses."""

    def change(stamped: Stamped) -> Stamped:
        if stamped.channel != ODOMETRY:
            return stamped
        now = stamped.log_time_ns
        return Stamped(ODOMETRY, now, Odometry.planar(now, FRAMES, motion(now, pose(now)), np.zeros((3, 3))))

    return change


def test_late_odometry_is_named_once_with_the_option(tmp_path: Path) -> None:
    (found,) = clocks(tmp_path, objects(), late(ODOMETRY, SECOND // 2))
    assert (found.level, found.topic) == ("problem", "/odom")
    assert found.text.startswith("its stamps are 0.5")
    assert found.text.endswith("late against /tags")
    offset = found.remedy.split("--time-offset odometry=")[1].split(",")[0]
    assert float(offset) == pytest.approx(-0.5, abs=0.01)


def test_a_sensor_that_log_times_say_is_early_is_the_one_to_correct(tmp_path: Path) -> None:
    (found,) = clocks(tmp_path, objects(), late(TAGS, -3 * SECOND // 10))
    assert found.topic == "/odom"  # what needs no odometry does not suffer
    assert found.text.startswith("the stamps of /tags are 0.")
    assert found.text.endswith("early against its own")
    assert "--time-offset scene_objects=+0.3" in found.remedy or "--time-offset scene_objects=+0.29" in found.remedy


def test_scans_tell_it_too(tmp_path: Path) -> None:
    assert clocks(tmp_path, scans()) == []
    (found,) = clocks(tmp_path, scans(), late(ODOMETRY, -SECOND // 5))
    assert found.text.endswith("early against /scan")
    offset = found.remedy.split("--time-offset odometry=")[1].split(",")[0]
    assert float(offset) == pytest.approx(0.2, abs=0.01)


@pytest.mark.parametrize(
    "change",
    [
        lambda stamped: stamped,
        lambda s: s if s.channel != ODOMETRY or not s.log_time_ns % (SECOND // 5) else None,
        lambda s: s if s.channel != ODOMETRY or not s.log_time_ns % SECOND else None,
        moved(lambda now, at: at + np.array([0, 0, 0.02 * now / SECOND])),
        moved(lambda now, at: at + np.array([5.0, 0, 1.0]) * (now > 15 * SECOND)),
        lambda s: s if not 10 * SECOND < s.log_time_ns < 17 * SECOND or s.channel != ODOMETRY else None,
        lambda s: dataclasses.replace(s, log_time_ns=s.log_time_ns + 3 * SECOND // 10 * (s.channel == ODOMETRY)),
    ],
    ids=["as it is", "5 Hz", "1 Hz", "drift", "a jump", "a gap", "logged late, stamped right"],
)
def test_no_false_alarm(tmp_path: Path, change: Change) -> None:
    assert clocks(tmp_path, objects(), change) == []


@pytest.mark.parametrize(
    ("motion", "text"),
    [
        (lambda _, at: at * np.array([1, 1, -1]), "it turns to the other side than /tags does"),
        (lambda *_: np.zeros(3), "it stands still from 1970-01-01T00:00:03.000000000Z to"),
        (lambda now, at: pose(12 * SECOND) if 12 * SECOND < now < 20 * SECOND else at, "it stands still from 1"),
    ],
    ids=["the other way", "frozen", "frozen for a while"],
)
def test_odometry_that_does_not_follow(tmp_path: Path, motion: Callable[[int, Array], Array], text: str) -> None:
    (found,) = clocks(tmp_path, objects(), moved(motion))
    assert (found.level, found.topic) == ("problem", "/odom")
    assert found.text.startswith(text)


def test_velocities_alone_are_added_up(tmp_path: Path) -> None:
    def change(stamped: Stamped) -> Stamped:
        if not isinstance(stamped.message, Odometry):
            return stamped
        now, step = stamped.log_time_ns, SECOND // 100
        rate = float((pose(now + step) - pose(now - step))[2]) * 50
        message = Odometry.planar(now, FRAMES, np.zeros(3), np.zeros((3, 3)), (0.0, rate))
        return Stamped(ODOMETRY, now, message)

    assert clocks(tmp_path, objects(), change) == []


def test_a_robot_that_stands_says_nothing(tmp_path: Path) -> None:
    standing = [
        Stamped(one.channel, one.log_time_ns, dataclasses.replace(one.message, ranges_m=scan(FULL, pose(0))))
        if one.channel == SCAN
        else one
        for one in scans()
    ]
    assert clocks(tmp_path, standing, moved(lambda *_: np.zeros(3))) == []


def test_a_lidar_that_hangs_upside_down_turns_the_same_way(tmp_path: Path) -> None:
    assert clocks(tmp_path, scans(upside_down=True)) == []
    (found,) = clocks(tmp_path, [one for one in scans(upside_down=True) if one.channel != TF_STATIC])
    assert found.text == "it turns to the other side than /scan does"
