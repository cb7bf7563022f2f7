"""The thesis's way to build a map (Algorithm 4): odometry as truth, scenes of three, identity by ordered classes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mcap_landmarks.errors import MapError
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.mapping.built_map import BuiltMap, LogTrajectory
from mcap_landmarks.mapping.observations import LogObservations, left_to_right
from mcap_landmarks.maps.model import Group, LandmarkMap, MapSource


@dataclass(slots=True)
class _Triangle:
    """The latest observation of a group, and how many there were."""

    points_xy: Array
    map_from_base: Array
    observations: int


def solve_as_in_the_thesis(logs: Sequence[LogObservations]) -> BuiltMap:
    """Landmarks of every group of three whose ordered classes were not seen before; seen again, it is replaced.

    Heading and bearing both turn the observation (decisions on Algorithm 4); the map frame is the odometry's.

    Raises:
        MapError: no bundle has exactly three objects.
    """
    groups: dict[tuple[str, ...], _Triangle] = {}
    sources, trajectories = [], []
    for log in logs:
        used = 0
        for i, pose in enumerate(log.odom_from_base):
            rows = log.objects_of(i)
            if len(rows) != 3:
                continue
            rows = rows[left_to_right(log.points_xy[rows])]
            classes = tuple(log.classes[row] for row in rows)
            known = groups.get(classes)
            points = transform_points(pose, log.points_xy[rows])
            groups[classes] = _Triangle(points, pose, known.observations + 1 if known else 1)
            used += 1
        sources.append(MapSource("recording", log.fingerprint, log.bundles, used))
        trajectories.append(LogTrajectory(log.stamps_ns, log.log_times_ns, log.odom_from_base))
    if not groups:
        raise MapError("no bundle has exactly three objects, which the thesis's method needs; use method = default")
    return BuiltMap(_map_of(groups, tuple(sources)), trajectories, None)


def _map_of(groups: dict[tuple[str, ...], _Triangle], sources: tuple[MapSource, ...]) -> LandmarkMap:
    ids = [tuple(f"g{row}.{place}" for place in (1, 2, 3)) for row in range(1, len(groups) + 1)]
    n = 3 * len(groups)
    return LandmarkMap(
        tuple(name for names in ids for name in names),
        tuple(name for classes in groups for name in classes),
        np.concatenate([triangle.points_xy for triangle in groups.values()]),
        np.zeros((n, 2, 2)),
        np.zeros(n),
        np.repeat([triangle.observations for triangle in groups.values()], 3),
        np.zeros(n, dtype=np.bool_),
        tuple(Group(names, triangle.map_from_base) for names, triangle in zip(ids, groups.values(), strict=True)),
        sources,
    )
