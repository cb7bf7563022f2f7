"""Groups of objects at random places along a winding way."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.randomness import Stream, draws
from mcap_landmarks_generator.scenario import GroupsSpec, ObjectSpec, Waypoint

_APART_M = 1.2


def arrange(spec: GroupsSpec, seed: int) -> tuple[tuple[ObjectSpec, ...], tuple[Waypoint, ...]]:
    """Objects and way: rows of groups, left and right of the way in turn, driven to and fro."""
    rng = draws(seed, Stream.GROUPS)
    per_row = max(1, round(np.sqrt(spec.count)))
    pitch = 2 * (spec.aside_m + spec.spread_m) + 4.0
    objects: list[ObjectSpec] = []
    way: list[Waypoint] = []
    for index in range(spec.count):
        row, column = divmod(index, per_row)
        forwards = 1 if row % 2 == 0 else -1
        x = (column if forwards > 0 else per_row - 1 - column) * spec.spacing_m
        y = row * pitch
        if column == 0:
            way.append(Waypoint(at=(x - forwards * spec.spacing_m, y)))
        if column == per_row - 1 or index == spec.count - 1:
            way.append(Waypoint(at=(x + forwards * spec.spacing_m / 2, y)))
        side = 1 if index % 2 == 0 else -1
        objects.extend(_group(spec, rng, np.array([x, y + side * spec.aside_m]), np.deg2rad(-90.0 * side)))
    return tuple(objects), tuple(way)


def _group(
    spec: GroupsSpec, rng: np.random.Generator, centre_xy: NDArray[np.float64], towards_way_rad: float
) -> list[ObjectSpec]:
    """One group: objects at least 1.2 m apart, facing the way more or less."""
    places: list[NDArray[np.float64]] = []
    while len(places) < spec.size:
        angle, distance = rng.uniform(0, 2 * np.pi), spec.spread_m * np.sqrt(rng.random())
        place = centre_xy + distance * np.array([np.cos(angle), np.sin(angle)])
        if all(np.hypot(*(place - other)) >= _APART_M for other in places):
            places.append(place)
    return [
        ObjectSpec(
            class_name=spec.classes[rng.integers(len(spec.classes))],
            at=(round(float(x), 3), round(float(y), 3)),
            yaw_deg=round(float(np.rad2deg(towards_way_rad) + rng.uniform(-60, 60)), 1),
            look=int(rng.integers(spec.looks)),
        )
        for x, y in places
    ]
