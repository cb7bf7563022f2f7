"""Meshes of placed objects as the rasterizer wants them: in the world's frame, lit, with one texture for all."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.assets.asset import Asset
from mcap_landmarks_generator.layout import PlacedObject
from mcap_landmarks_generator.scenario import LightSpec

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

_SPECULAR = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """An object's triangles: `vertices_m` (N, 3) in the world, `attributes` (N, 3) column and row of the texture and
    brightness, `part_of` (N,) the number of the part, `faces` (M, 3), and how many `parts` there are."""

    vertices_m: Floats
    attributes: NDArray[np.float32]
    part_of: NDArray[np.int64]
    faces: NDArray[np.int32]
    parts: int


@dataclass(frozen=True, slots=True, eq=False)
class _Model:
    """An asset's mesh in its own frame: `texture` (N, 2) are columns and rows of the texture."""

    vertices_m: Floats
    normals: Floats
    texture: NDArray[np.float32]
    part_of: NDArray[np.int64]
    faces: NDArray[np.int32]


class MeshStore:
    """Makes meshes; those of objects that stand still are made once."""

    def __init__(self, light: LightSpec) -> None:
        self._light = light
        self._models: dict[tuple[str, str, int], _Model] = {}
        self._standing: dict[str, Mesh] = {}
        self._texture = np.zeros((0, 0, 3), np.uint8)
        self._pictures: list[Image] = []

    def mesh(self, placed: PlacedObject, time_s: float) -> Mesh:
        """The mesh of an object at a time."""
        mesh = self._standing.get(placed.object_id)
        if mesh is None:
            mesh = self._made(placed, time_s)
            if not placed.moves:
                self._standing[placed.object_id] = mesh
        return mesh

    def texels(self, columns: NDArray[np.int32], rows: NDArray[np.int32]) -> Image:
        """Colours (N, 3) at columns and rows (N,) of the texture."""
        if self._pictures:
            width = max(self._texture.shape[1], *(picture.shape[1] for picture in self._pictures))
            padded = [
                np.pad(picture, ((0, 0), (0, width - picture.shape[1]), (0, 0)))
                for picture in (self._texture, *self._pictures)
            ]
            self._texture, self._pictures = np.concatenate(padded), []
        width = self._texture.shape[1]
        return np.take(self._texture.reshape(-1, 3), rows * width + columns, axis=0)

    def _made(self, placed: PlacedObject, time_s: float) -> Mesh:
        asset = placed.asset
        key = (asset.name, asset.variant, asset.seed)
        model = self._models.get(key)
        if model is None:
            model = self._models[key] = self._model(asset)
        x, y, heading = placed.pose_at(time_s)
        c, s = np.cos(heading), np.sin(heading)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        light = self._lit(model.normals @ turn.T)
        return Mesh(
            model.vertices_m @ turn.T + [x, y, 0.0],
            np.column_stack([model.texture, light]).astype(np.float32),
            model.part_of,
            model.faces,
            len(asset.parts),
        )

    def _lit(self, normals: Floats) -> Floats:
        """Brightness (N,) of surfaces with normals (N, 3) in the world; gloss is seen as from straight above."""
        towards = self._light.towards()
        facing = normals @ towards
        gloss = np.maximum(2 * facing * normals[:, 2] - towards[2], 0.0) ** 2
        return np.asarray(
            self._light.ambient + self._light.diffuse * np.maximum(facing, 0.0) + _SPECULAR * gloss, np.float64
        )

    def _model(self, asset: Asset) -> _Model:
        """An asset's mesh; its textures join the one for all, each picture once."""
        places: dict[int, int] = {}
        texture, faces, count = [], [], 0
        for part in asset.parts:
            height, width = part.texture.shape[:2]
            if id(part.texture) not in places:
                places[id(part.texture)] = len(self._texture) + sum(len(picture) for picture in self._pictures)
                self._pictures.append(part.texture)
            # From the middle of the first texel to the middle of the last one, which interpolation never leaves.
            column = np.clip(part.uv[:, 0] * width, 0, width - 0.01)
            row = np.clip((1 - part.uv[:, 1]) * height, 0, height - 0.01)
            texture.append(np.column_stack([column, places[id(part.texture)] + row]).astype(np.float32))
            # Panes of glass are not seen.
            faces.append(part.faces[: 0 if part.clear else None].astype(np.int32) + count)
            count += len(part.vertices)
        sizes = [len(part.vertices) for part in asset.parts]
        return _Model(
            np.concatenate([part.vertices for part in asset.parts]),
            np.concatenate([part.normals for part in asset.parts]),
            np.concatenate(texture),
            np.repeat(np.arange(len(sizes)), sizes),
            np.concatenate(faces),
        )
