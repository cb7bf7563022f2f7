"""Scans whose numbers are not what LaserScan says: read as what they are, or refused; sound ones stay as they are."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from mcap_landmarks.errors import MessageError
from mcap_landmarks.lidar.scan_angles import DEGREES, INCREMENT_TOO_LARGE, INCREMENT_UNSET
from mcap_landmarks.lidar.scan_repair import HIDING, LIMITS_IN_MILLIMETRES, MILLIMETRES, ScanTopic, repaired
from mcap_landmarks.lidar.scan_times import NO_TIMES, TIME_OF_A_TURN
from mcap_landmarks.messages.codec import decode, encode
from mcap_landmarks.messages.scan import LaserScan, MultiEchoLaserScan

STEP = 6.28 / 359
EMPTY = np.zeros(0, np.float32)
RANGES = np.where(np.arange(360) % 3, np.linspace(0.6, 9.4, 360), np.inf).astype(np.float32)
SOUND = LaserScan(10**9, "laser", 0.0, 6.28, STEP, 0.2 / 360, 0.2, 0.12, 15.0, RANGES, EMPTY)
HALF = replace(SOUND, angle_min_rad=-1.57, angle_max_rad=1.57, angle_increment_rad=3.14 / 359)

Change = Callable[[LaserScan], LaserScan]


def in_(**factors: float) -> Change:
    return lambda scan: replace(scan, **{name: factor * getattr(scan, name) for name, factor in factors.items()})


def with_(**values: object) -> Change:
    return lambda scan: replace(scan, **values)  # type: ignore[arg-type]


ANGLES = {name: float(np.rad2deg(1)) for name in ("angle_min_rad", "angle_max_rad", "angle_increment_rad")}
REPAIRED: dict[str, tuple[Change, tuple[str, ...]]] = {
    "all in millimetres": (in_(ranges_m=1e3, range_min_m=1e3, range_max_m=1e3), (MILLIMETRES,)),
    "ranges in millimetres": (in_(ranges_m=1e3), (MILLIMETRES,)),
    "limits in millimetres": (in_(range_min_m=1e3, range_max_m=1e3), (LIMITS_IN_MILLIMETRES,)),
    "angles in degrees": (in_(**ANGLES), (DEGREES,)),
    "an increment in degrees": (in_(angle_increment_rad=ANGLES["angle_min_rad"]), (DEGREES,)),
    "limits in degrees": (in_(angle_min_rad=57.29578, angle_max_rad=57.29578), (DEGREES,)),
    "no increment": (with_(angle_increment_rad=0.0), (INCREMENT_UNSET,)),
    "an increment of two turns": (in_(angle_increment_rad=2.0), (INCREMENT_TOO_LARGE,)),
    "milliseconds": (in_(time_increment_s=1e3), ("scans whose time_increment is in milliseconds, read as such",)),
    "microseconds": (in_(time_increment_s=1e6), ("scans whose time_increment is in microseconds, read as such",)),
    "nanoseconds": (
        in_(time_increment_s=1e9, scan_time_s=1e9),
        ("scans whose time_increment is in nanoseconds, read as such",),
    ),
    "the time of a turn": (with_(time_increment_s=0.2), (TIME_OF_A_TURN,)),
}


OF_A_TURN = {"an increment of two turns"}
"""Half a turn twice as wide is a turn: that has two readings."""


@pytest.mark.parametrize(
    ("name", "sound"),
    [*((name, SOUND) for name in REPAIRED), *((name, HALF) for name in REPAIRED if name not in OF_A_TURN)],
)
def test_what_has_one_reading_is_read_so(name: str, sound: LaserScan) -> None:
    change, words = REPAIRED[name]
    scan, done = repaired(change(sound))
    assert done == words
    np.testing.assert_allclose(scan.ranges_m, sound.ranges_m, rtol=1e-6)
    for field in ("angle_min_rad", "angle_increment_rad", "range_min_m", "range_max_m", "time_increment_s"):
        assert getattr(scan, field) == pytest.approx(getattr(sound, field), rel=4e-3, abs=1e-6), field


@pytest.mark.parametrize(
    "change",
    [
        with_(),
        with_(range_min_m=0.0, range_max_m=0.0),
        with_(range_max_m=np.inf),
        with_(angle_max_rad=0.0),
        with_(angle_min_rad=6.28, angle_max_rad=0.0, angle_increment_rad=-STEP),
        with_(angle_min_rad=1.57, angle_max_rad=-1.57, angle_increment_rad=-3.14 / 359),
        with_(angle_min_rad=2.0, angle_max_rad=-2.0, angle_increment_rad=(2 * np.pi - 4.0) / 359),
        with_(angle_min_rad=np.pi, angle_max_rad=-np.pi, angle_increment_rad=2 * np.pi / 360),
        with_(time_increment_s=0.0, scan_time_s=0.0),
        with_(time_increment_s=0.0),
        with_(ranges_m=np.full(360, np.inf, np.float32)),
        with_(ranges_m=np.zeros(360, np.float32)),
        with_(ranges_m=np.where(np.arange(360) % 4, np.float32(15.0), RANGES)),
        with_(ranges_m=np.where(np.arange(360) % 4, np.float32(65.535), RANGES)),
        with_(ranges_m=np.where(np.arange(360) % 4, np.float32(65535.0), RANGES), range_max_m=15.0),
        with_(ranges_m=RANGES[:180], angle_max_rad=STEP * 179),
        with_(ranges_m=RANGES[::2], angle_increment_rad=2 * STEP),
    ],
)
def test_what_is_as_the_standard_has_it_is_not_touched(change: Change) -> None:
    scan = change(SOUND)
    assert repaired(scan, 0.1) == (scan, ())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (in_(angle_increment_rad=0.5), "angle_increment contradicts its limits: 360 beams"),
        (with_(ranges_m=RANGES[:200]), "angle_increment contradicts its limits: 200 beams"),
        (with_(angle_increment_rad=0.0, angle_max_rad=0.0), "neither angle_increment nor limits"),
        (with_(angle_increment_rad=np.nan, angle_max_rad=np.nan), "neither angle_increment nor limits"),
        (with_(angle_min_rad=np.nan), "angle_min is nan"),
        (with_(ranges_m=EMPTY), "a scan of 0 beams"),
        (in_(ranges_m=1e2, range_min_m=1e2, range_max_m=1e2), "neither in metres nor in millimetres"),
        (in_(ranges_m=1e2), "in millimetres or in centimetres"),
        (lambda scan: replace(in_(ranges_m=1e2)(scan), range_max_m=0.0), "in millimetres or in centimetres"),
        (in_(ranges_m=1e2, range_min_m=1e2, range_max_m=200), "in millimetres or in centimetres"),
        (in_(angle_increment_rad=-1), "the other way round"),
        (
            in_(
                angle_min_rad=ANGLES["angle_min_rad"], angle_max_rad=ANGLES["angle_max_rad"], angle_increment_rad=-57.3
            ),
            "the other way round",
        ),
        (in_(angle_increment_rad=-57.3), "the other way round"),
        (with_(angle_min_rad=-1.57, angle_max_rad=1.57, angle_increment_rad=-3.14 / 359), "the other way round"),
        (with_(angle_min_rad=1.57, angle_max_rad=-1.57, angle_increment_rad=3.14 / 359), "the other way round"),
        (in_(ranges_m=1e6), "neither in metres nor in millimetres"),
    ],
)
def test_what_has_no_reading_or_two_is_named(change: Change, words: str) -> None:
    with pytest.raises(MessageError, match=words):
        repaired(change(SOUND))


def test_limits_that_are_no_numbers_are_not_set() -> None:
    scan, done = repaired(replace(SOUND, range_min_m=np.nan, range_max_m=np.nan))
    assert (scan.range_min_m, scan.range_max_m, done) == (0.0, 0.0, ())
    np.testing.assert_array_equal(scan.ranges_m, RANGES)
    scan, done = repaired(replace(SOUND, range_min_m=np.nan, ranges_m=1000 * RANGES))
    assert (scan.range_min_m, scan.range_max_m, done) == (0.0, 15.0, (MILLIMETRES,))


@pytest.mark.parametrize("limit_m", [0.5, 1.0, 4.0])
def test_a_limit_that_hides_most_of_what_came_back_does_not_count(limit_m: float) -> None:
    scan, done = repaired(replace(SOUND, range_max_m=limit_m))
    assert (scan.range_max_m, done) == (np.inf, (HIDING,))
    scan, done = repaired(replace(SOUND, range_max_m=6.0))
    assert (scan.range_max_m, done) == (6.0, ())


@pytest.mark.parametrize("increment_s", [np.nan, -1e-4, 40.0, 1e-2])
def test_times_that_cannot_be_are_not_known(increment_s: float) -> None:
    scan, done = repaired(replace(SOUND, time_increment_s=increment_s))
    assert (scan.time_increment_s, scan.scan_time_s, done) == (0.0, 0.2, (NO_TIMES,))


def test_the_time_between_scans_stands_in_for_that_of_a_scan() -> None:
    topic = ScanTopic()
    for i in range(4):
        wrong = replace(SOUND, stamp_ns=10**9 + i * 10**8, time_increment_s=np.nan, scan_time_s=0.0)
        scan, done = topic.take(wrong)
    assert (scan.scan_time_s, done) == (pytest.approx(0.1), (NO_TIMES,))


def test_of_several_echoes_the_nearest_counts() -> None:
    ros = MultiEchoLaserScan(replace(SOUND, ranges_m=RANGES[:4])).to_ros()
    ros.ranges[0].echoes = np.array([7.0, 0.05, 3.0], np.float32)
    ros.ranges[1].echoes = np.zeros(0, np.float32)
    ros.ranges[2].echoes = np.array([0.0, 0.0], np.float32)
    nearest = MultiEchoLaserScan.from_ros(ros).nearest
    np.testing.assert_array_equal(nearest.ranges_m, np.array([3.0, np.inf, 0.0, np.inf], np.float32))
    again = decode(MultiEchoLaserScan, encode(MultiEchoLaserScan(SOUND)))
    scan, done = ScanTopic().take(again)
    np.testing.assert_array_equal(scan.ranges_m, RANGES)
    assert done == ()
