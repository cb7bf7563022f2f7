"""Trajectories as TUM text: `time x y z qx qy qz qw` a line, time in seconds."""

from decimal import Decimal, InvalidOperation

import numpy as np

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.evaluation.trajectory import Trajectory
from mcap_landmarks.geometry.angles import quaternion_from_yaw, yaw_from_quaternion

_EXPECTED = "expected: time x y z qx qy qz qw"


def parse(text: str, name: str) -> Trajectory:
    """The trajectory of a TUM text, its times to the nanosecond; lines that begin with # are comments.

    Raises:
        RecordingError: with the name of the file, the line, and what was expected there.
    """
    times, rows = [], []
    for line, content in enumerate(text.splitlines(), start=1):
        words = content.replace(",", " ").split()
        if not words or words[0].startswith("#"):
            continue
        try:
            times.append(int((Decimal(words[0]) * 10**9).to_integral_value()))
            rows.append([float(word) for word in words[1:]])
        except (ValueError, InvalidOperation, OverflowError) as error:
            raise RecordingError(f"{name}, line {line}: {content.strip()[:60]!r} is no pose; {_EXPECTED}") from error
        if len(rows[-1]) != 7 or not np.isfinite(rows[-1]).all() or abs(times[-1]) >= 2**63:
            raise RecordingError(f"{name}, line {line}: {content.strip()[:60]!r} is no pose; {_EXPECTED}")
    if not rows:
        raise RecordingError(f"{name}: holds no pose; {_EXPECTED}, one a line")
    values = np.array(rows)
    poses = np.column_stack([values[:, :2], yaw_from_quaternion(values[:, 3:])])
    return Trajectory.of(np.array(times, dtype=np.int64), poses)


def render(trajectory: Trajectory) -> str:
    """A trajectory as TUM text, times and numbers to the last digit."""
    quaternions = quaternion_from_yaw(trajectory.poses[:, 2])
    lines = []
    for time_ns, pose, quaternion in zip(
        trajectory.time_ns.tolist(), trajectory.poses.tolist(), quaternions.tolist(), strict=True
    ):
        numbers = " ".join(repr(number + 0.0) for number in (pose[0], pose[1], 0.0, *quaternion))
        lines.append(f"{Decimal(time_ns).scaleb(-9):.9f} {numbers}\n")
    return "".join(lines)
