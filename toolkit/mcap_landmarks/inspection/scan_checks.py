"""What is wrong with scans, and what the stages make of it."""

from collections.abc import Iterator

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.inspection.finding import Finding
from mcap_landmarks.inspection.survey import Survey
from mcap_landmarks.lidar.scan_beams import check_level
from mcap_landmarks.lidar.scan_times import NO_TIMES
from mcap_landmarks.mounting import base_in

_LONG_NS = 50_000_000
"""A robot of 0.5 m/s moves by 2.5 cm meanwhile, more than a range is unsure."""
_SET_RIGHT = "nothing has to be done; set it right in the driver, for other programs"
_LATER = "record scans that say what they are, see sensor_msgs/LaserScan; the driver's settings tell its units"
_UNTIMED = "while the robot moves, what scans show is less sure: let the driver set time_increment in seconds"


def check_scans(found: Survey) -> Iterator[Finding]:
    """What is repaired in scans, which of them are not read, and whether they can be de-skewed and are level."""
    for topic, readings in sorted(found.readings.items()):
        for repair, count in sorted(readings.repairs.items()):
            remedy = _UNTIMED if repair == NO_TIMES else _SET_RIGHT
            yield Finding("warning", "scan", topic, f"{count} of {readings.looked_at} {repair}", remedy)
        refused = readings.refusals.total()
        if refused:
            level = "problem" if refused == readings.looked_at else "warning"
            ((reason, _),) = readings.refusals.most_common(1)
            yield Finding(
                level, "scan", topic, f"{refused} of {readings.looked_at} scans cannot be read: {reason}", _LATER
            )
    yield from _steep(found)
    for sensor in found.of("scan") if not found.of("odometry") else []:
        if sensor.sweep_ns >= _LONG_NS:
            text = (
                f"a scan takes {sensor.sweep_ns * 1e-9:.2g} s and cannot be de-skewed without odometry: what it shows "
                "while the robot moves is less sure"
            )
            yield Finding("warning", "scan", sensor.topic, text, "record odometry")


def _steep(found: Survey) -> Iterator[Finding]:
    """LiDARs whose scan plane is not level by the transforms; whether these lead to them is checked elsewhere."""
    tree = found.log_frames().tree
    for sensor in found.of("scan"):
        if plain(sensor.frame) not in tree:
            continue
        try:
            base_from_lidar = tree.lookup(base_in(tree, sensor.frame), sensor.frame)
        except RecordingError:
            continue
        try:
            check_level(sensor.frame, base_from_lidar)
        except RecordingError as error:
            text, _, remedy = str(error).partition("; ")
            yield Finding("problem", "scan", sensor.topic, text, remedy)
