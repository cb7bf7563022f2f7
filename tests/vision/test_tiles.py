"""Tiles: how images are cut, and that an object seen in several of them stays one box, whole."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.detection import Found, find, prepare
from mcap_landmarks.vision.detector import read_detector
from mcap_landmarks.vision.onnx_session import open_session
from mcap_landmarks.vision.tiles import OVERLAP, Tile, merged, tiles_of

from tests.vision.networks import answering

KITTI, CAMERA, NUSCENES = (375, 1242), (480, 640), (1208, 1920)
CAR, PERSON = 0, 1


def grid(image_px: tuple[int, int], input_px: tuple[int, int], wanted: int | str) -> tuple[int, int]:
    """Rows and columns of tiles beside the whole image."""
    _, *tiles = tiles_of(image_px, input_px, "auto" if wanted == "auto" else int(wanted))
    return len({tile.top_px for tile in tiles}), len({tile.left_px for tile in tiles})


def test_how_many_tiles_there_are() -> None:
    square = (640, 640)
    assert tiles_of(CAMERA, square, "auto") == tiles_of(CAMERA, square, 1) == (Tile(0, 0, 640, 480),)
    assert grid(KITTI, square, "auto") == (1, 3)
    assert grid(KITTI, (416, 416), "auto") == (1, 4)
    assert grid(NUSCENES, square, "auto") == (3, 4)
    assert grid((3000, 4000), square, "auto") == (4, 4)
    assert grid(KITTI, square, 2) == (1, 2)
    assert grid(NUSCENES, square, 3) == (2, 3)
    assert grid((1920, 1208), square, 3) == (3, 2)
    assert grid((1200, 1600), (480, 640), 3) == (3, 3)


sides = st.integers(300, 4000)


@given(sides, sides, st.sampled_from([1, 2, 3, 5, "auto"]))
def test_tiles_cover_the_image_and_overlap(height: int, width: int, wanted: int | str) -> None:
    whole, *tiles = tiles_of((height, width), (640, 640), "auto" if wanted == "auto" else int(wanted))
    assert whole == Tile(0, 0, width, height)
    spans = {(tile.left_px, tile.width_px) for tile in tiles}, {(tile.top_px, tile.height_px) for tile in tiles}
    for side, each in zip((width, height), spans, strict=True):
        ordered = sorted(each) or [(0, side)]
        assert ordered[0][0] == 0
        assert sum(ordered[-1]) == side
        for (start, length), (following, _) in pairwise(ordered):
            assert start + length - following == pytest.approx(OVERLAP * length, abs=2)


TILES = (Tile(0, 0, 200, 100), Tile(0, 0, 110, 100), Tile(90, 0, 110, 100))


def kept(*found: tuple[int, tuple[float, float, float, float], float, int]) -> list[int]:
    """Which of the boxes (tile, corners, score, class) stay."""
    tile_ids, boxes, scores, class_ids = (np.array(part) for part in zip(*found, strict=True))
    return merged(boxes.astype(float), scores.astype(np.float32), class_ids, tile_ids, TILES, 0.45, 300).tolist()


def test_a_box_seen_in_several_tiles_is_the_best_one() -> None:
    assert kept(
        (0, (95, 20, 106, 40), 0.5, CAR), (1, (95, 20, 107, 40), 0.7, CAR), (2, (95, 21, 106, 40), 0.6, CAR)
    ) == [1]
    assert kept((0, (20, 20, 40, 40), 0.5, CAR), (1, (20, 20, 40, 40), 0.7, PERSON)) == [1, 0]


def test_a_box_that_its_tile_cuts_off_goes() -> None:
    """At an inner border; the image's own cut objects in all tiles, and stay."""
    assert kept(
        (1, (80, 20, 110, 40), 0.9, CAR), (2, (90, 20, 130, 40), 0.8, CAR), (0, (80, 20, 130, 40), 0.3, CAR)
    ) == [2]
    assert kept((1, (0, 20, 40, 99.5), 0.9, CAR)) == [0]


def test_a_part_beside_the_whole_object_goes() -> None:
    """Which reaches out of the tile that saw the part, though the part ends before the border."""
    assert kept((0, (40, 20, 160, 60), 0.4, CAR), (1, (42, 20, 105, 60), 0.9, CAR)) == [0]
    assert kept((0, (40, 20, 160, 60), 0.4, CAR), (1, (42, 20, 105, 60), 0.9, PERSON)) == [1, 0]
    assert kept((0, (10, 20, 100, 80), 0.4, CAR), (1, (50, 20, 80, 40), 0.9, CAR)) == [1, 0]  # one before the other


def test_nothing_in_any_tile() -> None:
    empty = np.zeros((0, 4)), np.zeros(0, np.float32), np.zeros(0, np.intp), np.zeros(0, np.intp)
    assert len(merged(*empty, TILES, 0.45, 300)) == 0


def seen(path: Path, tiles: int, image_px: tuple[int, int]) -> Found:
    config = DetectConfig(tiles=tiles)
    detector = read_detector(open_session(path, threads=1), None, config)
    prepared = prepare(np.zeros((*image_px, 3), np.uint8), detector, config)
    outputs = [detector.run(part.array) for part in prepared]
    return find(outputs, prepared, detector, np.full(2, 0.25, np.float32), config)


def test_boxes_of_tiles_lie_where_they_are_in_the_image(tmp_path: Path) -> None:
    """A network that always sees a box around the middle of its input sees one in the middle of each tile."""
    rows = np.zeros((1, 100, 6), np.float32)
    rows[0, 0] = 28, 28, 36, 36, 0.9, 0
    path = answering(tmp_path / "m.onnx", {"output0": rows}, {"names": "['car', 'person']", "family": "nms_in_graph"})
    assert seen(path, 1, (225, 720)).boxes_xyxy.tolist() == [[315, 67.5, 405, 157.5]]
    found = seen(path, 2, (225, 720)).boxes_xyxy.tolist()  # of two tiles of 400 the second begins at 320
    assert sorted(found) == [[175, 87.5, 225, 137.5], [315, 67.5, 405, 157.5], [495, 87.5, 545, 137.5]]
