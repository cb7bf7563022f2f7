"""Objects drawn by OpenCV's rasterizer: colours and masks of any window of an image."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.assets.bullet import Body
from mcap_landmarks_generator.camera import Intrinsics, Viewpoint
from mcap_landmarks_generator.clipping import in_front
from mcap_landmarks_generator.layout import PlacedObject
from mcap_landmarks_generator.meshes import Mesh, MeshStore
from mcap_landmarks_generator.scenario import LightSpec

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

NEAR_M = 0.05
_FAR_M = 1e4
"""The depth of a pixel that shows nothing."""
_SHADE = 0.25
_SHADE_MARGIN = 0.1
"""The rasterizer interpolates three values: column and row of the texture, and the part's number plus so much, and this
share of its brightness, which stays below 3."""


@dataclass(frozen=True, slots=True)
class Window:
    """A part of the image plane in pixels of the image, which may lie partly outside of it."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def width(self) -> int:
        """Pixels from left to right."""
        return self.right - self.left

    @property
    def height(self) -> int:
        """Pixels from top to bottom."""
        return self.bottom - self.top

    def meets(self, other: "Window") -> bool:
        """Whether the two have a pixel in common."""
        across = self.left < other.right and other.left < self.right
        return across and self.top < other.bottom and other.top < self.bottom


class Drawing:
    """Draws objects as one camera sees them under one light.

    Each pixel gets the nearest texel, times ambient plus diffuse plus a little specular light. The light is
    interpolated between the vertices (Gouraud 1971).
    """

    def __init__(self, intrinsics: Intrinsics, light: LightSpec) -> None:
        self._intrinsics = intrinsics
        self._meshes = MeshStore(light)
        self._settings = cv2.TriangleRasterizeSettings()
        self._settings.setShadingType(cv2.RASTERIZE_SHADING_SHADED)
        self._settings.setCullingMode(cv2.RASTERIZE_CULLING_CW)
        self._buffer = np.empty(0, np.float32)

    def render(
        self, view: Viewpoint, objects: Sequence[PlacedObject], window: Window, scale: float
    ) -> tuple[Image, NDArray[np.int32]]:
        """Colours (h, w, 3) and body ids (h, w), -1 for none, of a window at `scale` times the image's resolution.

        Where no object is, the colour is white. Ids are those of `bodies`.
        """
        width, height = max(1, round(window.width * scale)), max(1, round(window.height * scale))
        values, there = self._rasterized(view, objects, window, (height, width))
        column, row, number = values.reshape(-1, 3)[there].T
        part = np.floor(number)
        colours = np.full((height * width, 3), 255, np.uint8)
        light = (number - part - np.float32(_SHADE_MARGIN)) * np.float32(1 / _SHADE)
        texels = self._meshes.texels(column.astype(np.int32), row.astype(np.int32))
        colours[there] = np.minimum(texels * light[:, None], 255).astype(np.uint8)
        body_ids = np.full(height * width, -1, np.int32)
        body_ids[there] = part.astype(np.int32)
        return colours.reshape(height, width, 3), body_ids.reshape(height, width)

    def mask(self, view: Viewpoint, one: PlacedObject, window: Window, scale: float) -> NDArray[np.bool_]:
        """Where (h, w) the labelled parts of an object alone show in a window."""
        width, height = max(1, round(window.width * scale)), max(1, round(window.height * scale))
        values, there = self._rasterized(view, [one], window, (height, width))
        (bodies,) = bodies_of([one])
        labelled = np.array([body.labelled for body in bodies])
        shown = np.zeros(height * width, bool)
        shown[there] = labelled[values.reshape(-1, 3)[there, 2].astype(np.int32)]
        return shown.reshape(height, width)

    def _rasterized(
        self, view: Viewpoint, objects: Sequence[PlacedObject], window: Window, shape: tuple[int, int]
    ) -> tuple[NDArray[np.float32], NDArray[np.intp]]:
        """The rasterizer's values (h, w, 3), and the flat places (N,) of pixels that show something: only they hold."""
        height, width = shape
        pixels = height * width
        if len(self._buffer) < 4 * pixels:
            self._buffer = np.empty(4 * pixels, np.float32)
        values = self._buffer[: 3 * pixels].reshape(height, width, 3)
        depth = self._buffer[3 * pixels : 4 * pixels].reshape(height, width)
        depth.fill(_FAR_M)
        meshes = [self._meshes.mesh(placed, view.time_s) for placed in objects]
        vertices, attributes, faces = _joined(meshes, view, self._to_window(window, shape) @ view.world_from_optical.T)
        vertices, attributes, faces = in_front(vertices, attributes, faces, NEAR_M)
        if len(faces):
            cv2.triangleRasterize(
                vertices, faces, attributes, values, depth, np.eye(4), np.pi / 2, NEAR_M / 2, _FAR_M, self._settings
            )
        return values, np.flatnonzero(depth.reshape(-1) < _FAR_M / 2)

    def _to_window(self, window: Window, shape: tuple[int, int]) -> Floats:
        """The map (3, 3) from the optical frame to that of a camera with a right angle of view from top to bottom, x to
        the right and z backwards, as the rasterizer wants it, which sees just the window."""
        height, width = shape
        across, down = width / window.width, height / window.height
        focal = self._intrinsics.focal_px
        # Where the axis meets the window's pixels, from the middle of the window.
        right = (self._intrinsics.width_px / 2 - window.left) * across - width / 2
        below = (self._intrinsics.height_px / 2 - window.top) * down - height / 2
        return np.array(
            [
                [2 * focal * across / height, 0.0, 2 * right / height],
                [0.0, -2 * focal * down / height, -2 * below / height],
                [0.0, 0.0, -1.0],
            ]
        )


def bodies_of(objects: Sequence[PlacedObject]) -> list[tuple[Body, ...]]:
    """The bodies of each object when these are drawn together: their parts, counted from 0 on."""
    bodies, count = [], 0
    for placed in objects:
        parts = placed.asset.parts
        bodies.append(tuple(Body(count + i, part.labelled) for i, part in enumerate(parts)))
        count += len(parts)
    return bodies


def _joined(
    meshes: Sequence[Mesh], view: Viewpoint, turn: Floats
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32]]:
    """Vertices (N, 3) in the rasterizer's frame, their attributes (N, 3) and faces (M, 3) of all meshes."""
    if not meshes:
        return np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32)
    counts = np.array([len(mesh.vertices_m) for mesh in meshes])
    parts = np.array([mesh.parts for mesh in meshes])
    vertices = (np.concatenate([mesh.vertices_m for mesh in meshes]) - view.eye_m) @ turn.T
    attributes = np.concatenate([mesh.attributes for mesh in meshes])
    attributes[:, 2] *= np.float32(_SHADE)
    numbers = np.concatenate([mesh.part_of for mesh in meshes]) + np.repeat(np.cumsum(parts) - parts, counts)
    attributes[:, 2] += (numbers + _SHADE_MARGIN).astype(np.float32)
    firsts = np.repeat(np.cumsum(counts) - counts, [len(mesh.faces) for mesh in meshes])
    faces = np.concatenate([mesh.faces for mesh in meshes]) + firsts.astype(np.int32)[:, None]
    return vertices.astype(np.float32), attributes, faces
