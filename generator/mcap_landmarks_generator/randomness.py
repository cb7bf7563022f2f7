"""Where random draws come from: one independent stream per purpose and index, so that none depends on another."""

from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """Purposes of random draws; the numbers are part of what a seed means, so they stay."""

    GROUPS = 1
    CAMERA_CLOCK = 2
    LIDAR_CLOCK = 3
    ODOMETRY_CLOCK = 4
    IMAGE = 5
    SCAN = 6
    SLIP = 7
    IMAGE_NOISE = 8
    CAMERA_DELIVERY = 9
    LIDAR_DELIVERY = 10
    ODOMETRY_DELIVERY = 11
    LENS = 12
    HUNT = 13
    RINGS_CLOCK = 14
    RINGS_DELIVERY = 15
    RINGS = 16
    IMU_CLOCK = 17
    IMU_DELIVERY = 18
    IMU = 19
    CAMERAS = 20


def draws(seed: int, stream: Stream, index: int = 0) -> np.random.Generator:
    """The random generator of one purpose and index."""
    return np.random.default_rng([seed, stream, index])
