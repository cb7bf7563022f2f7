"""Scans of nothing but noise: every cluster is near every other, and the work is bounded all the same."""

import resource

import numpy as np
import pytest
from mcap_landmarks.lidar.beams import sweep
from mcap_landmarks.lidar.clustering import cluster, shapes_of
from mcap_landmarks.lidar.config import ClusterConfig


@pytest.mark.slow
def test_a_scan_of_random_ranges_takes_no_gigabytes() -> None:
    config = ClusterConfig()
    angles = np.linspace(-np.pi, np.pi, 1440, endpoint=False)
    beams = sweep(angles, np.random.default_rng(1).uniform(0.2, 12.0, 1440), np.eye(4))
    shapes, before = shapes_of(config), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert cluster(beams, shapes, config)
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024 < 400
