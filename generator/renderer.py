"""Renders what the camera sees: objects by PyBullet's software renderer, ground and sky by ourselves; with masks."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np
import pybullet
from numpy.typing import NDArray

from generator.assets import ground, sky
from generator.assets.backdrop import Backdrop, Shadow, cast_shadow
from generator.assets.bullet import AssetStore, Body
from generator.camera import Intrinsics, View
from generator.layout import PlacedObject
from generator.scenario import Scenario

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

FAR_M = 30.0
"""Objects beyond this distance are not drawn."""
NEAR_M = 0.05
SUPERSAMPLING = 2
"""Objects are rendered this many times finer than the image, for smooth edges."""


@dataclass(frozen=True, slots=True)
class Window:
    """A part of the image plane in pixels of the image, which may lie partly outside of it."""

    left: int
    top: int
    right: int
    bottom: int


@dataclass(frozen=True, slots=True, eq=False)
class Visible:
    """An object in view: `window` holds all of it, the parts outside the image included."""

    placed: PlacedObject
    bodies: tuple[Body, ...]
    window: Window
    distance_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Rendered:
    """An image (H, W, 3) RGB, and the ids of PyBullet's bodies (h, w), -1 for none, in a finer `window` of it."""

    image: Image
    body_ids: NDArray[np.int32]
    window: Window | None
    visible: tuple[Visible, ...]


class Renderer:
    """Draws one scenario's world from any place; a context manager that disconnects from PyBullet."""

    def __init__(self, scenario: Scenario, objects: Sequence[PlacedObject]) -> None:
        self._client: int = pybullet.connect(pybullet.DIRECT)
        self._store = AssetStore(self._client)
        self._objects = objects
        self._centres = np.array([placed.route_xy[0] for placed in objects]).reshape(-1, 2)
        self._intrinsics = Intrinsics.of(scenario.camera)
        self._rays = self._intrinsics.rays()
        light = scenario.light
        azimuth, elevation = np.deg2rad(light.azimuth_deg), np.deg2rad(light.elevation_deg)
        self._towards_light = np.array(
            [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
        )
        self._light = light
        self._backdrop = Backdrop(
            sky.panorama(scenario.background.kind, scenario.background.look),
            ground.texture(scenario.ground.kind, scenario.ground.look),
            scenario.ground.tile_m,
        )
        self._shadows: dict[str, Shadow] = {}
        self._drawn: tuple[str, ...] = ()
        self._bodies: dict[str, tuple[Body, ...]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(physicsClientId=self._client)
        self._store.__exit__(None, None, None)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the image."""
        return self._intrinsics.width_px, self._intrinsics.height_px

    def draw(self, view: View) -> Rendered:
        """The image of a view."""
        in_view = self._in_view(view)
        image = self._backdrop.view(
            view.eye_m,
            self._rays @ view.world_from_optical.T.astype(np.float32),
            1 / self._intrinsics.focal_px,
            [self._shadow(placed, view.time_s) for placed, _ in in_view],
            self._light.shade,
        )
        visible = self._placed_bodies(view, in_view)
        window = self._inner_window([one.window for one in visible])
        if window is None:
            return Rendered(image, np.full((0, 0), -1, np.int32), None, visible)
        colours, body_ids = self._render(view, window, SUPERSAMPLING)
        _lay_over(image, window, colours, body_ids >= 0)
        return Rendered(image, body_ids, window, visible)

    def silhouette_px(self, view: View, one: Visible, side_px: int = 160) -> float:
        """Area in pixels of the image of an object's labelled parts, were none hidden by objects or the image's edge."""
        width, height = one.window.right - one.window.left, one.window.bottom - one.window.top
        scale = min(float(SUPERSAMPLING), side_px / max(width, height))
        others = [body for name, bodies in self._bodies.items() if name != one.placed.object_id for body in bodies]
        hidden = others + [body for body in one.bodies if not body.labelled]
        places = [pybullet.getBasePositionAndOrientation(body.body_id, physicsClientId=self._client) for body in hidden]
        for body in hidden:
            self._move(body, (0.0, 0.0, -1000.0), (0.0, 0.0, 0.0, 1.0))
        _, body_ids = self._render(view, one.window, scale)
        for body, (position, orientation) in zip(hidden, places, strict=True):
            self._move(body, position, orientation)
        return float((body_ids >= 0).mean()) * width * height

    def _in_view(self, view: View) -> list[tuple[PlacedObject, Window]]:
        """Objects within reach whose bounding box meets the image, with the window that holds the box."""
        found = []
        for i, placed in enumerate(self._objects):
            pose = placed.pose_at(view.time_s) if placed.moves else np.array([*self._centres[i], placed.yaw_rad])
            away = pose[:2] - view.eye_m[:2]
            reach = placed.asset.footprint_radius_m
            if away @ away > (FAR_M + reach) ** 2 or view.world_from_optical[:2, 2] @ away < -reach:
                continue
            window = self._window(view, placed, pose)
            if window is not None:
                found.append((placed, window))
        return found

    def _window(self, view: View, placed: PlacedObject, pose: Floats) -> Window | None:
        """The window around an object's bounding box; None if it lies outside the image."""
        low, high = placed.asset.bounds_m
        corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        c, s = np.cos(pose[2]), np.sin(pose[2])
        world = corners @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + [pose[0], pose[1], 0.0]
        local = (world - view.eye_m) @ view.world_from_optical
        if local[:, 2].max() < NEAR_M:
            return None
        # Corners beside or behind the camera are drawn to its front: their direction sideways stays.
        local[:, 2] = np.maximum(local[:, 2], NEAR_M)
        pixels = self._intrinsics.project(local)
        width, height = self._intrinsics.width_px, self._intrinsics.height_px
        (left, top), (right, bottom) = np.floor(pixels.min(axis=0)), np.ceil(pixels.max(axis=0)) + 1
        if right <= 0 or left >= width or bottom <= 0 or top >= height:
            return None
        # An object beside the camera would need a window without end.
        left, right = max(left, -width), min(right, 2 * width)
        top, bottom = max(top, -height), min(bottom, 2 * height)
        return Window(int(left), int(top), int(right), int(bottom))

    def _placed_bodies(self, view: View, in_view: list[tuple[PlacedObject, Window]]) -> tuple[Visible, ...]:
        """Have exactly the objects in view in the renderer, always in the same order: nothing else shapes a picture."""
        names = tuple(placed.object_id for placed, _ in in_view)
        if names != self._drawn:
            for bodies in self._bodies.values():
                for body in bodies:
                    pybullet.removeBody(body.body_id, physicsClientId=self._client)
            self._bodies = {placed.object_id: self._store.spawn(placed.asset) for placed, _ in in_view}
            self._drawn = names
        visible = []
        for placed, window in in_view:
            x, y, heading = placed.pose_at(view.time_s)
            turn = pybullet.getQuaternionFromEuler([0.0, 0.0, heading])
            bodies = self._bodies[placed.object_id]
            for body in bodies:
                self._move(body, (x, y, 0.0), turn)
            distance = float(np.hypot(*(view.eye_m[:2] - (x, y))))
            visible.append(Visible(placed, bodies, window, distance))
        return tuple(visible)

    def _move(self, body: Body, position: Sequence[float], orientation: Sequence[float]) -> None:
        pybullet.resetBasePositionAndOrientation(body.body_id, position, orientation, physicsClientId=self._client)

    def _inner_window(self, windows: list[Window]) -> Window | None:
        """The part of the image that holds all windows."""
        if not windows:
            return None
        return Window(
            max(0, min(window.left for window in windows)),
            max(0, min(window.top for window in windows)),
            min(self._intrinsics.width_px, max(window.right for window in windows)),
            min(self._intrinsics.height_px, max(window.bottom for window in windows)),
        )

    def _shadow(self, placed: PlacedObject, time_s: float) -> Shadow:
        x, y, heading = placed.pose_at(time_s)
        if placed.moves:
            return cast_shadow(placed.asset, heading, self._towards_light).at(x, y)
        if placed.object_id not in self._shadows:
            self._shadows[placed.object_id] = cast_shadow(placed.asset, heading, self._towards_light).at(x, y)
        return self._shadows[placed.object_id]

    def _render(self, view: View, window: Window, scale: float) -> tuple[Image, NDArray[np.int32]]:
        """Colours (h, w, 3) and body ids (h, w) of a window at `scale` times the image's resolution."""
        width = max(1, round((window.right - window.left) * scale))
        height = max(1, round((window.bottom - window.top) * scale))
        # PyBullet samples a pixel at its lower left corner; half a pixel's shift brings it to the middle.
        right_px = 0.5 * (window.right - window.left) / width - self._intrinsics.width_px / 2
        down_px = -0.5 * (window.bottom - window.top) / height - self._intrinsics.height_px / 2
        per_px = NEAR_M / self._intrinsics.focal_px
        projection = pybullet.computeProjectionMatrix(
            (window.left + right_px) * per_px,
            (window.right + right_px) * per_px,
            -(window.bottom + down_px) * per_px,
            -(window.top + down_px) * per_px,
            NEAR_M,
            2 * FAR_M,
        )
        forwards, down = view.world_from_optical[:, 2], view.world_from_optical[:, 1]
        looking = pybullet.computeViewMatrix(view.eye_m.tolist(), (view.eye_m + forwards).tolist(), (-down).tolist())
        _, _, colours, _, body_ids = pybullet.getCameraImage(
            width,
            height,
            looking,
            projection,
            lightDirection=(100 * self._towards_light).tolist(),
            lightColor=[1.0, 1.0, 1.0],
            lightAmbientCoeff=self._light.ambient,
            lightDiffuseCoeff=self._light.diffuse,
            lightSpecularCoeff=0.05,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        return np.reshape(colours, (height, width, 4))[..., :3].copy(), np.reshape(body_ids, (height, width))


def _lay_over(image: Image, window: Window, colours: Image, covered: NDArray[np.bool_]) -> None:
    """Blend finer colours into a window of the image, by how much of each pixel they cover, in place."""
    target = image[window.top : window.bottom, window.left : window.right]
    size = (target.shape[1], target.shape[0])
    hole = cv2.resize(np.where(covered, np.uint8(0), np.uint8(255)), size, interpolation=cv2.INTER_AREA)[..., None]
    # Where no object is, PyBullet gives white: what the finer colours average to there is the hole itself.
    front = cv2.subtract(cv2.resize(colours, size, interpolation=cv2.INTER_AREA), np.repeat(hole, 3, axis=2))
    behind = (target.astype(np.uint16) * hole + 127) // 255
    target[:] = cv2.add(front, behind.astype(np.uint8))
