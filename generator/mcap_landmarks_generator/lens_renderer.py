"""Renders what a camera with a lens that bends, or a rolling shutter, sees: images and masks bent from wider ones."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.assets.bullet import Body
from mcap_landmarks_generator.camera import Viewpoint
from mcap_landmarks_generator.distortion import WIDEST_RAD, Lens
from mcap_landmarks_generator.drawing import Window
from mcap_landmarks_generator.layout import PlacedObject
from mcap_landmarks_generator.renderer import SUPERSAMPLING, Rendered, Renderer, Visible
from mcap_landmarks_generator.robot import MAX_TURN_RADPS
from mcap_landmarks_generator.rolling_shutter import Band, bands
from mcap_landmarks_generator.scenario import Scenario
from mcap_landmarks_generator.sensor_specs import CameraSpec

Floats = NDArray[np.float64]
Maps = tuple[NDArray[np.float32], NDArray[np.float32]]

_MARGIN_PX = 4
"""What interpolation wants around the wide image."""
_OUTLINE = 17
"""Points along each side of a window that are bent to find where it lies."""


def has_plain_lens(spec: CameraSpec) -> bool:
    """Whether the camera is a pinhole whose rows are all taken at once: `Renderer` draws what it sees."""
    return spec.rolling_shutter_s == 0 and Lens.of(spec).is_pinhole


class LensRenderer:
    """Draws one scenario's world through its camera's lens.

    Colours are interpolated in a pinhole image that is wide enough, with the focal length of the lens in its middle;
    masks take the nearest of its finer pixels, so that boxes are those of the bent image to half a pixel.
    """

    def __init__(self, scenario: Scenario, objects: Sequence[PlacedObject]) -> None:
        spec = scenario.camera
        self._lens = Lens.of(spec)
        self._rows_differ = spec.rolling_shutter_s > 0
        turn_rad = MAX_TURN_RADPS * scenario.robot.speed_factor * spec.rolling_shutter_s
        self._grid, self._fine_grid = self._lens.grid(1), self._lens.grid(SUPERSAMPLING)
        half = np.ceil(_extent(self._grid, turn_rad) * self._lens.focal_px).astype(int) + _MARGIN_PX
        self._middle = half.astype(float)
        wide = replace(
            spec,
            width_px=int(2 * half[0]),
            height_px=int(2 * half[1]),
            field_of_view_deg=float(np.rad2deg(2 * np.arctan(half[0] / self._lens.focal_px))),
        )
        self._renderer = Renderer(replace(scenario, camera=wide), objects)
        self._maps = None if self._rows_differ else (self._map(self._grid), self._map(self._fine_grid))
        self._wide: dict[str, Visible] = {}

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the image."""
        return self._lens.size_px

    def draw(self, view: Viewpoint, readout: Sequence[Viewpoint] = ()) -> Rendered:
        """The image of a view, or of a rolling shutter's readout around it."""
        width, height = self.size_px
        one = Band(0, height, view, np.broadcast_to(np.eye(3), (height, 3, 3)))
        image = np.empty((height, width, 3), np.uint8)
        ids = np.full((height * SUPERSAMPLING, width * SUPERSAMPLING), -1, np.int32)
        numbers: dict[tuple[str, int], int] = {}
        found: dict[str, Visible] = {}
        self._wide = {}
        for band in bands(readout, height) if self._rows_differ and readout else [one]:
            wide = self._renderer.draw(band.view)
            colour_map, mask_map = self._band_maps(band)
            rows = slice(band.first, band.end)
            image[rows] = cv2.remap(wide.image, *colour_map, cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
            fine_rows = slice(band.first * SUPERSAMPLING, band.end * SUPERSAMPLING)
            ids[fine_rows] = _bent_ids(wide, mask_map, numbers)
            for seen in wide.visible:
                bent = self._bent(seen, band, numbers)
                before = found.get(seen.placed.object_id)
                found[seen.placed.object_id] = bent if before is None else _both(before, bent)
                self._wide[seen.placed.object_id] = seen
        everything = Window(0, 0, width, height)
        visible = tuple(seen for seen in found.values() if seen.window.meets(everything))
        return Rendered(image, ids, everything, visible)

    def silhouette_px(self, view: Viewpoint, one: Visible) -> float:
        """See `Renderer.silhouette_px`; of a rolling shutter as if all rows were taken from `view`."""
        wide = self._wide[one.placed.object_id]
        mask = self._renderer.silhouette(view, wide)
        height, width = mask.shape
        u = wide.window.left + np.arange(width + 1) * (wide.window.width / width)
        v = wide.window.top + np.arange(height + 1) * (wide.window.height / height)
        corners = self._lens.pixels((np.stack(np.meshgrid(u, v), axis=-1) - self._middle) / self._lens.focal_px)
        down, across = np.diff(corners, axis=0)[:, :-1], np.diff(corners, axis=1)[:-1]
        areas = np.abs(across[..., 0] * down[..., 1] - across[..., 1] * down[..., 0])
        return float(areas[mask].sum())

    def _band_maps(self, band: Band) -> tuple[Maps, Maps]:
        """Where in the wide image of a band its rows lie, for colours and for finer masks."""
        if self._maps is not None:
            return self._maps
        fine = slice(band.first * SUPERSAMPLING, band.end * SUPERSAMPLING)
        fine_turned = np.repeat(band.rows_turned, SUPERSAMPLING, axis=0)
        return (
            self._map(self._grid[band.first : band.end], band.rows_turned),
            self._map(self._fine_grid[fine], fine_turned),
        )

    def _map(self, plane: Floats, rows_turned: Floats | None = None) -> Maps:
        """Columns and rows (h, w) of the wide image, for remapping, of points (h, w, 2) of the image plane."""
        if rows_turned is not None:
            rays = np.concatenate([plane, np.ones_like(plane[..., :1])], axis=-1) @ rows_turned.transpose(0, 2, 1)
            plane = rays[..., :2] / rays[..., 2:]
        pixels = plane * self._lens.focal_px + self._middle - 0.5
        # What is beyond the lens's limit lies outside the wide image, and becomes black.
        column, row = np.moveaxis(np.where(np.isfinite(pixels), pixels, -1e4).astype(np.float32), -1, 0)
        return np.ascontiguousarray(column), np.ascontiguousarray(row)

    def _bent(self, seen: Visible, band: Band, numbers: dict[tuple[str, int], int]) -> Visible:
        """An object of the wide image with its window in the bent one."""
        window, along = seen.window, np.linspace(0.0, 1.0, _OUTLINE)
        u, v = window.left + along * window.width, window.top + along * window.height
        sides = [(u, np.full(_OUTLINE, edge)) for edge in (window.top, window.bottom)]
        sides += [(np.full(_OUTLINE, edge), v) for edge in (window.left, window.right)]
        outline = (np.concatenate([np.column_stack(side) for side in sides]) - self._middle) / self._lens.focal_px
        rays = np.column_stack([outline, np.ones(len(outline))])
        # Between the first row of the band and the last it turns one way.
        turned = np.concatenate([rays @ band.rows_turned[row] for row in (0, -1)])
        pixels = self._lens.pixels(turned[:, :2] / turned[:, 2:])
        (left, top), (right, bottom) = np.floor(pixels.min(axis=0)) - 1, np.ceil(pixels.max(axis=0)) + 1
        bodies = tuple(
            Body(_number(numbers, seen.placed.object_id, part), body.labelled) for part, body in enumerate(seen.bodies)
        )
        return replace(seen, bodies=bodies, window=Window(int(left), int(top), int(right), int(bottom)))


def _extent(grid: Floats, turn_rad: float) -> Floats:
    """How far (2,) from its middle a pinhole image of focal length 1 must reach to hold all points (h, w, 2), even
    when rows are turned sideways by up to an angle."""
    plane = grid[np.isfinite(grid).all(axis=-1)]
    angle = np.minimum(np.arctan(np.abs(plane[:, 0])) + turn_rad, WIDEST_RAD)
    x = np.tan(angle)
    y = np.abs(plane[:, 1]) * np.sqrt((1 + x * x) / (1 + plane[:, 0] ** 2))
    return np.array([x.max(), y.max()])


def _number(numbers: dict[tuple[str, int], int], object_id: str, part: int) -> int:
    """The number of a part of an object in the masks of one image: ids differ from band to band."""
    return numbers.setdefault((object_id, part), len(numbers))


def _bent_ids(wide: Rendered, maps: Maps, numbers: dict[tuple[str, int], int]) -> NDArray[np.int32]:
    """The mask of a wide image, bent, with the bodies' numbers in the place of their ids."""
    if wide.window is None:
        return np.full(maps[0].shape, -1, np.int32)
    ids = np.full(wide.body_ids.shape, -1, np.int16)
    for seen in wide.visible:
        for part, body in enumerate(seen.bodies):
            ids[wide.body_ids == body.body_id] = _number(numbers, seen.placed.object_id, part)
    # Remapping counts from the middle of the first pixel, of the wide image and of its finer window.
    column, row = (
        (places + np.float32(0.5 - first)) * np.float32(SUPERSAMPLING) - np.float32(0.5)
        for places, first in zip(maps, (wide.window.left, wide.window.top), strict=True)
    )
    bent = cv2.remap(ids, column, row, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=-1)
    return np.asarray(bent, np.int32)


def _both(one: Visible, other: Visible) -> Visible:
    """An object that several bands show, with a window that holds it in all of them."""
    first, second = one.window, other.window
    window = Window(
        min(first.left, second.left),
        min(first.top, second.top),
        max(first.right, second.right),
        max(first.bottom, second.bottom),
    )
    nearest, farthest = min(one.nearest_m, other.nearest_m), max(one.farthest_m, other.farthest_m)
    return replace(one, window=window, nearest_m=nearest, farthest_m=farthest)
