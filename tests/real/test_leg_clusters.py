"""Real scans of walking people (angusleigh/leg_tracker) with the places of their legs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.beams import echoes, sweep
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.segments import Breaks, extent_m, near_clusters, points_of, segments
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_typestore
from scipy.optimize import linear_sum_assignment

pytestmark = pytest.mark.slow

LARGEST_LEGS_M = 0.35
NEAR_M = 0.05


def recorded(path: Path) -> list[tuple[Any, Array]]:
    """Scans and the places (N, 2) of the legs in each."""
    store, scans, places = get_typestore(Stores.ROS1_NOETIC), [], []
    with Reader(path) as reader:
        for connection, _, raw in reader.messages():
            if connection.topic == "/training_scan":
                scans.append(store.deserialize_ros1(raw, connection.msgtype))
            elif connection.topic == "/leg_cluster_positions":
                poses = store.deserialize_ros1(raw, connection.msgtype).poses  # type: ignore[attr-defined]
                places.append(np.array([[pose.position.x, pose.position.y] for pose in poses]).reshape(-1, 2))
    return list(zip(scans, places, strict=True))


def centroids(scan: Any, config: ClusterConfig) -> Array:  # noqa: ANN401 - a type that rosbags makes
    """The middles (N, 2) of what is no larger than legs."""
    angles = scan.angle_min + np.arange(len(scan.ranges)) * scan.angle_increment
    beams = sweep(angles, echoes(scan.ranges, scan.range_min, scan.range_max), np.eye(4))
    breaks = Breaks(np.deg2rad(config.incidence_deg), config.sigma_m, config.link_m)
    clusters = [points_of(beams, one) for one in near_clusters(beams, segments(beams, breaks, 4.5), config.near_m)]
    return np.array([points.mean(axis=0) for points in clusters if extent_m(points) <= LARGEST_LEGS_M]).reshape(-1, 2)


def test_clusters_are_where_the_legs_are(shared_data: Path) -> None:
    found = labelled = 0
    for scan, places in recorded(shared_data / "bags" / "legtracker_positive_2_extracted.bag"):
        middles = centroids(scan, ClusterConfig())
        apart = np.hypot(*(middles[:, None] - places).transpose(2, 0, 1))
        rows, columns = linear_sum_assignment(np.minimum(apart, 1.0))
        found += int((apart[rows, columns] <= NEAR_M).sum())
        labelled += len(places)
    assert labelled == 116
    assert found >= 0.95 * labelled
