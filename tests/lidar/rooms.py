"""A room with posts, as a LiDAR sees it from anywhere."""

import numpy as np
from mcap_landmarks.geometry.se2 import Array

FULL = np.deg2rad(np.arange(360.0))
POSTS = np.array([[2.0, 0.5], [-1.0, 3.0], [3.0, -2.0], [-2.5, -1.0], [1.0, -3.5], [2.5, 2.0]])


def scan(angles: Array, pose: Array, room_m: tuple[float, float] | None = (4.0, 3.0), posts: Array = POSTS) -> Array:
    """Ranges from a pose in a room of half sizes, with posts of 0.15 m; without a room most beams see nothing."""
    bearing = angles + pose[2]
    ranges = np.full(len(angles), np.inf)
    if room_m is not None:
        with np.errstate(divide="ignore"):
            x = (np.copysign(room_m[0], np.cos(bearing)) - pose[0]) / np.cos(bearing)
            y = (np.copysign(room_m[1], np.sin(bearing)) - pose[1]) / np.sin(bearing)
        ranges = np.minimum(x, y)
    for post in posts - pose[:2]:
        along = post[0] * np.cos(bearing) + post[1] * np.sin(bearing)
        beside = post[0] * np.sin(bearing) - post[1] * np.cos(bearing)
        hit = (along > 0) & (np.abs(beside) < 0.15)
        ranges[hit] = np.minimum(ranges[hit], along[hit] - np.sqrt(0.15**2 - beside[hit] ** 2))
    return ranges
