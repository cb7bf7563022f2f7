"""Renders what the camera sees: which objects are in view, in front of ground and sky, with their masks."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.assets import ground, sky
from mcap_landmarks_generator.assets.backdrop import Backdrop, Pinhole
from mcap_landmarks_generator.assets.bullet import Body
from mcap_landmarks_generator.assets.shadow import Shadow, cast_shadow
from mcap_landmarks_generator.camera import Intrinsics, Viewpoint
from mcap_landmarks_generator.drawing import NEAR_M, Drawing, Image, Window, bodies_of
from mcap_landmarks_generator.layout import PlacedObject
from mcap_landmarks_generator.scenario import Scenario

Floats = NDArray[np.float64]

FAR_M = 30.0
"""Objects beyond this distance are not drawn."""
SHADOWS_TO_M = 12.0
"""So far away the ground shows a shadow as a line of a pixel or two."""
SUPERSAMPLING = 2
"""Objects are rendered this many times finer than the image, for smooth edges."""
# Silhouettes of larger windows are rendered coarser.
_SILHOUETTE_AREA_PX = 7_500


@dataclass(frozen=True, slots=True, eq=False)
class Visible:
    """An object in view: `window` holds all of it, the parts outside the image included; distances bound it, too."""

    placed: PlacedObject
    bodies: tuple[Body, ...]
    window: Window
    nearest_m: float
    farthest_m: float

    def may_hide(self, other: "Visible") -> bool:
        """Whether any of it can be nearer than some of the other one."""
        return self.nearest_m < other.farthest_m


@dataclass(frozen=True, slots=True, eq=False)
class Rendered:
    """An image (H, W, 3) RGB, and the ids of bodies (h, w), -1 for none, in a finer `window` of it."""

    image: Image
    body_ids: NDArray[np.int32]
    window: Window | None
    visible: tuple[Visible, ...]


class Renderer:
    """Draws one scenario's world from any place."""

    def __init__(
        self,
        scenario: Scenario,
        objects: Sequence[PlacedObject],
        far_m: float = FAR_M,
        shadows_to_m: float = SHADOWS_TO_M,
    ) -> None:
        """`far_m` and `shadows_to_m`, along the ground, are how far objects and their shadows are drawn."""
        self._far_m, self._shadows_to_m = far_m, shadows_to_m
        self._intrinsics = Intrinsics.of(scenario.camera)
        self._light = scenario.light
        self._drawing = Drawing(self._intrinsics, self._light)
        self._objects = objects
        self._centres = np.array([placed.route_xy[0] for placed in objects]).reshape(-1, 2)
        self._moving = np.array([placed.moves for placed in objects], dtype=bool)
        self._reach_of = {placed.object_id: placed.asset.footprint_radius_m for placed in objects}
        self._reach_m = np.array(list(self._reach_of.values()))
        self._corners = [_corners(placed, 0.0) for placed in objects]
        self._backdrop = Backdrop(
            Pinhole.of(*self.size_px, self._intrinsics.focal_px),
            sky.panorama(scenario.background.kind, scenario.background.look),
            ground.texture(scenario.ground.kind, scenario.ground.look),
            scenario.ground.tile_m,
        )
        self._shadows: dict[str, Shadow] = {}

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the image."""
        return self._intrinsics.width_px, self._intrinsics.height_px

    def draw(self, view: Viewpoint) -> Rendered:
        """The image of a view."""
        in_view = self._in_view(view)
        objects = [placed for placed, _ in in_view]
        image = self._backdrop.view(
            view.eye_m,
            view.world_from_optical,
            self._shadows_in(view, objects),
            self._light.shade,
        )
        bodies = bodies_of(objects)
        visible = tuple(
            self._visible(view, placed, body, window) for (placed, window), body in zip(in_view, bodies, strict=True)
        )
        window = self._inner_window([one.window for one in visible])
        if window is None:
            return Rendered(image, np.full((0, 0), -1, np.int32), None, visible)
        colours, body_ids = self._drawing.render(view, objects, window, SUPERSAMPLING)
        _lay_over(image, window, colours, body_ids >= 0)
        return Rendered(image, body_ids, window, visible)

    def silhouette_px(self, view: Viewpoint, one: Visible) -> float:
        """Area in pixels of the image of an object's labelled parts, were none hidden by an object or the edge."""
        return float(self.silhouette(view, one).mean()) * one.window.width * one.window.height

    def silhouette(self, view: Viewpoint, one: Visible) -> NDArray[np.bool_]:
        """Mask (h, w) of these parts in the object's window, of a resolution of its own."""
        area_px = one.window.width * one.window.height
        scale = SUPERSAMPLING * min(1.0, float(np.sqrt(_SILHOUETTE_AREA_PX / area_px)))
        return self._drawing.mask(view, one.placed, one.window, scale)

    def _visible(self, view: Viewpoint, placed: PlacedObject, bodies: tuple[Body, ...], window: Window) -> Visible:
        distance = float(np.hypot(*(placed.pose_at(view.time_s)[:2] - view.eye_m[:2])))
        reach = self._reach_of[placed.object_id]
        return Visible(placed, bodies, window, distance - reach, distance + reach)

    def _in_view(self, view: Viewpoint) -> list[tuple[PlacedObject, Window]]:
        """Objects within reach whose bounding box meets the image, with the window that holds the box."""
        centres = self._centres.copy()
        for i in np.flatnonzero(self._moving).tolist():
            centres[i] = self._objects[i].pose_at(view.time_s)[:2]
            self._corners[i] = _corners(self._objects[i], view.time_s)
        away = centres - view.eye_m[:2]
        ahead = away @ view.world_from_optical[:2, 2] > -self._reach_m
        near = np.hypot(away[:, 0], away[:, 1]) < self._far_m
        chosen = np.flatnonzero(ahead & near).tolist()
        if not chosen:
            return []
        windows = self._windows(view, np.stack([self._corners[i] for i in chosen]))
        found = zip(chosen, windows, strict=True)
        return [(self._objects[i], window) for i, window in found if window is not None]

    def _windows(self, view: Viewpoint, corners: Floats) -> list[Window | None]:
        """The window around each bounding box (N, 8, 3) in the world; None if it lies outside the image."""
        local = (corners - view.eye_m) @ view.world_from_optical
        behind = local[..., 2].max(axis=1) < NEAR_M
        # Corners beside or behind the camera are drawn to its front: their direction sideways stays.
        local[..., 2] = np.maximum(local[..., 2], NEAR_M)
        pixels = self._intrinsics.project(local.reshape(-1, 3)).reshape(-1, 8, 2)
        width, height = self.size_px
        # An object beside the camera would need a window without end.
        low = np.maximum(np.floor(pixels.min(axis=1)), [-width, -height]).astype(int)
        high = np.minimum(np.ceil(pixels.max(axis=1)) + 1, [2 * width, 2 * height]).astype(int)
        image = Window(0, 0, width, height)
        windows = [Window(*sides) for sides in np.hstack([low, high]).tolist()]
        return [
            window if window.meets(image) and not hidden else None
            for window, hidden in zip(windows, behind.tolist(), strict=True)
        ]

    def _inner_window(self, windows: list[Window]) -> Window | None:
        """The part of the image that holds all windows."""
        if not windows:
            return None
        width, height = self.size_px
        return Window(
            max(0, min(window.left for window in windows)),
            max(0, min(window.top for window in windows)),
            min(width, max(window.right for window in windows)),
            min(height, max(window.bottom for window in windows)),
        )

    def _shadows_in(self, view: Viewpoint, objects: Sequence[PlacedObject]) -> list[Shadow]:
        """Shadows of the objects that are near; those of objects that stand still are cast once."""
        shadows = []
        for placed in objects:
            x, y, heading = placed.pose_at(view.time_s)
            if np.hypot(*(view.eye_m[:2] - (x, y))) > self._shadows_to_m:
                continue
            shadow = self._shadows.get(placed.object_id)
            if shadow is None:
                shadow = cast_shadow(placed.asset, heading, self._light.towards()).at(x, y)
                if not placed.moves:
                    self._shadows[placed.object_id] = shadow
            shadows.append(shadow)
        return shadows


def _corners(placed: PlacedObject, time_s: float) -> Floats:
    """Corners (8, 3) of an object's bounding box, turned with it, in the world at a time."""
    low, high = placed.asset.bounds_m
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    x, y, heading = placed.pose_at(time_s)
    c, s = np.cos(heading), np.sin(heading)
    return np.asarray(corners @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + [x, y, 0.0])


def _lay_over(image: Image, window: Window, colours: Image, covered: NDArray[np.bool_]) -> None:
    """Blend finer colours into a window of the image, by how much of each pixel they cover, in place."""
    target = image[window.top : window.bottom, window.left : window.right]
    size = (target.shape[1], target.shape[0])
    hole = cv2.resize(np.where(covered, np.uint8(0), np.uint8(255)), size, interpolation=cv2.INTER_AREA)[..., None]
    # Where no object is, the finer colours are white: what they average to there is the hole itself.
    front = cv2.subtract(cv2.resize(colours, size, interpolation=cv2.INTER_AREA), np.repeat(hole, 3, axis=2))
    behind = (target.astype(np.uint16) * hole + 127) // 255
    target[:] = cv2.add(front, behind.astype(np.uint8))
