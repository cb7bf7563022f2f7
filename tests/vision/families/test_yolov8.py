"""YOLOv8 to 12: which outputs are recognised, and decoding against plain loops."""

from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.vision.detector import Detector
from numpy.typing import DTypeLike, NDArray

from tests.vision.families.answers import (
    CELLS,
    INPUT_PX,
    METADATA,
    assert_equal_to_plain,
    best,
    corners,
    found_in,
    opened,
)
from tests.vision.reference import Box

ULTRALYTICS = {**METADATA, "stride": "32", "description": "Ultralytics YOLO11n model", "end2end": "False"}


def head(cells: int = CELLS, dtype: DTypeLike = np.float32) -> NDArray[np.floating]:
    """Random boxes in pixels and scores [1, 4 + 3, cells]."""
    rng = np.random.default_rng(1)
    return np.concatenate([rng.uniform(4, 90, (1, 4, cells)), rng.uniform(0, 0.6, (1, 3, cells))], axis=1).astype(dtype)


def plain(output: NDArray[np.floating]) -> list[Box]:
    """One cell after the other."""
    found: list[Box] = []
    for cell in range(output.shape[2]):
        x, y, width, height, *scores = output[0, :, cell].astype(np.float32).tolist()
        class_id = best(scores)
        if class_id is not None:
            found.append((*corners(x, y, width, height), scores[class_id], class_id))
    return found


@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_every_cell_is_a_box(tmp_path: Path, dtype: DTypeLike) -> None:
    output = head(dtype=dtype)
    detector = opened(tmp_path, {"output0": output}, ULTRALYTICS)
    assert (detector.family.name, detector.dtype) == ("yolov8", dtype)
    assert_equal_to_plain(detector, plain(output))


@pytest.mark.parametrize("cells", [CELLS + 2, CELLS + 384])
def test_heads_of_four_strides(tmp_path: Path, cells: int) -> None:
    """For large objects (stride 64) and for small ones (stride 4)."""
    output = head(cells)
    assert_equal_to_plain(opened(tmp_path, {"output0": output}), plain(output))


def test_free_sides(tmp_path: Path) -> None:
    output = head()
    detector = opened(tmp_path, {"output0": output}, ULTRALYTICS, ("h", "w"))
    assert detector.layout.input_px == (None, None)
    assert_equal_to_plain(detector, plain(output))


def test_a_box_comes_back_to_the_image(tmp_path: Path) -> None:
    """The image of 96 x 48 lies in the middle, in margins of 8 above and below."""
    output = np.zeros((1, 7, CELLS), np.float32)
    output[0, :, 5] = 48, 32, 24, 12, 0, 0, 0.9
    detector: Detector = opened(tmp_path, {"output0": output})
    found = found_in(detector, (480, 960))
    np.testing.assert_allclose(found.boxes_xyxy, [[360, 180, 600, 300]])
    assert (found.class_ids.tolist(), found.scores.tolist()) == ([2], [np.float32(0.9)])
    assert detector.layout.input_px == INPUT_PX
