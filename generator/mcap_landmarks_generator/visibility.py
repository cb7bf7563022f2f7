"""Which objects an image shows, where, and how much of each: the truth about its detections."""

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from mcap_landmarks.messages.detections import Detections

from mcap_landmarks_generator.assets.catalog import COCO_ID
from mcap_landmarks_generator.camera import Viewpoint
from mcap_landmarks_generator.renderer import SUPERSAMPLING, Rendered, Visible
from mcap_landmarks_generator.robot import OPTICAL_FRAME

_LEAST_AREA_PX = 4.0


class Drawn(Protocol):
    """What drew an image: a `Renderer`, or one with a lens."""

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the image."""

    def silhouette_px(self, view: Viewpoint, one: Visible) -> float:
        """Area in pixels of the image of an object's labelled parts, were none hidden by an object or the edge."""


def true_detections(
    rendered: Rendered, renderer: Drawn, view: Viewpoint, stamp_ns: int, frame_id: str = OPTICAL_FRAME
) -> Detections:
    """Box of the visible labelled parts of each object, from the mask; the score is the visible share of them.

    The share counts what other objects and the image's edges hide. Objects are left out that show less than 4 pixels.
    """
    names, options, boxes = [], [], []
    owners = {body.body_id: one for one in rendered.visible for body in one.bodies}
    for one in rendered.visible:
        seen = _seen(rendered, one) if one.placed.asset.name in COCO_ID else None
        if seen is None:
            continue
        share = 1.0
        # Whatever hides a part of an object borders on the rest of it.
        beside = [owners[body_id] for body_id in seen.bodies_beside if owners.get(body_id, one) is not one]
        if _beyond_edge(one, renderer) or any(other.may_hide(one) for other in beside):
            share = min(1.0, seen.area_px / max(renderer.silhouette_px(view, one), seen.area_px))
        names.append(one.placed.object_id)
        options.append(((one.placed.asset.name, round(share, 3)),))
        boxes.append(seen.box_xyxy)
    return Detections(stamp_ns, frame_id, tuple(names), tuple(options), np.array(boxes, float).reshape(-1, 4))


@dataclass(frozen=True, slots=True)
class _Seen:
    """Box and area, in pixels of the image, of what shows of an object, and the bodies of others right beside it."""

    box_xyxy: tuple[float, float, float, float]
    area_px: float
    bodies_beside: frozenset[int]


def _seen(rendered: Rendered, one: Visible) -> _Seen | None:
    """What an image shows of an object's labelled parts, None if hardly anything."""
    inner = rendered.window
    if inner is None:
        return None
    # Only its own window of the mask can show it.
    left, top = max(one.window.left, inner.left), max(one.window.top, inner.top)
    part = rendered.body_ids[
        (top - inner.top) * SUPERSAMPLING : (one.window.bottom - inner.top) * SUPERSAMPLING,
        (left - inner.left) * SUPERSAMPLING : (one.window.right - inner.left) * SUPERSAMPLING,
    ]
    mask = np.zeros(part.shape, bool)
    for body in one.bodies:
        if body.labelled:
            mask |= part == body.body_id
    area_px = np.count_nonzero(mask) / SUPERSAMPLING**2
    if area_px < _LEAST_AREA_PX:
        return None
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    x = left + np.array([columns[0], columns[-1] + 1]) / SUPERSAMPLING
    y = top + np.array([rows[0], rows[-1] + 1]) / SUPERSAMPLING
    border = cv2.dilate(mask.view(np.uint8), np.ones((3, 3), np.uint8)).astype(bool) & ~mask
    beside = frozenset(np.unique(part[border]).tolist())
    return _Seen((float(x[0]), float(y[0]), float(x[1]), float(y[1])), area_px, beside)


def _beyond_edge(one: Visible, renderer: Drawn) -> bool:
    """Whether an object may reach beyond the image."""
    width, height = renderer.size_px
    window = one.window
    return window.left < 0 or window.top < 0 or window.right > width or window.bottom > height
