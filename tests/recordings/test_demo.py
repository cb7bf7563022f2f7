"""The demo's recordings hold what a robot records, and the truth, but no results; and they are small."""

from pathlib import Path

import pytest
from mcap_landmarks.inspection.info import describe
from mcap_landmarks.resources import resource

LOGS = [resource("recordings", f"{name}.mcap") for name in ("demo_map", "demo_localize")]


@pytest.mark.parametrize("log", LOGS, ids=lambda path: path.stem)
def test_a_log_has_sensors_and_truth_and_no_results(log: Path) -> None:
    (found,) = describe(log, {})
    assert {role for role, topic in found.roles.items() if topic} >= {
        "image",
        "camera_info",
        "scan",
        "odometry",
        "truth",
    }
    assert not [channel.topic for channel in found.channels if channel.topic.startswith("/landmarks/")]


def test_together_they_stay_under_twelve_megabytes() -> None:
    assert sum(log.stat().st_size for log in LOGS) < 12e6
