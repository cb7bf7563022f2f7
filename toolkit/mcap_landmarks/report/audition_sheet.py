"""The contact sheet of an audition: a row per object, a column per distance, cells framed by what came of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.evaluation.audition import Audition, Heard, distances_of
from mcap_landmarks.vision.pixels import Rgb

_CELL_PX = 128
_FRAME_PX, _LINE_PX, _HEAD_PX, _NAME_PX = 4, 18, 24, 150
_MARGIN = 0.35
"""The ground and sky around a box, as a share of its longer side."""
_GOOD, _WRONG, _MISSED = (0, 158, 115), (230, 159, 0), (213, 94, 0)  # green, orange, vermillion: Okabe and Ito, 2008
_INK = (20, 20, 20)


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """A view for the sheet: the part of its image (h, w, 3) around the object, and what came of it."""

    picture: Rgb
    heard: Heard


def cut_out(image: Rgb, box_xyxy: NDArray[np.float64]) -> Rgb:
    """A square around a box (4,), as far as the image goes."""
    centre = (box_xyxy[:2] + box_xyxy[2:]) / 2
    half = (0.5 + _MARGIN) * float((box_xyxy[2:] - box_xyxy[:2]).max())
    low = np.maximum(np.floor(centre - half), 0).astype(int)
    high = np.minimum(np.ceil(centre + half), image.shape[1::-1]).astype(int)
    return image[low[1] : high[1], low[0] : high[0]]


def sheet(auditions: Sequence[Audition], cells: Sequence[Sequence[Cell]]) -> Rgb:
    """The sheet: a row per object with its cells, one for each distance.

    Their frames are green where it was recognised, orange where taken for another class, red where missed.
    """
    lefts = {distance_m: _NAME_PX + i * _CELL_PX for i, distance_m in enumerate(distances_of(auditions))}
    width = _NAME_PX + len(lefts) * _CELL_PX
    head = np.full((_HEAD_PX, width, 3), 255, np.uint8)
    for distance_m, left in lefts.items():
        _write(head, f"{distance_m:g} m", (left + _FRAME_PX, _HEAD_PX - 8))
    rows = [head]
    for audition, row in zip(auditions, cells, strict=True):
        picture = np.full((_CELL_PX + 2 * _LINE_PX, width, 3), 255, np.uint8)
        _write(picture, audition.class_name, (4, _LINE_PX))
        _write(picture, audition.variant, (4, 2 * _LINE_PX))
        for cell in row:
            left = lefts[cell.heard.distance_m]
            picture[:_CELL_PX, left : left + _CELL_PX] = _framed(cell, audition.class_name)
            found = f"{cell.heard.found} {cell.heard.score:.2f}" if cell.heard.found else "nothing"
            _write(picture, found, (left + _FRAME_PX, _CELL_PX + _LINE_PX - 4))
            _write(picture, f"{cell.heard.hits} beams", (left + _FRAME_PX, _CELL_PX + 2 * _LINE_PX - 6))
        rows.append(picture)
    return np.vstack(rows)


def _framed(cell: Cell, class_name: str) -> Rgb:
    colour = _GOOD if cell.heard.found == class_name else _WRONG if cell.heard.found else _MISSED
    whole = np.full((_CELL_PX, _CELL_PX, 3), colour, np.uint8)
    height, width = cell.picture.shape[:2]
    scale = (_CELL_PX - 2 * _FRAME_PX) / max(height, width)
    size = max(1, int(width * scale)), max(1, int(height * scale))
    small = cv2.resize(cell.picture, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC)
    left, top = (_CELL_PX - size[0]) // 2, (_CELL_PX - size[1]) // 2
    whole[top : top + size[1], left : left + size[0]] = small
    return whole


def _write(image: Rgb, text: str, where: tuple[int, int]) -> None:
    cv2.putText(image, text, where, cv2.FONT_HERSHEY_SIMPLEX, 0.42, _INK, 1, cv2.LINE_AA)
