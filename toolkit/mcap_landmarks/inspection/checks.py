"""What will go wrong with a log, and what to do about it: told before hours are spent."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.channels import RESULTS
from mcap_landmarks.geometry.frames import REMEDY
from mcap_landmarks.inspection.beam_checks import check_beams
from mcap_landmarks.inspection.camera_checks import check_camera_infos
from mcap_landmarks.inspection.cameras import ALL, info_topic
from mcap_landmarks.inspection.clock_checks import clock_findings
from mcap_landmarks.inspection.cloud_checks import check_clouds
from mcap_landmarks.inspection.finding import Finding
from mcap_landmarks.inspection.odometry_checks import check_frames, check_odometry, check_stray_stamps
from mcap_landmarks.inspection.scan_checks import check_scans
from mcap_landmarks.inspection.survey import Sensor, Survey, connected
from mcap_landmarks.moments import moment
from mcap_landmarks.recording.clocks import set_back, strays
from mcap_landmarks.recording.time_association import BESIDE_NS, WINDOW_NS

LEAST_HZ = {"image": 1.0, "scan": 2.0, "odometry": 5.0}
"""Rates below which much is lost between two messages, for a robot that walks."""

_SLOW = 1.05
"""By so much a usual period may be longer than that: clocks of recorders jitter, and are told to two digits."""
_LONG_GAP_NS = 10**9
_GAP_PERIODS = 10
"""A gap is told where it is longer than both a second and so many usual periods."""
_CLOCKS_APART_NS = 100_000_000
"""Drivers and networks delay messages by less; turning at 1 rad/s, it is 6 degrees already."""
_CLOCKS = ("odometry", "scan", "image")
"""The others' clocks are held against that of the first of these that there is."""
_OTHER_EPOCH_NS = 5 * 10**9
"""Stamps that are so far from log times are of another clock, or of a log that was recorded from a played one."""
_MANY = 0.9
"""Where fewer of a sensor's messages have a partner, something is wrong with clocks or rates."""
_BASES = ("base_footprint", "base_link")
"""What REP 105 and 120 call the robot's own frame."""


def check(found: Survey) -> list[Finding]:
    """Everything that is to be said about a log, problems first."""
    checks: tuple[Callable[[Survey], Iterator[Finding]], ...] = (
        _unreadable,
        _rates,
        _gaps,
        _stamps,
        check_stray_stamps,
        lambda found: clock_findings(found.clocks),
        _clocks,
        _partners,
        _frames,
        check_frames,
        _several,
        _odometry,
        check_odometry,
        _cameras,
        check_camera_infos,
        check_scans,
        check_beams,
        check_clouds,
    )
    findings = [finding for one in checks for finding in one(found)]
    return sorted(findings, key=lambda finding: finding.level != "problem")


def _unreadable(found: Survey) -> Iterator[Finding]:
    for topic, count in sorted(found.unreadable.items()):
        text = f"{count} messages do not fit their type"
        yield Finding("warning", "messages", topic, text, "check the recorder; what can be read is used")


def _rates(found: Survey) -> Iterator[Finding]:
    for sensor in found.sensors:
        least, log_ns = LEAST_HZ.get(sensor.role), sensor.times[0]
        if least is None or len(log_ns) < 2:
            continue
        seconds = float(np.median(np.diff(log_ns))) * 1e-9
        if seconds * least > _SLOW:
            text = f"{1 / seconds:.2g} Hz is slow for {sensor.role} messages"
            yield Finding("warning", "rate", sensor.topic, text, f"record at {least:g} Hz or more, or drive slower")


def _gaps(found: Survey) -> Iterator[Finding]:
    for sensor in found.sensors:
        steps = np.diff(sensor.times[0])
        if sensor.role == "camera_info" or len(steps) < 2:
            continue
        long = np.flatnonzero(steps > max(_LONG_GAP_NS, _GAP_PERIODS * float(np.median(steps))))
        if not len(long):
            continue
        worst = long[np.argmax(steps[long])]
        text = (
            f"{len(long)} gap{'s' if len(long) > 1 else ''}, the longest of {steps[worst] * 1e-9:.1f} s after "
            f"{moment(sensor.log_ns[int(worst)])}"
        )
        if sensor.role == "odometry" and steps[worst] > WINDOW_NS:
            remedy = (
                "bundles in gaps over 2 s have no odometry; cut the log with --start and --end, or drive there again"
            )
        else:
            remedy = (
                "nothing is seen there; look for lost messages in the recorder's output, or cut with --start and --end"
            )
        yield Finding("warning", "gap", sensor.topic, text, remedy)


def _stamps(found: Survey) -> Iterator[Finding]:
    for sensor in found.sensors:
        stamp_ns = sensor.times[1]
        unset = int((stamp_ns == 0).sum())
        if unset and not strays(*sensor.times).any():
            text = f"{unset} of {len(stamp_ns)} stamps are zero"
            yield Finding(
                "warning", "stamps", sensor.topic, text, "log times stand in for them; let the driver set them"
            )
        delay_ns = _delay_ns(sensor)
        if delay_ns is not None and abs(delay_ns) > _OTHER_EPOCH_NS:
            text = f"stamps are {_span(delay_ns)} log times"
            remedy = "--start, --end and lists of times count log times; all sensors must have stamps of one clock"
            yield Finding("warning", "stamps", sensor.topic, text, remedy)


def _clocks(found: Survey) -> Iterator[Finding]:
    """What log times say of clocks; nothing of those of which it is known by what sensors saw."""
    settled = {topic for one in found.clocks if one.offset is not None for topic in (one.odometry, one.sensor)}
    delays = _delays(found)
    reference = _reference(found, delays)
    for topic, delay_ns in delays.items():
        apart_ns = delay_ns - delays[reference] if reference else 0.0
        if abs(apart_ns) > _CLOCKS_APART_NS and not {topic, reference} <= settled:
            level = "problem" if abs(apart_ns) > WINDOW_NS else "warning"
            text = f"against log times its stamps are {_span(apart_ns)} those of {reference}"
            role = next((one.role for one in found.sensors if one.topic == topic), "")
            remedy = (
                f"synchronise the clocks (chrony, PTP) or let one machine stamp both; --time-offset {role}="
                f"{apart_ns * 1e-9:.3f} puts the log right if that is no delay of a network"
            )
            yield Finding(level, "clock", topic, text, remedy)


def _reference(found: Survey, delays: Mapping[str, float]) -> str:
    """The topic, of some, whose clock the others are held against; empty where there is none."""
    clocks = (sensor.topic for role in _CLOCKS for sensor in found.of(role))
    return next((topic for topic in clocks if topic in delays), "")


def _delays(found: Survey) -> dict[str, float]:
    """The delays in nanoseconds of the sensors' topics that tell one.

    Our results have the stamps of others, and what is known to be off is told already.
    """
    wrong = {one.blamed for one in found.clocks if one.is_harmful}
    sensed = [one for one in found.sensors if not one.topic.startswith(RESULTS) and one.topic not in wrong]
    return {sensor.topic: delay for sensor in sensed if (delay := _delay_ns(sensor)) is not None}


def _delay_ns(sensor: Sensor) -> float | None:
    """How much later than they were whole messages are logged, most often; None where that says nothing of clocks.

    What comes after a clock was set back does not count. Whether a scan's stamp is that of its first or of its last
    beam is not told; what explains more counts. Camera information holds until the next comes: it is often latched, or
    carried over from before a cut.
    """
    log_ns, stamp_ns = sensor.times
    known = (stamp_ns != 0) & ~strays(log_ns, stamp_ns)
    backs = set_back(log_ns[known], stamp_ns[known])
    known &= log_ns < (backs[0][0] if backs else np.int64(2**63 - 1))
    if sensor.role == "camera_info" or not known.any():
        return None
    delay_ns, sweep_ns = float(np.median(log_ns[known] - stamp_ns[known])), float(sensor.sweep_ns)
    if sensor.role in {"scan", "point_cloud"} and not sweep_ns and known.sum() > 1:
        sweep_ns = float(np.median(np.diff(log_ns[known])))  # a LiDAR that turns takes no longer than to the next scan
    return min(delay_ns, delay_ns - sweep_ns, key=abs)


def _span(delay_ns: float) -> str:
    return f"{abs(delay_ns) * 1e-9:.3g} s {'before' if delay_ns > 0 else 'after'}"


def _partners(found: Survey) -> Iterator[Finding]:
    images, odometry = found.of("image"), found.of("odometry")
    for sensor in (*found.of("scan"), *found.of("scene_objects")):
        moments = sensor.moments
        if not len(moments):
            continue
        for others, widest_ns, remedy in (
            (odometry, WINDOW_NS, "bundles without odometry build no map; check clocks and gaps of odometry"),
            (
                images if sensor.role == "scan" else [],
                BESIDE_NS,
                "objects get a class from images; record more of them",
            ),
        ):
            for other in others:
                share = _share_near(moments, other.moments, widest_ns)
                if share < _MANY:
                    level = "warning" if share else "problem"
                    text = (
                        f"{100 * share:.0f} % of its messages have one of {other.topic} within {widest_ns * 1e-9:g} s"
                    )
                    yield Finding(level, "partners", sensor.topic, text, remedy)


def _share_near(moments: NDArray[np.int64], others: NDArray[np.int64], widest_ns: int) -> float:
    if not len(others):
        return 0.0
    after = np.clip(np.searchsorted(others, moments), 0, len(others) - 1)
    before = np.clip(after - 1, 0, None)
    distance = np.minimum(np.abs(others[after] - moments), np.abs(others[before] - moments))
    return float((distance <= widest_ns).mean())


def _frames(found: Survey) -> Iterator[Finding]:
    base = _base(found)
    scans = [sensor for sensor in found.of("scan") if sensor.frame]
    if base is None and scans:
        base = scans[0].frame
        yield _without_base(found, scans[0])
    base = base or _BASES[0]
    reached = connected(found.edges, base)
    for sensor in (*(found.of("camera_info") or found.of("image")), *scans):
        if sensor.frame and sensor.frame not in reached:
            text = f"no transforms lead from {sensor.frame} to {base}"
            yield Finding("problem", "frames", sensor.topic, text, REMEDY)


def _base(found: Survey) -> str | None:
    """The robot's own frame, if transforms name one."""
    names = {name for edge in found.edges for name in edge}
    return next((name for name in (*_BASES, *sorted(found.bases)) if name in names), None)


def _without_base(found: Survey, scan: Sensor) -> Finding:
    if found.edges or scan.frame in _BASES:
        text = f"no transforms lead from {scan.frame} to a base frame: the robot is taken to be where the LiDAR is"
        return Finding("warning", "frames", scan.topic, text, REMEDY)
    text = f"there are no transforms: nothing says where the LiDAR ({scan.frame}) sits on the robot"
    return Finding("problem", "frames", scan.topic, text, REMEDY)


def _several(found: Survey) -> Iterator[Finding]:
    for role, option in (("scan", "--scan TOPIC, twice to merge two"), ("odometry", "--odom TOPIC")):
        topics = [sensor.topic for sensor in found.of(role)]
        if len(topics) > 1:
            text = f"{' and '.join(topics)} could be the {role}: verbs ask which one"
            yield Finding("warning", "choice", "", text, f"choose with {option}")


def _odometry(found: Survey) -> Iterator[Finding]:
    if not found.of("odometry"):
        text = "there is no odometry: no map can be built, and localize takes every bundle alone"
        yield Finding("warning", "frames", "", text, "record it, or name a topic with --odom (poses and /tf do too)")


def _cameras(found: Survey) -> Iterator[Finding]:
    infos, images = {info.topic: info.frame for info in found.of("camera_info")}, found.of("image")
    lone = [sensor.topic for sensor in images if info_topic(sensor.topic, sensor.frame, infos) is None]
    for topic in lone if len(images) > 1 or not infos else []:
        text = "no camera_info goes with these images: they cannot be fused with scans"
        level = "warning" if infos else "problem"
        yield Finding(level, "camera", topic, text, "record the camera's camera_info topic too")
    if len(images) > 1:
        text = f"images are on {len(images)} topics: {', '.join(sensor.topic for sensor in images)}"
        remedy = (
            f"choose with --image TOPIC, several times for several cameras, or --image {ALL} for all with camera_info"
        )
        yield Finding("warning", "camera", "", text, remedy)
