"""How far away a thing in a box is by the camera alone: by the height of its class, and by where it stands."""

from dataclasses import dataclass

import numpy as np

from mcap_landmarks.classes import Cuboid, Size
from mcap_landmarks.fusion.box_geometry import BoxGeometry
from mcap_landmarks.fusion.frustum import CloudView
from mcap_landmarks.geometry.angles import wrap

_BESIDE_RAD, _LEVEL_M = 0.15, 20.0
"""Points so far beside a direction tell where the ground is in it, and how far out one would have to say the same."""
_GROUND_M = 0.15
"""How far off the local ground's height may be at a foot: kerbs, and wheels that are hidden."""
_LEAST_SLOPE = 5e-3
"""A line of sight that falls by less meets the ground too far away to tell where."""


@dataclass(frozen=True, slots=True)
class CameraRange:
    """A level distance from the camera and its standard deviation in m; both not finite where nothing tells it."""

    distance_m: float
    sigma_m: float


UNKNOWN = CameraRange(np.nan, np.inf)


def height_span(size: Size, cuboid: Cuboid | None) -> tuple[float, float]:
    """Mean and standard deviation of the height of a box of a class: a size's limits are two deviations off."""
    if cuboid is not None:
        return cuboid.height_m
    least, most = size.least_tall_m, min(size.tall_m[1], size.top_m[1] - size.foot_m[0])
    return (least + most) / 2, (most - least) / 4


def by_height(boxes: BoxGeometry, box: int, height_m: tuple[float, float]) -> CameraRange:
    """The range at which something of a height (mean, standard deviation) fills a box, unless the image cuts it."""
    tall = float(boxes.top[box] - boxes.bottom[box])
    if boxes.cut[box, 1] or boxes.cut[box, 3] or tall <= 0:
        return UNKNOWN
    distance = height_m[0] / tall
    share = np.hypot(height_m[1] / height_m[0], np.sqrt(2) * boxes.sigma_slope[box] / tall)
    return CameraRange(distance, float(distance * share))


def by_foot(boxes: BoxGeometry, box: int, camera_m: float, floor: tuple[float, float]) -> CameraRange:
    """The range at which a box's lower edge meets the ground, for a camera so high in the base frame.

    `floor` is the ground's height below the camera and its slope away from it, as `floor_along` tells it.
    """
    falling = floor[1] - float(boxes.bottom[box])
    if boxes.cut[box, 3] or falling < _LEAST_SLOPE or camera_m <= floor[0]:
        return UNKNOWN
    distance = (camera_m - floor[0]) / falling
    sigma = float(np.hypot(distance * boxes.sigma_slope[box], _GROUND_M) / falling)
    return CameraRange(float(distance), sigma)


def floor_along(cloud: CloudView, bearing_rad: float) -> tuple[float, float]:
    """The ground's height below the camera and its slope away from it in one direction, by the points of a cloud."""
    beside = np.abs(wrap(cloud.bearings_rad - bearing_rad)) < _BESIDE_RAD
    away, floors = cloud.ranges_m[beside], cloud.floors_m[beside]
    if not len(away):
        return 0.0, 0.0
    # As if there were one more point far out that says that the ground is level: few points give no slope.
    mean_away, mean_floor = float(away.mean()), float(floors.mean())
    off = away - mean_away
    slope = float((off * (floors - mean_floor)).sum() / ((off**2).sum() + _LEVEL_M**2))
    return mean_floor - slope * mean_away, slope


def together(one: CameraRange, other: CameraRange) -> CameraRange:
    """What two ranges say together; where they contradict each other they are less sure."""
    known = [entry for entry in (one, other) if np.isfinite(entry.distance_m)]
    if not known:
        return UNKNOWN
    weights = np.array([entry.sigma_m**-2 for entry in known])
    distances = np.array([entry.distance_m for entry in known])
    mean = float((weights * distances).sum() / weights.sum())
    chi2 = float((weights * (distances - mean) ** 2).sum())
    return CameraRange(mean, float(np.sqrt(max(chi2, 1.0) / weights.sum())))
