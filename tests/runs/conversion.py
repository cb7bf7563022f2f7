"""Conversions, and what others read in their outputs."""

from collections import Counter
from pathlib import Path

from mcap_landmarks.progress import unwatched
from mcap_landmarks.runs.conversion import Converted
from mcap_landmarks.runs.convert import Conversion, convert
from mcap_landmarks.runs.topic_selection import Selection
from pymcap_cli.doctor import Severity, examine_mcap
from rosbags.rosbag2 import Reader as Reader2


def run(paths: Path | list[Path], output: Path, selection: Selection | None = None) -> Conversion:
    several = paths if isinstance(paths, list) else [paths]
    return convert(several, output, selection or Selection(), {"rosbag2": {"distro": "humble"}}, unwatched)


def one(paths: Path | list[Path], output: Path, selection: Selection | None = None) -> Converted:
    (done,) = run(paths, output, selection).outputs
    return done


def doctor(path: Path, *severities: Severity) -> list[str]:
    """What pymcap-cli's doctor finds of some severities, by default errors."""
    with path.open("rb") as stream:
        report = examine_mcap(stream, path.stat().st_size, str(path))
    return [str(finding) for finding in report.findings if finding.severity in (severities or (Severity.ERROR,))]


def stored(path: Path) -> Counter[tuple[str, int, bytes]]:
    """Topic, time and payload of every message of a ROS 2 bag, as rosbags reads them."""
    with Reader2(path) as reader:
        return Counter((connection.topic, time, bytes(data)) for connection, time, data in reader.messages())
