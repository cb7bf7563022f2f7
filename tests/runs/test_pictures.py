"""Single images to look at."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap_landmarks.errors import UsageError
from mcap_landmarks.runs.pictures import demo_picture, read_picture


def test_a_picture_is_red_green_blue(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.full((2, 3, 3), (10, 20, 200), np.uint8))
    assert read_picture(tmp_path / "a.png")[0].tolist() == [[200, 20, 10]] * 3
    assert demo_picture().shape == (480, 640, 3)


def test_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    for name, content in (("text.png", b"no picture"), ("empty.png", b"")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(UsageError, match="not a picture that can be read; give a JPEG or PNG file"):
            read_picture(tmp_path / name)
    with pytest.raises(UsageError, match=r"no\.png: cannot be read \(No such file"):
        read_picture(tmp_path / "no.png")
