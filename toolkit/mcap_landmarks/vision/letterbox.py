"""Letterbox: an image scaled into a network's input with its sides kept in proportion, and boxes taken back."""

import dataclasses
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.vision.pixels import Rgb

Boxes = NDArray[np.float32]
"""Boxes (N, 4): left, top, right, bottom in pixels."""


@dataclass(frozen=True, slots=True)
class Colours:
    """How a network sees an image: per channel, in its own `order`, (value - mean) / std of values of 0 to 255.

    The margins beside the image have the value `padding`. The defaults are those of YOLOv5 and its descendants.
    """

    order: Literal["rgb", "bgr"] = "rgb"
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    std: tuple[float, float, float] = (255.0, 255.0, 255.0)
    padding: float = 114.0


@dataclass(frozen=True, slots=True)
class Letterbox:
    """Where an image lies in the input: its size there, the margins before it, and its original size, all in pixels."""

    width_px: int
    height_px: int
    left_px: int
    top_px: int
    image_width_px: int
    image_height_px: int

    def in_image(self, boxes_xyxy: Boxes) -> NDArray[np.float64]:
        """Boxes of the input (N, 4) in pixels of the original image, cut off at its borders."""
        sizes = np.array([self.image_width_px, self.image_height_px] * 2, dtype=np.float64)
        scale = sizes / np.array([self.width_px, self.height_px] * 2)
        margin = np.array([self.left_px, self.top_px] * 2)
        boxes: NDArray[np.float64] = (boxes_xyxy - margin) * scale
        return np.clip(boxes, 0.0, sizes)


def fit(image_px: tuple[int, int], input_px: tuple[int, int]) -> Letterbox:
    """The letterbox of an image (height, width) in the middle of an input (height, width)."""
    (image_height, image_width), (height, width) = image_px, input_px
    sizes = [
        (max(1, round(image_height * ratio)), max(1, round(image_width * ratio)))
        for ratio in (height / image_height, width / image_width)
    ]
    # The larger of both fits where it only overlaps by what rounding takes off.
    inner_height, inner_width = max(size for size in sizes if size[0] <= height and size[1] <= width)
    left, top = (width - inner_width) // 2, (height - inner_height) // 2
    return Letterbox(inner_width, inner_height, left, top, image_width, image_height)


def fit_top_left(image_px: tuple[int, int], input_px: tuple[int, int]) -> Letterbox:
    """The letterbox of an image (height, width) at the top left of an input (height, width)."""
    return dataclasses.replace(fit(image_px, input_px), left_px=0, top_px=0)


def stretched(image_px: tuple[int, int], input_px: tuple[int, int]) -> Letterbox:
    """An image (height, width) that fills an input (height, width), its sides not kept in proportion."""
    (image_height, image_width), (height, width) = image_px, input_px
    return Letterbox(width, height, 0, 0, image_width, image_height)


def fitted_input(image_px: tuple[int, int], size_px: int, stride_px: int) -> tuple[int, int]:
    """The smallest input (height, width) in whole strides that holds an image whose longer side becomes `size_px`."""
    ratio = size_px / max(image_px)
    height, width = (max(1, -(-round(side * ratio) // stride_px)) * stride_px for side in image_px)
    return height, width


def tensor(
    image: Rgb, box: Letterbox, input_px: tuple[int, int], dtype: np.dtype[np.floating], colours: Colours
) -> NDArray[np.floating]:
    """The network's input (1, 3, height, width) of an image in its letterbox."""
    scaled = image
    if image.shape[:2] != (box.height_px, box.width_px):
        scaled = np.asarray(cv2.resize(image, (box.width_px, box.height_px), interpolation=cv2.INTER_LINEAR), np.uint8)
    whole = np.empty((1, 3, *input_px), dtype)
    rows = slice(box.top_px, box.top_px + box.height_px)
    columns = slice(box.left_px, box.left_px + box.width_px)
    planes = cv2.split(scaled)  # plane by plane is three times as fast as a transposed copy
    ordered = planes if colours.order == "rgb" else planes[::-1]
    for channel, (plane, mean, std) in enumerate(zip(ordered, colours.mean, colours.std, strict=True)):
        if (box.height_px, box.width_px) != input_px:
            whole[0, channel].fill((colours.padding - mean) / std)
        inner = whole[0, channel, rows, columns]
        if mean == 0:
            np.multiply(plane, np.float32(1 / std), out=inner, dtype=np.float32, casting="same_kind")
        else:
            inner[:] = (plane - np.float32(mean)) * np.float32(1 / std)
    return whole
