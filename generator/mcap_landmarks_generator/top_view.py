"""The world about the robot from above, drawn in text."""

from collections.abc import Mapping, Sequence

import numpy as np
from mcap_landmarks.geometry.se2 import transform_points
from mcap_landmarks.messages.scan import LaserScan
from numpy.typing import NDArray

from mcap_landmarks_generator.layout import PlacedObject
from mcap_landmarks_generator.robot import SCAN_IN_BASE_M

Floats = NDArray[np.float64]

_ECHO = "."
_ROBOT = ">/^\\</v\\"
"""The robot by its heading, in eighths of a turn."""
_SECTORS = {"ahead": 0.0, "left": np.pi / 2, "behind": np.pi, "right": -np.pi / 2}
_HALF_SECTOR_RAD = np.deg2rad(15)


def letters(objects: Sequence[PlacedObject]) -> dict[str, str]:
    """A capital letter for each class of objects: of its name the first that no other has, by the order of names."""
    found: dict[str, str] = {}
    for name in sorted({placed.asset.name for placed in objects}):
        free = [letter for letter in f"{name.upper()}ABCDEFGHIJKLMNOPQRSTUVWXYZ" if letter.isalpha()]
        found[name] = next((letter for letter in free if letter not in found.values()), "?")
    return found


def top_view(
    pose: Floats, objects: Mapping[str, Floats], echoes_xy: Floats, metres_per_row: float, size: tuple[int, int]
) -> list[str]:
    """Lines of so many columns and rows (`size`), x to the right and y up, with the robot at `pose` (3,) in the middle.

    `objects` are positions (N, 2) by letter, `echoes_xy` (K, 2) the LiDAR's. A column is half as wide as a row is high.
    """
    columns, rows = size
    canvas = np.full((rows, columns), " ")
    for symbol, points in ((_ECHO, echoes_xy), *sorted(objects.items())):
        away = (np.reshape(points, (-1, 2)) - pose[:2]) / metres_per_row
        column = np.round(columns // 2 + 2 * away[:, 0]).astype(int)
        row = np.round(rows // 2 - away[:, 1]).astype(int)
        shown = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        canvas[row[shown], column[shown]] = symbol
    canvas[rows // 2, columns // 2] = _ROBOT[round(float(pose[2]) / (np.pi / 4)) % len(_ROBOT)]
    return ["".join(line).rstrip() for line in canvas]


def echoes(scan: LaserScan, pose: Floats) -> Floats:
    """Where the beams of a scan ended (K, 2), in the frame of the robot's pose (3,) at its time."""
    ranges = scan.ranges_m.astype(np.float64)
    angles = scan.angle_min_rad + scan.angle_increment_rad * np.arange(len(ranges))
    there = np.isfinite(ranges)
    points = ranges[there, None] * np.column_stack([np.cos(angles[there]), np.sin(angles[there])])
    return transform_points(pose, points + SCAN_IN_BASE_M[:2])


def nearest(scan: LaserScan) -> dict[str, float]:
    """The shortest range ahead, left, behind and right, each within 15 degrees; infinite where there is no echo."""
    angles = scan.angle_min_rad + scan.angle_increment_rad * np.arange(len(scan.ranges_m))
    found = {}
    for name, direction in _SECTORS.items():
        off = np.abs(np.angle(np.exp(1j * (angles - direction))))
        found[name] = float(np.min(scan.ranges_m[off <= _HALF_SECTOR_RAD], initial=np.inf))
    return found
