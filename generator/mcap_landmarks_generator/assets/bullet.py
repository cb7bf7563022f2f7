"""Assets as bodies of a PyBullet world: shapes and textures are made once per client, bodies as often as wanted."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import cv2
import numpy as np
from numpy.typing import ArrayLike

from mcap_landmarks_generator.assets.asset import Asset, Part
from mcap_landmarks_generator.assets.texture import Image
from mcap_landmarks_generator.engine import pybullet

_NOTHING = -1
"""PyBullet's handle of no shape."""


@dataclass(frozen=True, slots=True)
class Body:
    """A body in the world; `labelled` as in its part: only these count for the object's box in the image; `clear`: it
    is glass."""

    body_id: int
    labelled: bool
    clear: bool = False


@dataclass(frozen=True, slots=True)
class _Shapes:
    """PyBullet's handles of one part."""

    visual: int
    collision: int
    texture: int
    labelled: bool
    clear: bool


class AssetStore:
    """The shapes and textures of one PyBullet client; a context manager that removes its temporary files.

    Collision meshes are concave and identical to the visual ones, so that a ray hits what the image shows.
    """

    def __init__(self, client: int, seen: bool = True) -> None:
        """Bodies that are not to be `seen` in PyBullet's own images go without textures and visual meshes."""
        self._client, self._seen = client, seen
        self._folder = tempfile.TemporaryDirectory(prefix="generator-textures-")
        self._shapes: dict[tuple[str, str, int], tuple[_Shapes, ...]] = {}
        self._texture_count = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._folder.cleanup()

    def spawn(self, asset: Asset, position: ArrayLike = (0.0, 0.0, 0.0), yaw_rad: float = 0.0) -> tuple[Body, ...]:
        """Put an asset into the world as static bodies, one per part; its origin comes to `position` (3,)."""
        key = (asset.name, asset.variant, asset.seed)
        if key not in self._shapes:
            self._shapes[key] = self._loaded(asset)
        place = [float(value) for value in np.asarray(position, float)]
        turn = pybullet.getQuaternionFromEuler([0.0, 0.0, yaw_rad])
        bodies = []
        for shapes in self._shapes[key]:
            body = pybullet.createMultiBody(
                0, shapes.collision, shapes.visual, place, turn, physicsClientId=self._client
            )
            if shapes.visual != _NOTHING:
                pybullet.changeVisualShape(body, -1, textureUniqueId=shapes.texture, physicsClientId=self._client)
            bodies.append(Body(body, shapes.labelled, shapes.clear))
        return tuple(bodies)

    def _texture(self, image: Image) -> int:
        """PyBullet's handle of a new texture from an RGB image (H,W,3)."""
        path = Path(self._folder.name) / f"{self._texture_count}.png"
        self._texture_count += 1
        cv2.imwrite(str(path), cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
        handle: int = pybullet.loadTexture(str(path), physicsClientId=self._client)
        path.unlink()
        return handle

    def _visual(self, part: Part) -> int:
        """PyBullet's handle of a part's visual mesh, still without its texture."""
        handle: int = pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            vertices=part.vertices.tolist(),
            indices=part.faces.ravel().tolist(),
            uvs=part.uv.tolist(),
            normals=part.normals.tolist(),
            rgbaColor=[1.0, 1.0, 1.0, 1.0],
            specularColor=[0.0, 0.0, 0.0],
            physicsClientId=self._client,
        )
        return handle

    def _loaded(self, asset: Asset) -> tuple[_Shapes, ...]:
        """The handles of an asset's parts; parts that share a texture share its handle."""
        textures: dict[int, int] = {}
        shapes = []
        for part in asset.parts:
            if self._seen and id(part.texture) not in textures:
                textures[id(part.texture)] = self._texture(part.texture)
            collision = pybullet.createCollisionShape(
                pybullet.GEOM_MESH,
                vertices=part.vertices.tolist(),
                indices=part.faces.ravel().tolist(),
                flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
                physicsClientId=self._client,
            )
            visual = self._visual(part) if self._seen and not part.clear else _NOTHING
            texture = textures.get(id(part.texture), _NOTHING)
            shapes.append(_Shapes(visual, collision, texture, part.labelled, part.clear))
        return tuple(shapes)
