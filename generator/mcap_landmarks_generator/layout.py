"""Which objects stand where, and where they are at any time."""

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.assets import catalog
from mcap_landmarks_generator.assets.asset import Asset
from mcap_landmarks_generator.scenario import ObjectSpec

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class PlacedObject:
    """An object of the world: it stands at the first point of `route_xy` (K, 2) or walks around the closed route."""

    object_id: str
    asset: Asset
    route_xy: Floats
    yaw_rad: float
    speed_mps: float

    @property
    def moves(self) -> bool:
        """Whether it walks."""
        return len(self.route_xy) > 1

    @property
    def is_landmark(self) -> bool:
        """Whether it is of a class that a detector knows, and so belongs to the truth."""
        return self.asset.name in catalog.COCO_ID

    def pose_at(self, time_s: float) -> Floats:
        """x, y, heading (3,) at a time after the start."""
        if not self.moves:
            return np.array([*self.route_xy[0], self.yaw_rad])
        ahead, lengths, ends = _legs(self)
        walked = time_s * self.speed_mps % ends[-1]
        leg = int(np.searchsorted(ends, walked, side="right"))
        share = (walked - ends[leg] + lengths[leg]) / lengths[leg]
        return np.array([*(self.route_xy[leg] + share * ahead[leg]), np.arctan2(ahead[leg, 1], ahead[leg, 0])])


@functools.lru_cache(maxsize=1024)
def _legs(placed: PlacedObject) -> tuple[Floats, Floats, Floats]:
    """The way (K, 2) from each point of a route to the next, its length (K,), and how far along the route it ends."""
    ahead = np.roll(placed.route_xy, -1, axis=0) - placed.route_xy
    lengths = np.hypot(ahead[:, 0], ahead[:, 1])
    return ahead, lengths, np.cumsum(lengths)


def place(specs: tuple[ObjectSpec, ...]) -> tuple[PlacedObject, ...]:
    """The objects with their assets; ids are the class and its count, such as `fire_hydrant_3`.

    Raises:
        ToolkitError: a variant does not exist.
    """
    counts: dict[str, int] = {}
    placed = []
    for spec in specs:
        counts[spec.class_name] = counts.get(spec.class_name, 0) + 1
        placed.append(
            PlacedObject(
                f"{spec.class_name.replace(' ', '_')}_{counts[spec.class_name]}",
                built(spec.class_name, spec.variant, spec.look),
                np.array([spec.at, *spec.walk], dtype=np.float64),
                float(np.deg2rad(spec.yaw_deg)),
                spec.speed_mps,
            )
        )
    return tuple(placed)


built = functools.cache(catalog.build)
