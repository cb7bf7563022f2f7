"""Pictures with boxes."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap_landmarks.errors import UsageError
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.report.box_pictures import check_picture, column, with_boxes, write_picture

DARK = np.full((100, 200, 3), 40, np.uint8)


def detections(*box: float) -> Detections:
    return Detections(0, "", ("",), ((("person", 0.5),),), np.array([box]))


def test_a_box_is_drawn_on_its_border_and_leaves_the_rest() -> None:
    drawn = with_boxes(DARK, detections(50, 40, 150, 90))
    changed = (drawn != DARK).any(axis=2)
    assert (DARK == 40).all()  # a copy
    assert changed[60, 50]
    assert changed[90, 100]
    assert not changed[55:85, 60:140].any()
    assert changed[30:40, 52:70].any()  # the label, above it
    assert not changed[:, :40].any()


def test_a_label_stays_in_the_image() -> None:
    drawn = with_boxes(DARK, detections(190, 0, 200, 50))
    assert (drawn[:14, 100:190] != DARK[:14, 100:190]).any()


def test_pictures_stand_below_each_other() -> None:
    stacked = column([DARK, DARK[:30, :50]])
    assert stacked.shape == (130, 200, 3)
    assert (stacked[100:, 50:] == 255).all()


def test_a_picture_is_written_as_its_name_says(tmp_path: Path) -> None:
    red = np.zeros((4, 4, 3), np.uint8)
    red[..., 0] = 255
    write_picture(tmp_path / "a.png", red)
    assert cv2.imread(str(tmp_path / "a.png"))[0, 0].tolist() == [0, 0, 255]  # OpenCV's order is blue first
    with pytest.raises(UsageError, match=r"a\.gif: the name does not tell the format; use \.png, \.jpg, \.jpeg"):
        check_picture(tmp_path / "a.gif")
