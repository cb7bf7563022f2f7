"""The physical world: ground, objects and robot in one PyBullet client; steps in time and rays."""

from collections.abc import Sequence
from dataclasses import dataclass
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
_MOST_RAYS = 16_384
"""So many rays PyBullet takes at once (MAX_RAY_INTERSECTION_BATCH_SIZE)."""


@dataclass(frozen=True, slots=True, eq=False)
class Returns:
    """What N rays meet first: distances_m (N,), infinite for nothing; cosines (N,) of the angle to the normal there;
    `names` of classes, empty for the ground, and per ray the number (N,) of its own among them."""

    distances_m: Floats
    cosines: Floats
    names: tuple[str, ...]
    name_of: NDArray[np.int64]


class World:
    """What the robot drives through; a context manager that disconnects from PyBullet."""

    def __init__(self, objects: Sequence[PlacedObject], start: Floats) -> None:
        """Put the robot at x, y, heading `start` (3,)."""
        self._client: int = pybullet.connect(pybullet.DIRECT)
        self._store = AssetStore(self._client)
        pybullet.setGravity(0.0, 0.0, -9.81, physicsClientId=self._client)
        pybullet.setTimeStep(STEP_NS / 1e9, physicsClientId=self._client)
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self._client)
        ground = pybullet.createMultiBody(0, plane, physicsClientId=self._client)
        pybullet.changeDynamics(ground, -1, lateralFriction=1.0, physicsClientId=self._client)
        self._object_of_body: dict[int, PlacedObject] = {}
        self._walkers: list[tuple[PlacedObject, list[int]]] = []
        for placed in objects:
            x, y, heading = placed.pose_at(0.0)
            bodies = [body.body_id for body in self._store.spawn(placed.asset, (x, y, 0.0), heading)]
            self._object_of_body.update(dict.fromkeys(bodies, placed))
            if placed.moves:
                self._walkers.append((placed, bodies))
        self.robot = Robot(self._client, start)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(physicsClientId=self._client)
        self._store.__exit__(None, None, None)

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

    def returns(self, starts: Floats, directions: Floats, reach_m: float) -> Returns:
        """What rays from `starts` (N, 3) along unit vectors `directions` (N, 3) meet in reach, but for the robot."""
        ends = starts + reach_m * directions
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
        share, bodies = np.array([hit[2] for hit in hits]), [hit[0] for hit in hits]
        normals = np.array([hit[4] for hit in hits]).reshape(-1, 3)
        names = ("", *sorted({placed.asset.name for placed in self._object_of_body.values()}))
        number = {body: names.index(placed.asset.name) for body, placed in self._object_of_body.items()}
        return Returns(
            np.where(share < 1.0, share * reach_m, np.inf),
            np.abs((normals * directions).sum(axis=1)),
            names,
            np.array([number.get(body, 0) for body in bodies], dtype=np.int64),
        )
