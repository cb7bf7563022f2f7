"""The physical world: ground, objects and robot in one PyBullet client; steps in time and rays."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.assets.bullet import AssetStore
from mcap_landmarks_generator.engine import pybullet
from mcap_landmarks_generator.layout import PlacedObject
from mcap_landmarks_generator.robot import STATIC_GROUP, Robot

Floats = NDArray[np.float64]

STEP_NS = 4_000_000
"""Physics runs at 250 Hz."""
_MOST_SURFACES = 8
"""So many surfaces of glass a ray is followed through: both of four panes."""
_BEHIND_M = 1e-3
"""So far behind a surface of glass a ray is taken up again; panes are thicker."""
_MOST_RAYS = 16_384
"""So many rays PyBullet takes at once (MAX_RAY_INTERSECTION_BATCH_SIZE)."""


@dataclass(frozen=True, slots=True, eq=False)
class Returns:
    """What N rays meet first: distances_m (N,), infinite for nothing; cosines (N,) of the angle to the normal there;
    `names` of classes, empty for the ground, and per ray the number (N,) of its own among them, and of surfaces (N,) of
    glass that it went through before."""

    distances_m: Floats
    cosines: Floats
    names: tuple[str, ...]
    name_of: NDArray[np.int64]
    passed: NDArray[np.int64]


class World:
    """What the robot drives through; a context manager that disconnects from PyBullet."""

    def __init__(self, objects: Sequence[PlacedObject], start: Floats) -> None:
        """Put the robot at x, y, heading `start` (3,)."""
        self._client: int = pybullet.connect(pybullet.DIRECT)
        store = AssetStore(self._client)
        pybullet.setGravity(0.0, 0.0, -9.81, physicsClientId=self._client)
        pybullet.setTimeStep(STEP_NS / 1e9, physicsClientId=self._client)
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self._client)
        ground = pybullet.createMultiBody(0, plane, physicsClientId=self._client)
        pybullet.changeDynamics(ground, -1, lateralFriction=1.0, physicsClientId=self._client)
        self._object_of_body: dict[int, PlacedObject] = {}
        self._panes: list[int] = []
        self._walkers: list[tuple[PlacedObject, list[int]]] = []
        for placed in objects:
            x, y, heading = placed.pose_at(0.0)
            spawned = store.spawn(placed.asset, (x, y, 0.0), heading)
            bodies = [body.body_id for body in spawned]
            self._panes += [body.body_id for body in spawned if body.clear]
            self._object_of_body.update(dict.fromkeys(bodies, placed))
            if placed.moves:
                self._walkers.append((placed, bodies))
        self.robot = Robot(self._client, start)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(physicsClientId=self._client)

    @property
    def has_walkers(self) -> bool:
        """Whether any object moves."""
        return bool(self._walkers)

    def step(self) -> None:
        """Let one step of physics pass."""
        pybullet.stepSimulation(physicsClientId=self._client)

    def move_walkers(self, time_s: float) -> None:
        """Put everyone who walks where they are at a time after the start."""
        for placed, bodies in self._walkers:
            x, y, heading = placed.pose_at(time_s)
            turn = pybullet.getQuaternionFromEuler([0.0, 0.0, heading])
            for body in bodies:
                pybullet.resetBasePositionAndOrientation(body, [x, y, 0.0], turn, physicsClientId=self._client)

    def touched(self) -> set[str]:
        """Ids of the objects that the robot has contact with."""
        bodies = self.robot.touching() & self._object_of_body.keys()
        return {self._object_of_body[body].object_id for body in bodies}

    def returns(self, starts: Floats, directions: Floats, reach_m: float, glass_deg: float = 90.0) -> Returns:
        """What rays from `starts` (N, 3) along unit vectors `directions` (N, 3) meet in reach, but for the robot.

        Glass returns rays that meet it within `glass_deg` of straight on; others go through as if it were not there.
        """
        distances, cosines, bodies = self._hits(starts, directions, np.full(len(starts), reach_m))
        passed = np.zeros(len(starts), dtype=np.int64)
        for _ in range(_MOST_SURFACES if self._panes else 0):
            through = np.isin(bodies, self._panes) & (cosines < np.cos(np.deg2rad(glass_deg)))
            if not through.any():
                break
            begun = distances[through] + _BEHIND_M
            further = starts[through] + begun[:, None] * directions[through]
            found = self._hits(further, directions[through], reach_m - begun)
            distances[through], cosines[through], bodies[through] = begun + found[0], found[1], found[2]
            passed[through] += 1
        names = ("", *sorted({placed.asset.name for placed in self._object_of_body.values()}))
        # Nothing is hit as body -1, which is the last one of the table.
        number = np.zeros(max(self._object_of_body, default=0) + 2, np.int64)
        for body, placed in self._object_of_body.items():
            number[body] = names.index(placed.asset.name)
        return Returns(distances, cosines, names, number[bodies], passed)

    def _hits(self, starts: Floats, directions: Floats, reach_m: Floats) -> tuple[Floats, Floats, NDArray[np.int64]]:
        """Distances (N,), cosines of the angles to the normals (N,) and bodies (N,) that rays meet in reach (N,)."""
        ends = starts + reach_m[:, None] * directions
        hits = []
        for first in range(0, len(starts), _MOST_RAYS):
            part = slice(first, first + _MOST_RAYS)
            hits += pybullet.rayTestBatch(
                starts[part].tolist(),
                ends[part].tolist(),
                numThreads=1,
                collisionFilterMask=STATIC_GROUP,
                physicsClientId=self._client,
            )
        bodies, _, shares, _, normals = zip(*hits, strict=True)
        share = np.array(shares)
        normal = np.fromiter(chain.from_iterable(normals), np.float64, 3 * len(hits)).reshape(-1, 3)
        distances = np.where(share < 1.0, share * reach_m, np.inf)
        return distances, np.abs((normal * directions).sum(axis=1)), np.array(bodies, dtype=np.int64)
