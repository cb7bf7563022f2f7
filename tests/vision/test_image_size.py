"""The size of an image from its header."""

import cv2
import numpy as np
import pytest
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.vision.image_size import image_size


def compressed(data: bytes) -> CompressedImage:
    return CompressedImage(1, "camera", "", data)


def encoded(kind: str) -> bytes:
    return bytes(cv2.imencode(kind, np.zeros((37, 61, 3), np.uint8))[1].tobytes())


@pytest.mark.parametrize("kind", [".jpg", ".png", ".bmp", ".webp"])
def test_every_kind_of_file_tells_its_size(kind: str) -> None:
    assert image_size(compressed(encoded(kind))) == (61, 37)


@pytest.mark.parametrize("kind", [".jpg", ".png"])
def test_the_header_is_enough(kind: str) -> None:
    data = encoded(kind)
    end = 24 if kind == ".png" else data.index(b"\xff\xc0") + 10
    assert image_size(compressed(data[:end])) == (61, 37)
    padded = data[:2] + b"\xff\xe1\x00\x06Exif\xff" + data[2:] if kind == ".jpg" else data
    assert image_size(compressed(padded)) == (61, 37)


def test_what_is_no_picture_has_no_size() -> None:
    assert image_size(compressed(b"")) is None
    assert image_size(compressed(b"\xff\xd8\xff\xe0\x00")) is None
    assert image_size(Image(1, "camera", 0, 0, "rgb8", False, 0, b"")) is None
    assert image_size(Image(1, "camera", 37, 61, "rgb8", False, 183, b"")) == (61, 37)
