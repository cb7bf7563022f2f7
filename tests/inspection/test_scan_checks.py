"""What `info --check` says of scans in a plane that is not level."""

import numpy as np
import pytest
from mcap_landmarks.inspection.finding import Finding
from mcap_landmarks.inspection.scan_checks import check_scans
from mcap_landmarks.inspection.survey import Sensor, Survey
from mcap_landmarks.messages.transforms import Transform
from scipy.spatial.transform import Rotation


def findings(tilt_deg: float) -> list[Finding]:
    rotation = Rotation.from_euler("x", tilt_deg, degrees=True).as_quat()
    found = Survey(sensors=[Sensor("scan", "/scan", frame="/base_scan")])
    found.transforms.take(Transform(1, "base_footprint", "base_scan", np.zeros(3), rotation), is_static=True)
    return list(check_scans(found))


@pytest.mark.parametrize("tilt_deg", [0.0, 50.0, 180.0])
def test_a_level_lidar_is_not_named(tilt_deg: float) -> None:
    assert findings(tilt_deg) == []


def test_a_lidar_on_its_side_is_a_problem() -> None:
    (finding,) = findings(90.0)
    assert (finding.level, finding.check, finding.topic) == ("problem", "scan", "/scan")
    assert finding.text == "the scan plane of base_scan is not level: by the transforms it is tilted by 90 deg"
    assert finding.remedy.startswith("correct how the LiDAR is mounted")
