"""A map as a picture whose background is drawn once, and what moves over it, quickly."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO

import cv2
import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.report.drawing import regions_95
from mcap_landmarks.report.plots import draw_classes, draw_ellipses, set_style
from mcap_landmarks.vision.pixels import Rgb

Colour = tuple[int, int, int]
ESTIMATE, TRUTH, SCAN, OBJECT, STALE = (213, 94, 0), (0, 114, 178), (15, 118, 110), (126, 34, 206), (156, 163, 175)
"""Of the estimate, the truth, the scan, the objects in it, and of what is not known any more."""
_DPI, _USUAL_PX = 100, 640
"""Pixels per inch of a picture whose shorter side has so many; letters grow with it."""
_MARGIN, _SMALLEST_M = 0.08, 4.0
_LEFT, _BELOW, _RIGHT, _ABOVE = 0.075, 0.09, 0.98, 0.93
"""Where the axes are in the picture, so that numbers and legend have room around them."""
_FINE = 4
"""Bits of a pixel's fraction that OpenCV draws with."""
_LEGEND_COLUMNS = 4


@dataclass(frozen=True, slots=True, eq=False)
class MapCanvas:
    """A background (H, W, 3) of the map, the way from metres (N, 2) to its pixels, and its corners.

    Lengths in pixels are of a picture of the usual size, and drawn `scale` times as large. What lies beyond the corners
    is not drawn as a dot.
    """

    background: Rgb
    pixels_from_m: Callable[[Array], Array]
    low_xy: Array
    high_xy: Array
    scale: float

    @classmethod
    def of(
        cls,
        landmarks: SceneObjects | None,
        spots_xy: Array,
        size: tuple[int, int],
        title: str,
        moving: Mapping[str, tuple[Colour, str]],
    ) -> "MapCanvas":
        """Draw landmarks with their uncertainty, so that all spots (N, 2) are in the picture of W, H pixels.

        The legend also tells what will be `moving` over it: by name the colour, and the marker or line.
        """
        with mpl.rc_context():
            mpl.rcdefaults()
            set_style()
            dpi = _DPI * min(size) / _USUAL_PX
            figure = Figure(figsize=(size[0] / dpi, size[1] / dpi), dpi=dpi, facecolor="white")
            axes = figure.add_axes((_LEFT, _BELOW, _RIGHT - _LEFT, _ABOVE - _BELOW))
            known = [spots_xy[np.isfinite(spots_xy).all(axis=1)]]
            if landmarks is not None and len(landmarks):
                draw_classes(axes, landmarks.classes, landmarks.positions_xy)
                draw_ellipses(axes, landmarks.positions_xy, landmarks.covariances)
                known.append(landmarks.positions_xy)
            ratio = (_RIGHT - _LEFT) * size[0] / ((_ABOVE - _BELOW) * size[1])
            low, high = _limits(np.vstack(known), ratio)
            axes.set_xlim(low[0], high[0])
            axes.set_ylim(low[1], high[1])
            axes.grid(color="#E5E7EB", linewidth=0.6)
            axes.set_axisbelow(True)
            axes.spines[["top", "right"]].set_visible(False)
            axes.set_title(title, loc="left", color="#111827", fontsize=11, fontweight="bold")
            for name, (colour, look) in moving.items():
                axes.plot(
                    [],
                    [],
                    look,
                    color=np.array(colour) / 255,
                    markerfacecolor="none" if look == "o" else None,
                    label=name,
                )
            if axes.get_legend_handles_labels()[0]:
                axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=_LEGEND_COLUMNS, frameon=False, fontsize=7)
            stream = BytesIO()
            figure.savefig(stream, format="raw", dpi=dpi)
            picture = np.frombuffer(stream.getvalue(), np.uint8).reshape(size[1], size[0], 4)[..., :3]
            return cls(np.ascontiguousarray(picture), axes.transData.transform, low, high, dpi / _DPI)

    def pixels(self, points_xy: Array) -> NDArray[np.int32]:
        """Where points (N, 2) in metres are in the picture, as OpenCV draws fractions of pixels."""
        found = np.asarray(self.pixels_from_m(np.reshape(points_xy, (-1, 2))), dtype=np.float64)
        found[:, 1] = self.background.shape[0] - found[:, 1]
        limit = 1 << 14  # far outside of any picture, and within what OpenCV counts with
        return np.rint(np.clip(found, -limit, limit) * (1 << _FINE)).astype(np.int32)

    def line(self, picture: Rgb, points_xy: Array, colour: Colour, width: int = 2) -> None:
        """A line through points (N, 2)."""
        if len(points_xy) > 1:
            cv2.polylines(
                picture, [self.pixels(points_xy)], False, colour, max(round(width * self.scale), 1), cv2.LINE_AA, _FINE
            )

    def dots(self, picture: Rgb, points_xy: Array, colour: Colour, radius: float, *, filled: bool = True) -> None:
        """A dot or a ring at every point (N, 2); the radius is in pixels."""
        inside = ((points_xy > self.low_xy) & (points_xy < self.high_xy)).all(axis=1)
        for place in self.pixels(points_xy[inside]).tolist():
            size = round(radius * self.scale * (1 << _FINE))
            cv2.circle(picture, place, size, colour, -1 if filled else 1, cv2.LINE_AA, _FINE)

    def ellipse(self, picture: Rgb, place_xy: Array, covariance: Array, colour: Colour) -> None:
        """The 95 % region of a position, shaded; covariance (2, 2)."""
        radii, directions = regions_95(covariance[None])
        angle = np.linspace(0, 2 * np.pi, 48)
        ring = np.column_stack([radii[0, 0] * np.cos(angle), radii[0, 1] * np.sin(angle)])
        outline = [self.pixels(transform_points(np.array([*place_xy, directions[0]]), ring))]
        left, top, width, height = cv2.boundingRect(outline[0] >> _FINE)
        rows, columns = slice(max(top, 0), max(top + height, 0)), slice(max(left, 0), max(left + width, 0))
        before = picture[rows, columns].copy()
        cv2.fillPoly(picture, outline, colour, cv2.LINE_AA, _FINE)
        picture[rows, columns] = (picture[rows, columns] // 4 + before // 4 * 3).astype(np.uint8)
        cv2.polylines(picture, outline, True, colour, 1, cv2.LINE_AA, _FINE)

    def robot(self, picture: Rgb, pose: Array, colour: Colour, size_px: float = 13.0) -> None:
        """An arrowhead at a pose (3,), or a dot where no heading is known."""
        if not np.isfinite(pose[2]):
            self.dots(picture, pose[None, :2], colour, size_px / 2)
            return
        corners = np.array([[1.0, 0.0], [-0.8, 0.7], [-0.45, 0.0], [-0.8, -0.7]]) * size_px * self.scale * (1 << _FINE)
        turned = transform_points(np.array([0.0, 0.0, pose[2]]), corners) * [1, -1]
        outline = [np.rint(self.pixels(pose[None, :2]) + turned).astype(np.int32)]
        cv2.fillPoly(picture, outline, colour, cv2.LINE_AA, _FINE)
        cv2.polylines(picture, outline, True, (255, 255, 255), 1, cv2.LINE_AA, _FINE)


def _limits(spots_xy: Array, ratio: float) -> tuple[Array, Array]:
    """The corners of an area around spots whose width is `ratio` times its height."""
    low, high = (spots_xy.min(axis=0), spots_xy.max(axis=0)) if len(spots_xy) else (np.zeros(2), np.zeros(2))
    middle, extent = (low + high) / 2, np.maximum((high - low) * (1 + 2 * _MARGIN), _SMALLEST_M)
    height = max(extent[1], extent[0] / ratio)
    half = np.array([height * ratio, height]) / 2
    return middle - half, middle + half


def segments(path: Sequence[tuple[int, float, float]], longest_ns: int) -> list[Array]:
    """A path of stamps and positions as pieces (N, 2), parted where it pauses."""
    if not path:
        return []
    stamps, places = np.array([step[0] for step in path]), np.array([step[1:] for step in path])
    return np.split(places, np.flatnonzero(np.diff(stamps) > longest_ns) + 1)
