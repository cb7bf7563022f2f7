"""Planar LiDARs on their side are refused, and scans of nothing are counted, by either method."""

from typing import Literal

import numpy as np
import pytest
from mcap_landmarks.channels import SCAN_OBJECTS
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.stage import Omission
from mcap_landmarks.stages.cluster import process
from scipy.spatial.transform import Rotation

from tests.stages.test_cluster import SECOND, bundle, mounting, scan

NOTHING = np.full(360, np.inf)
SOMETHING = np.where(np.arange(360) == 180, 3.0, np.inf)
METHODS = pytest.mark.parametrize("method", ["default", "thesis"])


@METHODS
def test_scans_in_which_nothing_came_back_are_counted(method: Literal["default", "thesis"]) -> None:
    bundles = [bundle(scan(distances), mounting()) for distances in (NOTHING, SOMETHING, np.full(360, 15.0))]
    left_out = [entry for entry in process(bundles, ClusterConfig(method=method), {}) if isinstance(entry, Omission)]
    assert left_out == [Omission(SECOND + 5, "scans in which no beam returned anything")] * 2


@METHODS
def test_a_scan_of_things_out_of_view_is_no_scan_of_nothing(method: Literal["default", "thesis"]) -> None:
    config = ClusterConfig(method=method, range_m=(0.1, 1.0), view_deg=(-10.0, 10.0))
    made = process([bundle(scan(SOMETHING), mounting())], config, {})
    assert not [entry for entry in made if isinstance(entry, Omission)]


@METHODS
@pytest.mark.parametrize(("tilt_deg", "is_read"), [(0, True), (50, True), (70, False), (90, False), (180, True)])
def test_a_plane_that_is_not_level_is_refused(
    tilt_deg: float, is_read: bool, method: Literal["default", "thesis"]
) -> None:
    tilted = mounting(rotation=Rotation.from_euler("x", tilt_deg, degrees=True).as_quat())
    made = process([bundle(scan(SOMETHING), tilted)], ClusterConfig(method=method), {})
    if is_read:
        assert SCAN_OBJECTS in {entry.channel for entry in made if not isinstance(entry, Omission)}
        return
    words = rf"the scan plane of laser is not level: .* tilted by {tilt_deg} deg; correct how .* with --scan"
    with pytest.raises(RecordingError, match=words):
        list(made)
