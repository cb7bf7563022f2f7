"""What is wrong with point clouds that could be read as scans."""

from collections.abc import Iterator

import numpy as np

from mcap_landmarks.geometry.frames import REMEDY
from mcap_landmarks.inspection.finding import Finding
from mcap_landmarks.inspection.survey import Survey
from mcap_landmarks.mounting import base_in

_FARTHEST_M = 500.0
"""LiDARs of cars reach 300 m."""


def check_clouds(found: Survey) -> Iterator[Finding]:
    """Clouds that are empty, not in metres, or in a frame that nothing connects."""
    tree = found.log_frames().tree
    for sensor in found.of("point_cloud"):
        seen = found.clouds.get(sensor.topic)
        if seen is not None and seen.empty:
            level = "problem" if seen.empty == seen.looked_at else "warning"
            text = f"{seen.empty} of {seen.looked_at} clouds that were looked at have no points"
            yield Finding(level, "cloud", sensor.topic, text, "look at the driver; nothing is seen there")
        if seen is not None and seen.farthest_m and (far_m := float(np.median(seen.farthest_m))) > _FARTHEST_M:
            text = f"its points are up to {far_m:.0f} m away, as if they were in millimetres"
            yield Finding("problem", "cloud", sensor.topic, text, "record metres, as sensor_msgs/PointCloud2 has them")
        if not found.of("scan"):
            text = "it is no scan by itself: map and localize read it where they are told to"
            yield Finding("warning", "cloud", sensor.topic, text, f"give --scan-from {sensor.topic}")
            if sensor.frame and base_in(tree, sensor.frame) == sensor.frame and sensor.frame not in tree:
                text = f"no transforms tell where its frame {sensor.frame} sits on the robot"
                yield Finding("problem", "frames", sensor.topic, text, REMEDY)
