"""Assets as bodies of a PyBullet world: shapes are made once per client, bodies as often as wanted."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mcap_landmarks_generator.assets.asset import Asset, Part
from mcap_landmarks_generator.engine import pybullet


@dataclass(frozen=True, slots=True)
class Body:
    """A body in the world; `labelled` as in its part: only these count for the object's box in the image; `clear`: it
    is glass."""

    body_id: int
    labelled: bool
    clear: bool = False


class AssetStore:
    """The shapes of one PyBullet client: concave meshes, so that a ray hits what an image shows."""

    def __init__(self, client: int) -> None:
        self._client = client
        self._shapes: dict[tuple[str, str, int], list[int]] = {}

    def spawn(self, asset: Asset, position: ArrayLike = (0.0, 0.0, 0.0), yaw_rad: float = 0.0) -> tuple[Body, ...]:
        """Put an asset into the world as static bodies, one per part; its origin comes to `position` (3,)."""
        key = (asset.name, asset.variant, asset.seed)
        if key not in self._shapes:
            self._shapes[key] = [self._shape(part) for part in asset.parts]
        place = [float(value) for value in np.asarray(position, float)]
        turn = pybullet.getQuaternionFromEuler([0.0, 0.0, yaw_rad])
        return tuple(
            Body(
                pybullet.createMultiBody(0, shape, -1, place, turn, physicsClientId=self._client),
                part.labelled,
                part.clear,
            )
            for part, shape in zip(asset.parts, self._shapes[key], strict=True)
        )

    def _shape(self, part: Part) -> int:
        """PyBullet's handle of a part's shape."""
        handle: int = pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=part.vertices.tolist(),
            indices=part.faces.ravel().tolist(),
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=self._client,
        )
        return handle
