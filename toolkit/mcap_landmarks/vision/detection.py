"""One image through a detector: into its input, and its outputs to boxes in the image."""

import dataclasses
import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.errors import UsageError
from mcap_landmarks.vision.config import USUAL_CONFIDENCE, DetectConfig
from mcap_landmarks.vision.detector import Detector
from mcap_landmarks.vision.letterbox import Letterbox, fitted_input, tensor
from mcap_landmarks.vision.nms import suppress
from mcap_landmarks.vision.pixels import Rgb
from mcap_landmarks.vision.tiles import Tile, merged, tiles_of


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """An image (H, W, 3) on its way through a network, or a part of it: where it lies in the input (1, 3, height,
    width)."""

    tile: Tile
    letterbox: Letterbox
    array: NDArray[np.floating]

    @property
    def input_px(self) -> tuple[int, int]:
        """Height and width of the input."""
        height, width = self.array.shape[2:]
        return height, width


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """N boxes in pixels of the original image: boxes_xyxy (N, 4), scores (N,), class_ids (N,), best first."""

    boxes_xyxy: NDArray[np.float64]
    scores: NDArray[np.float32]
    class_ids: NDArray[np.intp]


def thresholds(detector: Detector, config: DetectConfig) -> NDArray[np.float32]:
    """The threshold of every class (classes,), infinite for those that are not asked for.

    Raises:
        UsageError: the configuration names a class that the model does not know.
    """
    for name in (*config.classes, *config.class_confidence):
        if name not in detector.names:
            near = difflib.get_close_matches(name, detector.names, n=1)
            hint = f"did you mean {near[0]}?" if near else f"it knows {', '.join(detector.names)}"
            raise UsageError(f"{detector.path} detects no {name}; {hint}")
    own = detector.confidence if config.confidence is None else {}
    usual = USUAL_CONFIDENCE if config.confidence is None else config.confidence
    by_class = {**dict.fromkeys(detector.names, usual), **own, **config.class_confidence}
    wanted = config.classes or detector.names
    return np.array([by_class[name] if name in wanted else np.inf for name in detector.names], dtype=np.float32)


def input_size(detector: Detector, image_px: tuple[int, int], config: DetectConfig) -> tuple[int, int]:
    """The input (height, width) for an image (height, width): the model's, and as configured where that is free."""
    sides = image_px if config.shape == "fitted" else (1, 1)
    height, width = fitted_input(sides, config.size_px, detector.layout.stride_px)
    return detector.layout.input_px[0] or height, detector.layout.input_px[1] or width


def prepare(rgb: Rgb, detector: Detector, config: DetectConfig) -> tuple[Prepared, ...]:
    """An image as the detector takes it: the whole, and then the tiles of it that are configured."""
    image_px = rgb.shape[0], rgb.shape[1]
    free = input_size(detector, (1, 1), dataclasses.replace(config, shape="square"))
    return tuple(_prepared(rgb, tile, detector, config) for tile in tiles_of(image_px, free, config.tiles))


def _prepared(rgb: Rgb, tile: Tile, detector: Detector, config: DetectConfig) -> Prepared:
    part = rgb[tile.top_px : tile.top_px + tile.height_px, tile.left_px : tile.left_px + tile.width_px]
    size_px = tile.height_px, tile.width_px
    input_px = input_size(detector, size_px, config)
    letterbox = detector.layout.place(size_px, input_px)
    return Prepared(tile, letterbox, tensor(part, letterbox, input_px, detector.dtype, detector.layout.colours))


def find(
    outputs: Sequence[list[NDArray[Any]]],
    prepared: Sequence[Prepared],
    detector: Detector,
    above: NDArray[np.float32],
    config: DetectConfig,
) -> Found:
    """What the network found in one image, of its outputs for each of its parts; `above` are the `thresholds`.

    Raises:
        ModelError: the outputs have other shapes than those of the model's family.
    """
    parts = [_found_in(*each, detector, above, config) for each in zip(outputs, prepared, strict=True)]
    if len(parts) == 1:
        return parts[0]
    boxes = np.concatenate([part.boxes_xyxy for part in parts])
    scores = np.concatenate([part.scores for part in parts])
    class_ids = np.concatenate([part.class_ids for part in parts])
    tile_ids = np.repeat(np.arange(len(parts)), [len(part.scores) for part in parts])
    tiles = [part.tile for part in prepared]
    best = merged(boxes, scores, class_ids, tile_ids, tiles, config.iou, config.max_detections)
    return Found(boxes[best], scores[best], class_ids[best])


def _found_in(
    outputs: list[NDArray[Any]],
    part: Prepared,
    detector: Detector,
    above: NDArray[np.float32],
    config: DetectConfig,
) -> Found:
    found = detector.candidates(outputs, part.input_px, above)
    if detector.family.needs_nms:
        best = suppress(found.boxes_xyxy, found.scores, found.class_ids, config.iou, config.max_detections)
    else:
        best = np.argsort(-found.scores, kind="stable")[: config.max_detections]
    found = found.take(best)
    boxes = part.letterbox.in_image(found.boxes_xyxy)
    seen = (boxes[:, 2:] > boxes[:, :2]).all(axis=1)  # a box in the margins is nothing
    corner = np.array([part.tile.left_px, part.tile.top_px] * 2)
    return Found(boxes[seen] + corner, found.scores[seen], found.class_ids[seen])
