"""The cluster stage on whole clouds: boxes around what stands on the ground, at the moment of the stamp."""

from dataclasses import replace

import numpy as np
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.transforms import Transform
from mcap_landmarks.stage import OdometryAt, Omission
from mcap_landmarks.stages.cluster import process

from tests.lidar.clouds import LIDAR_M, Solid, cloud
from tests.stages.test_cluster import SECOND, UPRIGHT, bundle, results


def test_a_whole_cloud_has_boxes_around_what_stands_on_the_ground() -> None:
    car, person = Solid(12.0, 2.0, 4.2, 1.7, 1.5), Solid(8.0, -2.0, 0.4, 0.4, 1.7)
    points, _ = cloud([car, person])
    lidar = np.array([0.5, 0.0, LIDAR_M])
    message = PointCloud2(SECOND, "velodyne", (points - [0.0, 0.0, LIDAR_M]).astype(np.float32))
    mount = Transform(0, "base_footprint", "velodyne", lidar, UPRIGHT)
    made = [one for one in process([bundle(message, mount)], ClusterConfig(), {}) if not isinstance(one, Omission)]
    found, clustered = (one.message for one in made)
    assert isinstance(found, ScanObjects)
    assert isinstance(clustered, ClusteredCloud)
    assert found.hypotheses == ((("", 1.0),),) * 2
    assert found.boxes is not None
    order = np.argsort(found.boxes.centres_m[:, 0])
    np.testing.assert_allclose(found.boxes.centres_m[order], [[8.4, -2.0, 0.85], [11.5, 2.0, 0.75]], atol=1.2)
    np.testing.assert_allclose(found.boxes.sizes_m[order, 2], [1.7, 1.5], atol=0.15)
    assert clustered.frame_id == found.frame_id == "base_footprint"
    assert (clustered.heights_m > 0.25).all()
    assert set(clustered.clusters) == {0, 1}


def test_clouds_in_which_nothing_stands_are_told_and_absurd_points_are_none() -> None:
    """Empty clouds, and points that overflow: no LiDAR measures 10 km."""
    mount = Transform(0, "base_footprint", "velodyne", np.array([0.0, 0.0, LIDAR_M]), UPRIGHT)
    absurd = np.array([[1e30, 0.0, 1.0], [5.0, -1e30, 1.0], [np.nan, 1.0, 1.0], [2.0, 1.0, np.inf]], dtype=np.float32)
    for points in (np.zeros((0, 3), np.float32), absurd):
        message = PointCloud2(SECOND, "velodyne", points)
        made = list(process([bundle(message, mount)], ClusterConfig(), {}))
        assert [one.reason for one in made if isinstance(one, Omission)] == [
            "clouds in which nothing stands on the ground"
        ]


def test_a_whole_cloud_is_de_skewed() -> None:
    """Of a robot that drives at 10 m/s every point was measured from where the base was at its time."""
    points, _ = cloud([Solid(12.0, 0.0, 0.4, 3.0, 1.7)])
    times = np.linspace(-100_000_000, 0, len(points)).astype(np.int64)
    there = points - np.outer(10.0 * times / 1e9, [1.0, 0.0, 0.0]) - [0.0, 0.0, LIDAR_M]
    message = PointCloud2(SECOND, "velodyne", there.astype(np.float32), times)
    mount = Transform(0, "base_footprint", "velodyne", np.array([0.0, 0.0, LIDAR_M]), UPRIGHT)
    moving = OdometryAt("odom", np.zeros(3), np.zeros((3, 3)), 0.0, 0.0, np.array([10.0, 0.0, 0.0]))
    (found,) = results([replace(bundle(message, mount), odometry=moving)])
    assert found.boxes is not None
    np.testing.assert_allclose(found.boxes.centres_m[0, :2], [11.8, 0.0], atol=0.1)
