"""LaserScan, and the nearest echoes of a MultiEchoLaserScan."""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.messages.parts import header_to_ros, make, stamp_from_ros
from mcap_landmarks.messages.typestore import RosObject

LONGEST_S = 2.0
"""Beams that are said to take longer for a turn have wrong times; no bundle waits for them longer either."""


@dataclass(frozen=True, slots=True, eq=False)
class LaserScan:
    """One turn of a planar LiDAR: ranges_m (N,), intensities (N,) or (0,), beam i at angle_min + i * increment.

    The stamp is the time of the first beam; beam i is `i * time_increment_s` later.
    """

    ROS_TYPE: ClassVar[str] = "sensor_msgs/msg/LaserScan"

    stamp_ns: int
    frame_id: str
    angle_min_rad: float
    angle_max_rad: float
    angle_increment_rad: float
    time_increment_s: float
    scan_time_s: float
    range_min_m: float
    range_max_m: float
    ranges_m: NDArray[np.float32]
    intensities: NDArray[np.float32]

    @property
    def duration_ns(self) -> int:
        """How long after the stamp the last beam is; 0 where the scan does not say, or says what cannot be."""
        turn_s = self.time_increment_s * max(len(self.ranges_m) - 1, 0)
        return round(turn_s * 1e9) if 0 < turn_s <= LONGEST_S else 0

    def to_ros(self) -> RosObject:
        """See `Message`."""
        return make(
            "sensor_msgs/LaserScan",
            header=header_to_ros(self.stamp_ns, self.frame_id),
            angle_min=self.angle_min_rad,
            angle_max=self.angle_max_rad,
            angle_increment=self.angle_increment_rad,
            time_increment=self.time_increment_s,
            scan_time=self.scan_time_s,
            range_min=self.range_min_m,
            range_max=self.range_max_m,
            ranges=np.ascontiguousarray(self.ranges_m, dtype=np.float32),
            intensities=np.ascontiguousarray(self.intensities, dtype=np.float32),
        )

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        return cls(
            stamp_from_ros(ros.header.stamp),
            ros.header.frame_id,
            ros.angle_min,
            ros.angle_max,
            ros.angle_increment,
            ros.time_increment,
            ros.scan_time,
            ros.range_min,
            ros.range_max,
            np.array(ros.ranges, dtype=np.float32),
            np.array(ros.intensities, dtype=np.float32),
        )


@dataclass(frozen=True, slots=True, eq=False)
class MultiEchoLaserScan:
    """A scan whose beams may have several echoes, of which the `nearest` counts: what is behind shines through it."""

    ROS_TYPE: ClassVar[str] = "sensor_msgs/msg/MultiEchoLaserScan"

    nearest: LaserScan

    def to_ros(self) -> RosObject:
        """See `Message`; each beam has one echo."""
        fields = ("header", "angle_min", "angle_max", "angle_increment", "time_increment", "scan_time")
        ros = self.nearest.to_ros()
        return make(
            "sensor_msgs/MultiEchoLaserScan",
            **{name: getattr(ros, name) for name in (*fields, "range_min", "range_max")},
            ranges=[make("sensor_msgs/LaserEcho", echoes=ros.ranges[i : i + 1]) for i in range(len(ros.ranges))],
            intensities=[make("sensor_msgs/LaserEcho", echoes=one[None]) for one in ros.intensities],
        )

    @classmethod
    def from_ros(cls, ros: RosObject) -> Self:
        """See `Message`."""
        nearest = [_nearest(beam.echoes, ros.range_min) for beam in ros.ranges]
        strongest = [max(beam.echoes, default=0.0) for beam in ros.intensities]
        ros.ranges, ros.intensities = np.array(nearest, dtype=np.float32), np.array(strongest, dtype=np.float32)
        return cls(LaserScan.from_ros(ros))


def _nearest(echoes_m: NDArray[np.float32], range_min_m: float) -> np.float32:
    """The nearest of a beam's echoes (K,) that the sensor can measure; what it says instead where there is none."""
    if len(echoes_m) < 2:
        return echoes_m[0] if len(echoes_m) else np.float32(np.inf)
    measured = echoes_m[(echoes_m > 0) & (echoes_m >= range_min_m)]
    return np.float32(measured.min()) if len(measured) else echoes_m[0]
