"""Objects drawn by PyBullet's software renderer: colours and masks of any window of an image."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.assets.bullet import AssetStore, Body
from mcap_landmarks_generator.camera import Intrinsics, Viewpoint
from mcap_landmarks_generator.engine import pybullet
from mcap_landmarks_generator.layout import PlacedObject
from mcap_landmarks_generator.scenario import LightSpec

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

NEAR_M = 0.05


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
    """A PyBullet client that draws the objects it is shown; a context manager that disconnects it."""

    def __init__(self, intrinsics: Intrinsics, light: LightSpec, far_m: float) -> None:
        """Nothing beyond `far_m` in front of the camera is drawn."""
        self._client: int = pybullet.connect(pybullet.DIRECT)
        self._store = AssetStore(self._client)
        self._intrinsics, self._light, self._far_m = intrinsics, light, far_m
        self._bodies: dict[str, tuple[Body, ...]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(physicsClientId=self._client)
        self._store.__exit__(None, None, None)

    def show(self, objects: Sequence[PlacedObject], time_s: float) -> list[tuple[Body, ...]]:
        """Have exactly these objects, where they are at a time; gives the bodies of each.

        Bodies are always made in the order of the objects: nothing that was drawn before shapes a picture.
        """
        if [placed.object_id for placed in objects] != list(self._bodies):
            for bodies in self._bodies.values():
                for body in bodies:
                    pybullet.removeBody(body.body_id, physicsClientId=self._client)
            self._bodies = {placed.object_id: self._store.spawn(placed.asset) for placed in objects}
        for placed in objects:
            x, y, heading = placed.pose_at(time_s)
            turn = pybullet.getQuaternionFromEuler([0.0, 0.0, heading])
            for body in self._bodies[placed.object_id]:
                pybullet.resetBasePositionAndOrientation(body.body_id, [x, y, 0.0], turn, physicsClientId=self._client)
        return [self._bodies[placed.object_id] for placed in objects]

    def render(self, view: Viewpoint, window: Window, scale: float) -> tuple[Image, NDArray[np.int32]]:
        """Colours (h, w, 3) and body ids (h, w), -1 for none, of a window at `scale` times the image's resolution.

        Where no object is, the colour is white.
        """
        width, height = max(1, round(window.width * scale)), max(1, round(window.height * scale))
        forwards, down = view.world_from_optical[:, 2], view.world_from_optical[:, 1]
        looking = pybullet.computeViewMatrix(view.eye_m.tolist(), (view.eye_m + forwards).tolist(), (-down).tolist())
        _, _, colours, _, body_ids = pybullet.getCameraImage(
            width,
            height,
            looking,
            self._projection(window, width, height),
            lightDirection=(100 * self._light.towards()).tolist(),
            lightColor=[1.0, 1.0, 1.0],
            lightAmbientCoeff=self._light.ambient,
            lightDiffuseCoeff=self._light.diffuse,
            lightSpecularCoeff=0.05,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        return np.reshape(colours, (height, width, 4))[..., :3].copy(), np.reshape(body_ids, (height, width))

    def _projection(self, window: Window, width: int, height: int) -> list[float]:
        """PyBullet's projection of a window rendered with so many pixels."""
        # PyBullet samples a pixel at its lower left corner; half a pixel's shift brings it to the middle.
        right_px = 0.5 * window.width / width - self._intrinsics.width_px / 2
        down_px = -0.5 * window.height / height - self._intrinsics.height_px / 2
        per_px = NEAR_M / self._intrinsics.focal_px
        matrix: list[float] = pybullet.computeProjectionMatrix(
            (window.left + right_px) * per_px,
            (window.right + right_px) * per_px,
            -(window.bottom + down_px) * per_px,
            -(window.top + down_px) * per_px,
            NEAR_M,
            self._far_m,
        )
        return matrix
