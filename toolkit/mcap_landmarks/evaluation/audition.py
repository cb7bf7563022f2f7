"""Objects that a network is tried on, one by one: which it recognises, and what the LiDAR sees of them (Appendix A)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.lidar.beams import sweep
from mcap_landmarks.lidar.clustering import cluster, shapes_of
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.objects import Hypotheses
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.scan import LaserScan

SAME_IOU = 0.5
"""A box is the object's where it overlaps the true one by so much: PASCAL VOC's criterion, and COCO's AP50."""
_NEAR_M = 1.5
"""What the LiDAR finds so near to an object's middle is of it; the faces of a car are as far."""


@dataclass(frozen=True, slots=True)
class Heard:
    """What came of one view: the class and score of the best box on the object, empty and 0 where there is none.

    `hits` beams met the object; `fits` says that the LiDAR finds one thing there that the class's shapes explain.
    """

    distance_m: float
    yaw_deg: int
    found: str
    score: float
    hits: int
    fits: bool


@dataclass(frozen=True, slots=True)
class Audition:
    """All views of one object of a class."""

    class_name: str
    variant: str
    heard: tuple[Heard, ...]

    def recognised(self, distance_m: float) -> tuple[int, int]:
        """In how many views from a distance it was recognised, and how many there are."""
        from_there = [one for one in self.heard if one.distance_m == distance_m]
        return sum(one.found == self.class_name for one in from_there), len(from_there)

    def hits(self, distance_m: float) -> float:
        """The median number of beams that meet it from a distance; 0 without a view."""
        counts = [one.hits for one in self.heard if one.distance_m == distance_m]
        return float(np.median(counts)) if counts else 0.0

    def fits(self, distance_m: float) -> tuple[int, int]:
        """In how many views from a distance the LiDAR found it as one thing of its class, and how many there are."""
        from_there = [one for one in self.heard if one.distance_m == distance_m]
        return sum(one.fits for one in from_there), len(from_there)

    def missed_yaws_deg(self) -> list[int]:
        """The sides from which it was recognised in less than half of the views."""
        yaws = sorted({one.yaw_deg for one in self.heard})
        shares = {yaw: [one.found == self.class_name for one in self.heard if one.yaw_deg == yaw] for yaw in yaws}
        return [yaw for yaw, seen in shares.items() if 2 * sum(seen) < len(seen)]

    def taken_for(self) -> str:
        """The other class that it was taken for most often, empty if never."""
        others = [one.found for one in self.heard if one.found not in {"", self.class_name}]
        return max(sorted(set(others)), key=others.count) if others else ""


def best_on(detections: Detections, box_xyxy: NDArray[np.float64]) -> tuple[str, float]:
    """The class and score of the best box that overlaps a true one (4,) enough, empty and 0 if none does."""
    boxes = detections.boxes_xyxy
    sides = np.minimum(boxes[:, 2:], box_xyxy[2:]) - np.maximum(boxes[:, :2], box_xyxy[:2])
    overlap = np.maximum(sides, 0).prod(axis=1)
    union = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1) + (box_xyxy[2:] - box_xyxy[:2]).prod() - overlap
    on_it = np.flatnonzero(overlap >= SAME_IOU * union)
    best = max((detections.hypotheses[i][0] for i in on_it.tolist()), key=lambda option: option[1], default=("", 0.0))
    return best[0], float(best[1])


def hear(
    where: tuple[float, int], found: Detections, truth: Detections, scan: LaserScan, lidar_m: NDArray[np.float64]
) -> Heard:
    """What came of one view of an object straight ahead, the only thing there, from a distance in m and a yaw in deg.

    `found` is what the network found in the image, `truth` the one box that is there; the scan is that of a level LiDAR
    at `lidar_m` (3,) in the base frame.
    """
    (class_name, _), *_ = truth.hypotheses[0]
    distance_m, yaw_deg = where
    name, score = best_on(found, truth.boxes_xyxy[0])
    base_from_lidar = np.eye(4)
    base_from_lidar[:3, 3] = lidar_m
    ranges_m = scan.ranges_m.astype(np.float64)
    angles_rad = scan.angle_min_rad + scan.angle_increment_rad * np.arange(len(ranges_m), dtype=np.float64)
    config = ClusterConfig()
    things = cluster(sweep(angles_rad, ranges_m, base_from_lidar), shapes_of(config), config)
    there = [one for one in things if np.hypot(*(one.positions_xy[0] - [distance_m, 0.0])) < _NEAR_M]
    fits = len(there) == 1 and _explained(there[0], class_name)
    return Heard(distance_m, yaw_deg, name, score, int(np.isfinite(ranges_m).sum()), fits)


def _explained(one: Hypotheses, class_name: str) -> bool:
    """Whether the shapes of a class explain what the LiDAR found better than a bare surface does, which stands last."""
    share = sum(share for name, share in zip(one.names, one.shares.tolist(), strict=True) if name == class_name)
    return bool(share > one.shares[-1])


def distances_of(auditions: Sequence[Audition]) -> list[float]:
    """All distances that objects were seen from, the nearest first."""
    return sorted({one.distance_m for audition in auditions for one in audition.heard})
