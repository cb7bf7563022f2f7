"""What can go wrong once in a good log: kinds of mutation, pure functions of its messages and a generator."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from mcap_landmarks.channels import CAMERA_INFO, DETECTIONS, SCAN, TF, TF_STATIC
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.header import stamp_in
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.transforms import TFMessage

from tests.benchmark.log_edits import (
    SECOND_NS,
    SENSORS,
    STAMPED,
    Change,
    Log,
    Sensed,
    any_of,
    by_time,
    changed,
    moment_in,
    one_row,
    rows_of,
    stamped,
    with_message,
    without,
)
from tests.benchmark.odometry_mutations import (
    odometry_frozen,
    odometry_gap,
    odometry_heading_jumps,
    odometry_jumps,
    odometry_lost_for_a_while,
    odometry_number_lost,
    odometry_outlier,
    odometry_reset,
    odometry_stops,
    second_robot,
)


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of mutation: `words` is what a note that concerns it matches; `may_refuse` tells that a refusal is right.

    That is so where what was taken cannot be had from the rest of the log.
    """

    change: Change
    words: str
    may_refuse: bool = False

    @property
    def name(self) -> str:
        """In words."""
        return self.change.__name__.replace("_", " ")


def _one_stamped(log: Log, rng: np.random.Generator, stamp: Callable[[int], int]) -> Log:
    row = one_row(log, any_of(STAMPED, rng), rng)
    return with_message(log, row, stamped(log[row], stamp))


def stamp_zero(log: Log, rng: np.random.Generator) -> Log:
    """A message that was stamped before there was a clock."""
    return _one_stamped(log, rng, lambda _: 0)


def stamp_in_the_future(log: Log, rng: np.random.Generator) -> Log:
    """A glitch of a clock by a second up to a month."""
    ahead_ns = round(10 ** rng.uniform(0, 6.4) * SECOND_NS)
    return _one_stamped(log, rng, lambda stamp_ns: min(stamp_ns + ahead_ns, (2**31 - 1) * SECOND_NS))


def stamp_in_the_past(log: Log, rng: np.random.Generator) -> Log:
    """The same, back."""
    behind_ns = round(10 ** rng.uniform(0, 6.4) * SECOND_NS)
    return _one_stamped(log, rng, lambda stamp_ns: stamp_ns - behind_ns)


def stamp_of_the_message_before(log: Log, rng: np.random.Generator) -> Log:
    """A driver that stamps two messages alike."""
    channel = any_of(STAMPED, rng)
    row = one_row(log, channel, rng, 1)
    before = max(i for i in rows_of(log, channel) if i < row)
    stamp_ns = stamp_in(log[before].data)
    return with_message(log, row, stamped(log[row], lambda _: stamp_ns))


def _set_back(log: Log, from_ns: int, by_ns: int) -> Log:
    """All sensors' stamps set back from a log time on."""
    return tuple(
        stamped(raw, lambda stamp_ns: max(1, stamp_ns - by_ns))
        if raw.log_time_ns >= from_ns and raw.connection.topic in SENSORS
        else raw
        for raw in log
    )


def clock_restarted(log: Log, rng: np.random.Generator) -> Log:
    """The clock of the whole robot is set back by a second up to a day, from somewhere on."""
    return _set_back(log, moment_in(log, rng, 0.2, 0.8), round(10 ** rng.uniform(0, 5) * SECOND_NS))


def clock_begins_again(log: Log, rng: np.random.Generator) -> Log:
    """Simulation time that goes back to where the log began."""
    from_ns = moment_in(log, rng, 0.3, 0.7)
    return _set_back(log, from_ns, from_ns - log[0].log_time_ns)


def frame_of_one_message(log: Log, rng: np.random.Generator) -> Log:
    """One message in a frame that there is not, or in none."""
    row, name = one_row(log, any_of(STAMPED, rng), rng), str(rng.choice(["", "other_link", "map"]))

    def change(message: Sensed) -> Sensed:
        if isinstance(message, Odometry) and rng.random() < 0.5:
            return replace(message, child_frame_id=name)
        return replace(message, frame_id=name)

    return with_message(log, row, changed(log[row], SENSORS[log[row].connection.topic], change))


def transform_quaternion_lost(log: Log, rng: np.random.Generator) -> Log:
    """One transform, static or of odometry, with a quaternion of zeros or NaN."""
    channel = any_of((TF_STATIC, TF), rng)
    row, value = one_row(log, channel, rng), float(rng.choice([0.0, np.nan]))
    steps = list(decode(TF.message, log[row].data).transforms)
    which = int(rng.integers(len(steps)))
    steps[which] = replace(steps[which], rotation_xyzw=np.full(4, value))
    return with_message(log, row, changed(log[row], TF, lambda _: TFMessage(tuple(steps))))


def scan_gap(log: Log, rng: np.random.Generator) -> Log:
    """No scans for a while."""
    return without(log, rng, (SCAN,), (0.3, 3.0))


def image_gap(log: Log, rng: np.random.Generator) -> Log:
    """No images for a while."""
    return without(log, rng, (DETECTIONS, CAMERA_INFO), (0.3, 3.0))


def _stretch(log: Log, rng: np.random.Generator) -> list[int]:
    """The rows of 2 to 10 messages of a topic, one after the other."""
    rows = rows_of(log, any_of(STAMPED, rng))
    first = int(rng.integers(len(rows) - 10))
    return rows[first : first + int(rng.integers(2, 11))]


def duplicates(log: Log, rng: np.random.Generator) -> Log:
    """Some messages twice."""
    twice = {*_stretch(log, rng)}
    return tuple(one for i, raw in enumerate(log) for one in ((raw, raw) if i in twice else (raw,)))


def out_of_order(log: Log, rng: np.random.Generator) -> Log:
    """Some messages were logged in another order than they were made."""
    rows = _stretch(log, rng)
    times_ns = [log[row].log_time_ns for row in rows]
    mixed = dict(zip(rows, rng.permutation(times_ns).tolist(), strict=True))
    return by_time([raw._replace(log_time_ns=mixed.get(i, raw.log_time_ns)) for i, raw in enumerate(log)])


def dropped(log: Log, rng: np.random.Generator) -> Log:
    """A share of a topic's messages never came."""
    topic, share = any_of(STAMPED, rng).topic, rng.uniform(0.05, 0.3)
    return tuple(raw for raw in log if raw.connection.topic != topic or rng.random() >= share)


def scan_without_ranges(log: Log, rng: np.random.Generator) -> Log:
    """One scan whose ranges are NaN, infinite, zero or negative."""
    row, value = one_row(log, SCAN, rng), float(rng.choice([np.nan, np.inf, -np.inf, 0.0, -1.0]))
    part = rng.uniform(0.1, 1.0)
    lost = rng.random(len(decode(SCAN.message, log[row].data).ranges_m)) < part
    return with_message(
        log, row, changed(log[row], SCAN, lambda scan: replace(scan, ranges_m=np.where(lost, value, scan.ranges_m)))
    )


def scan_in_millimetres(log: Log, rng: np.random.Generator) -> Log:
    """One scan whose ranges are in millimetres, with or without its limits."""
    row, limits = one_row(log, SCAN, rng), 1000 if rng.random() < 0.5 else 1

    def change(scan: LaserScan) -> LaserScan:
        least_m, most_m = scan.range_min_m * limits, scan.range_max_m * limits
        return replace(scan, ranges_m=scan.ranges_m * 1000, range_min_m=least_m, range_max_m=most_m)

    return with_message(log, row, changed(log[row], SCAN, change))


def scan_of_another_size(log: Log, rng: np.random.Generator) -> Log:
    """One scan that lacks its last beams, or has every other one and says so."""
    row, count, halved = one_row(log, SCAN, rng), int(rng.integers(10, 350)), rng.random() < 0.5

    def change(scan: LaserScan) -> LaserScan:
        if not halved:
            return replace(scan, ranges_m=scan.ranges_m[:count])
        step_rad, step_s = scan.angle_increment_rad * 2, scan.time_increment_s * 2
        return replace(scan, ranges_m=scan.ranges_m[::2], angle_increment_rad=step_rad, time_increment_s=step_s)

    return with_message(log, row, changed(log[row], SCAN, change))


def camera_info_lost(log: Log, rng: np.random.Generator) -> Log:
    """One CameraInfo of zeros."""
    row, none = one_row(log, CAMERA_INFO, rng), np.zeros((3, 4))

    def change(info: CameraInfo) -> CameraInfo:
        return replace(info, intrinsics=none[:, :3], projection=none)

    return with_message(log, row, changed(log[row], CAMERA_INFO, change))


def truncated(log: Log, rng: np.random.Generator) -> Log:
    """One message that lacks its last bytes."""
    row = one_row(log, any_of((*STAMPED, CAMERA_INFO), rng), rng)
    return with_message(log, row, log[row]._replace(data=bytes(log[row].data)[: int(rng.integers(len(log[row].data)))]))


def static_transforms_late(log: Log, rng: np.random.Generator) -> Log:
    """The recorder found the static transforms late."""
    row, at_ns = one_row(log, TF_STATIC, rng), moment_in(log, rng, 0.0, 1.0)
    return by_time(with_message(log, row, log[row]._replace(log_time_ns=at_ns)))


def boxes_that_cannot_be(log: Log, rng: np.random.Generator) -> Log:
    """One image whose boxes are NaN, turned round, or outside."""
    rows = [row for row in rows_of(log, DETECTIONS) if len(decode(DETECTIONS.message, log[row].data).boxes_xyxy)]
    row = rows[int(rng.integers(len(rows)))]
    change: Callable[[Array], Array] = [
        lambda boxes: np.full_like(boxes, np.nan),
        lambda boxes: boxes[:, [2, 3, 0, 1]],
        lambda boxes: boxes + 3000.0,
    ][int(rng.integers(3))]
    return with_message(
        log, row, changed(log[row], DETECTIONS, lambda found: replace(found, boxes_xyxy=change(found.boxes_xyxy)))
    )


_ODOMETRY, _STAMP, _SCAN, _IMAGE = "odom", "stamp|time goes back|set back", "scan", "detection|image|box"
KINDS = (
    Kind(stamp_zero, _STAMP),
    Kind(stamp_in_the_future, _STAMP),
    Kind(stamp_in_the_past, _STAMP),
    Kind(stamp_of_the_message_before, f"{_STAMP}|nearest to no bundle"),
    Kind(clock_restarted, _STAMP),
    Kind(clock_begins_again, _STAMP),
    Kind(frame_of_one_message, "frame"),
    Kind(odometry_number_lost, _ODOMETRY),
    Kind(transform_quaternion_lost, "transform|quaternion", may_refuse=True),
    Kind(odometry_outlier, _ODOMETRY),
    Kind(odometry_jumps, _ODOMETRY),
    Kind(odometry_reset, _ODOMETRY),
    Kind(odometry_heading_jumps, _ODOMETRY),
    Kind(odometry_lost_for_a_while, _ODOMETRY),
    Kind(odometry_frozen, _ODOMETRY),
    Kind(odometry_gap, _ODOMETRY),
    Kind(scan_gap, _SCAN),
    Kind(image_gap, _IMAGE),
    Kind(odometry_stops, _ODOMETRY),
    Kind(second_robot, _ODOMETRY, may_refuse=True),
    Kind(duplicates, "twice|time goes back|duplicate|nearest to no bundle"),
    Kind(out_of_order, f"{_STAMP}|order"),
    Kind(dropped, "without|nearest to no bundle"),
    Kind(scan_without_ranges, _SCAN),
    Kind(scan_in_millimetres, _SCAN),
    Kind(scan_of_another_size, _SCAN),
    Kind(camera_info_lost, "camera"),
    Kind(truncated, "bytes|header"),
    Kind(static_transforms_late, "transform"),
    Kind(boxes_that_cannot_be, _IMAGE),
)
"""All kinds, in an order that stays: a seed's draws depend on it."""
