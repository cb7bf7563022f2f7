"""What odometry, transforms and stamps will cost, by the same examination that stages make of them."""

from collections.abc import Iterator

from mcap_landmarks.channels import RESULTS
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.geometry.frames import REMEDY
from mcap_landmarks.inspection.finding import Finding
from mcap_landmarks.inspection.log_frames import BROKEN_REMEDY, LogFrames, told_circle
from mcap_landmarks.inspection.odometry_examination import STRAY, ExaminedOdometry, OdometryMessages, examine
from mcap_landmarks.inspection.survey import Sensor, Survey
from mcap_landmarks.mounting import base_in
from mcap_landmarks.recording.clocks import clock_of, set_back, shifts_of, strays

_DRIVER = "the driver should stamp messages when they are measured; those are left out"
_MENDED = "look at what publishes it; results there are less sure"


def check_stray_stamps(found: Survey) -> Iterator[Finding]:
    """Stamps that cannot be, and clocks that were set back."""
    for sensor in found.sensors:
        if sensor.topic.startswith(RESULTS) or sensor.role == "camera_info":
            continue
        log_ns, stamp_ns = sensor.times
        bad = strays(log_ns, stamp_ns)
        if bad.any():
            text = f"{int(bad.sum())} of {len(bad)} messages have a stamp that {STRAY.removeprefix('whose stamp ')}"
            yield Finding("warning", "stamps", sensor.topic, text, _DRIVER)
        good = ~bad & (stamp_ns != 0)
        backs = set_back(log_ns[good], stamp_ns[good])
        if backs:
            times = "once" if len(backs) == 1 else f"{len(backs)} times"
            text = f"the clock was set back {times}, first by {backs[0][1] * 1e-9:.1f} s: a played loop, or a restart"
            yield Finding(
                "warning", "stamps", sensor.topic, text, "what lies before and after is read as if it went on"
            )


def check_odometry(found: Survey) -> Iterator[Finding]:
    """Odometry that is refused, mended or partly left out."""
    for topic, result in examined_odometry(found).items():
        if result.refusal:
            text, _, remedy = result.refusal.removeprefix(f"{topic}: ").partition("; ")
            yield Finding("problem", "odometry", topic, text, remedy)
        left_out = [f"{count} {reason}" for reason, count in sorted(result.dropped.items()) if STRAY not in reason]
        for note in (*result.notes, *left_out):
            text, _, remedy = note.partition("; ")
            yield Finding("warning", "odometry", topic, text, remedy or _MENDED)


def examined_odometry(found: Survey) -> dict[str, ExaminedOdometry]:
    """The odometry of each topic as stages will take it."""
    return {topic: _examined(found, topic, messages) for topic, messages in sorted(found.odometry.items())}


def _examined(found: Survey, topic: str, messages: OdometryMessages) -> ExaminedOdometry:
    """Odometry as stages will take it: of the base that scans or scene objects have."""
    frames = found.log_frames()
    sensed = [sensor.frame for role in ("scan", "scene_objects") for sensor in found.of(role)]
    base = base_in(frames.tree, next(iter(sensed), ""))
    if base in sensed and base not in frames.tree:
        base = next((child for _, child in messages.frames if child), base)
    clock = clock_of(*messages.times, *shifts_of(*messages.times))
    return examine(topic, messages, clock, lambda frame: frames.base_from(base, frame, f"odometry on {topic} is"))


def check_frames(found: Survey) -> Iterator[Finding]:
    """Transforms that contradict each other, and ready-made objects and scans in a frame that does not tell enough."""
    frames = found.log_frames()
    if frames.circle:
        text, _, remedy = told_circle(frames.circle).partition("; ")
        yield Finding("problem", "frames", "", text, remedy)
        return
    for child, parents in sorted(frames.parents.items()):
        text = f"{child} has several parents in the transforms: {', '.join(sorted(parents))}"
        yield Finding("warning", "frames", "", text, "a frame has one parent: stop whatever publishes the others")
    for child in sorted(frames.broken):
        text = f"the transform of {child} has a quaternion of zeros or numbers that are not finite"
        yield Finding("warning", "frames", "", text, BROKEN_REMEDY)
    for sensor in found.of("scan"):
        if not sensor.frame:
            yield Finding("problem", "frames", sensor.topic, "its messages name no frame", "set it in the driver")
    for sensor in found.of("scene_objects"):
        yield from _objects(frames, sensor)


def _objects(frames: LogFrames, sensor: Sensor) -> Iterator[Finding]:
    """Ready-made objects that cannot be brought to the robot's frame."""
    base = base_in(frames.tree, sensor.frame)
    if "optical" in base:
        text = f"its objects are in the frame {base}, and no transforms lead from there to the robot"
        yield Finding("problem", "frames", sensor.topic, text, REMEDY)
        return
    try:
        frames.base_from(base, sensor.frame, "its objects are")
    except RecordingError as error:
        text, _, remedy = str(error).partition("; ")
        yield Finding("problem", "frames", sensor.topic, text, remedy)
