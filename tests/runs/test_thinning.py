"""Which images are left out, by rate and by motion."""

import math
from collections import Counter

import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_IMAGE, ODOMETRY
from mcap_landmarks.errors import UsageError
from mcap_landmarks.messages.codec import encode
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.runs.thinning import TOO_FAST, TOO_NEAR, Thinning, parse_thinning, thin
from mcap_landmarks.stage import Connection, RawMessage

IMAGES, ODOM = Connection(CAMERA_IMAGE.topic, "", b""), Connection(ODOMETRY.topic, Odometry.ROS_TYPE, b"")


def image(time_ns: int) -> RawMessage:
    return RawMessage(IMAGES, time_ns, time_ns, 0, b"")


def odometry(time_ns: int, *pose: float) -> RawMessage:
    message = Odometry.planar(time_ns, ("odom", "base"), np.array(pose), np.zeros((3, 3)))
    return RawMessage(ODOM, time_ns, time_ns, 0, encode(message))


def kept(raws: list[RawMessage], thinning: Thinning) -> tuple[list[int], Counter[str]]:
    dropped = Counter[str]()
    left = [raw for raw in thin(raws, [IMAGES], [ODOM], thinning, dropped) if raw.connection is IMAGES]
    return [raw.log_time_ns for raw in left], dropped


@pytest.mark.parametrize("rate_hz", [30.0, 10.0, 7.0, 0.5])
def test_the_rate_is_kept_on_the_mean_whatever_the_jitter(rate_hz: float) -> None:
    rng = np.random.default_rng(1)
    times = np.sort(np.arange(900) * 33_333_333 + rng.integers(-4_000_000, 4_000_000, 900) + 10**9)
    left, dropped = kept([image(int(time)) for time in times], Thinning(rate_hz))
    assert len(left) == pytest.approx(30 * min(rate_hz, 30), rel=0.01, abs=1)
    assert dropped[TOO_FAST] == 900 - len(left)


def test_after_a_pause_the_rate_goes_on_without_a_burst() -> None:
    times = [0, 10**9, 60 * 10**9, 60 * 10**9 + 1, 60 * 10**9 + 10**8]
    assert kept([image(time) for time in times], Thinning(1.0))[0] == [0, 10**9, 60 * 10**9]


def test_images_are_taken_after_motion_or_turning() -> None:
    poses = [(0, 0, 0), (0.1, 0, 0), (0.25, 0, 0), (0.25, 0, 0.05), (0.25, 0, -0.1), (0.25, 0, -0.1), (0.5, 0, -0.1)]
    raws = [raw for i, pose in enumerate(poses) for raw in (odometry(10 * i, *pose), image(10 * i + 1))]
    left, dropped = kept(raws, Thinning(every_m=0.2, every_rad=math.radians(5)))
    assert left == [1, 21, 41, 61]
    assert dropped == {TOO_NEAR: 3}
    assert kept(raws, Thinning(every_rad=math.radians(5)))[0] == [1, 41]


def test_each_of_several_cameras_is_thinned_by_itself() -> None:
    """The first camera's images must not be the only ones because they always come a little earlier."""
    rear = Connection("/rear/image_raw", "", b"")
    raws = [odometry(0, 0, 0, 0)]
    for i in range(1, 9):
        raws += [odometry(100 * i, 0.1 * i, 0, 0), image(100 * i + 1), RawMessage(rear, 100 * i + 2, 0, 0, b"")]
    for thinning in (Thinning(1e9 / 200), Thinning(every_m=0.19)):
        left = [raw for raw in thin(raws, [IMAGES, rear], [ODOM], thinning, Counter()) if raw.connection is not ODOM]
        assert [raw.connection for raw in left] == [IMAGES, rear] * 4


def test_without_odometry_so_far_every_image_is_taken() -> None:
    raws = [image(1), image(2), odometry(3, 0, 0, 0), image(4), odometry(5, math.nan, 0, 0), image(6)]
    assert kept(raws, Thinning(every_m=0.2))[0] == [1, 2, 4]


@pytest.mark.parametrize(
    ("text", "metres", "degrees"), [("0.2m,5deg", 0.2, 5), ("5deg", None, 5), ("1e-1m", 0.1, None), (" 2 m ", 2, None)]
)
def test_options_that_can_be_read(text: str, metres: float | None, degrees: float | None) -> None:
    found = parse_thinning(None, text)
    assert found.every_m == metres
    assert found.every_rad == (None if degrees is None else math.radians(degrees))
    assert found.by_motion


@pytest.mark.parametrize("text", ["5", "0m", "-1m", "m", "1km", "infm", "1m,", "1m;5deg"])
def test_options_that_cannot_be_read(text: str) -> None:
    with pytest.raises(UsageError, match=r"such as 0\.2m,5deg"):
        parse_thinning(None, text)
    with pytest.raises(UsageError, match="above 0"):
        parse_thinning(-1.0, None)
