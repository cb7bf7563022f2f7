"""Every kind of image becomes the same picture."""

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.vision.pixels import ENCODINGS, rgb_from_message
from numpy.typing import NDArray

COLOURS = np.array([[200, 40, 60], [30, 190, 80], [50, 70, 210], [120, 120, 120]], dtype=np.uint8)
BAYER = {"rggb": (0, 1, 1, 2), "bggr": (2, 1, 1, 0), "gbrg": (1, 2, 0, 1), "grbg": (1, 0, 2, 1)}


def picture() -> NDArray[np.uint8]:
    """Four blocks of one colour each, 32 x 48."""
    blocks = COLOURS.reshape(2, 2, 3).repeat(16, axis=0)
    return np.ascontiguousarray(blocks.repeat(24, axis=1))


def grey(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), np.uint8)


def yuv(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Y, Cb, Cr of ITU-R BT.601, limited range, (H, W, 3)."""
    matrix = np.array([[65.481, 128.553, 24.966], [-37.797, -74.203, 112.0], [112.0, -93.786, -18.214]]) / 255
    return np.round(rgb @ matrix.T + (16, 128, 128)).astype(np.uint8)


def packed(rgb: NDArray[np.uint8], order: tuple[int, int]) -> NDArray[np.uint8]:
    """Two bytes per pixel: luma at `order[0]`, chroma of pairs in turns at `order[1]`."""
    whole = yuv(rgb)
    out = np.empty((*rgb.shape[:2], 2), np.uint8)
    out[:, :, order[0]] = whole[:, :, 0]
    out[:, 0::2, order[1]], out[:, 1::2, order[1]] = whole[:, 0::2, 1], whole[:, 0::2, 2]
    return out.reshape(len(rgb), -1)


def planes(rgb: NDArray[np.uint8], step: int, order: slice) -> NDArray[np.uint8]:
    """Luma rows, then rows of chroma pairs of every `step`-th pixel."""
    whole = yuv(rgb)
    chroma = np.ascontiguousarray(whole[::step, ::step, 1:][:, :, order])
    return np.vstack([whole[:, :, 0], chroma.reshape(-1, rgb.shape[1])])


def mosaic(rgb: NDArray[np.uint8], pattern: tuple[int, int, int, int]) -> NDArray[np.uint8]:
    out = np.empty(rgb.shape[:2], np.uint8)
    for i, channel in enumerate(pattern):
        out[i // 2 :: 2, i % 2 :: 2] = rgb[i // 2 :: 2, i % 2 :: 2, channel]
    return out


def alpha(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.dstack([rgb, np.full(rgb.shape[:2], 7, np.uint8)])


def rows_of(encoding: str, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The picture's samples in an encoding of 8 bits, (rows, ...)."""
    makers: dict[str, Callable[[], NDArray[np.uint8]]] = {
        "rgb8": lambda: rgb,
        "rgba8": lambda: alpha(rgb),
        "bgr8": lambda: rgb[:, :, ::-1],
        "8UC3": lambda: rgb[:, :, ::-1],
        "bgra8": lambda: alpha(rgb[:, :, ::-1]),
        "8UC4": lambda: alpha(rgb[:, :, ::-1]),
        "mono8": lambda: grey(rgb),
        "8UC1": lambda: grey(rgb),
        "yuv422": lambda: packed(rgb, (1, 0)),
        "uyvy": lambda: packed(rgb, (1, 0)),
        "yuv422_yuy2": lambda: packed(rgb, (0, 1)),
        "yuyv": lambda: packed(rgb, (0, 1)),
        "nv12": lambda: planes(rgb, 2, slice(None)),
        "nv21": lambda: planes(rgb, 2, slice(None, None, -1)),
        "nv24": lambda: planes(rgb, 1, slice(None)),
        **{f"bayer_{name}8": (lambda pattern=pattern: mosaic(rgb, pattern)) for name, pattern in BAYER.items()},
    }
    return np.ascontiguousarray(makers[encoding]())


def image(
    encoding: str, rows: NDArray[Any], size: tuple[int, int] = (32, 48), pad: int = 0, big: bool = False
) -> Image:
    flat = rows.reshape(len(rows), -1)
    lines = np.ascontiguousarray(flat).view(np.uint8)
    lines = np.hstack([lines, np.full((len(lines), pad), 99, np.uint8)])
    return Image(1, "camera", *size, encoding, big, lines.shape[1], lines.tobytes())


def expected(encoding: str) -> NDArray[np.uint8]:
    rgb = picture()
    return np.dstack([grey(rgb)] * 3) if encoding in {"mono8", "mono16", "8UC1", "16UC1"} else rgb


def assert_same(found: NDArray[Any], wanted: NDArray[Any]) -> None:
    """Equal within 3 of 255 inside the blocks, where interpolation mixes nothing."""
    assert found.shape == wanted.shape
    assert found.dtype == np.uint8
    inside = np.zeros(found.shape[:2], bool)
    for v in (0, 16):
        for u in (0, 24):
            inside[v + 3 : v + 13, u + 3 : u + 21] = True
    assert np.abs(found.astype(int) - wanted)[inside].max() <= 3


@pytest.mark.parametrize("encoding", [name for name in ENCODINGS if "16" not in name])
def test_encodings_of_8_bits(encoding: str) -> None:
    rows = rows_of(encoding, picture())
    assert_same(rgb_from_message(image(encoding, rows)), expected(encoding))
    if encoding != "nv24":  # its second plane has longer rows, whose padding is nowhere defined
        assert_same(rgb_from_message(image(encoding, rows, pad=5)), expected(encoding))


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("encoding", [name for name in ENCODINGS if "16" in name])
def test_encodings_of_16_bits(encoding: str, big: bool) -> None:
    rows = rows_of(encoding.replace("16", "8"), picture()).astype(">u2" if big else "<u2") * 257
    message = image(encoding, rows.astype(">u2" if big else "<u2"), big=big, pad=2)
    assert_same(rgb_from_message(message), expected(encoding))


@pytest.mark.parametrize("ending", [".jpg", ".png", ".bmp", ".tiff", ".webp", ".ppm", ".jp2"])
def test_compressed_kinds(ending: str) -> None:
    if not cv2.haveImageWriter(ending):
        pytest.skip(f"this OpenCV cannot write {ending}")
    quality = [cv2.IMWRITE_JPEG_QUALITY, 98, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
    data = cv2.imencode(ending, picture()[:, :, ::-1], quality if ending == ".jpg" else [])[1].tobytes()
    assert_same(rgb_from_message(CompressedImage(1, "camera", "whatever", data)), picture())


def test_grey_and_deep_and_transparent_files() -> None:
    deep = cv2.imencode(".png", picture()[:, :, ::-1].astype(np.uint16) * 257)[1].tobytes()
    assert_same(rgb_from_message(CompressedImage(1, "camera", "png", deep)), picture())
    clear = cv2.imencode(".png", alpha(picture()[:, :, ::-1]))[1].tobytes()
    assert_same(rgb_from_message(CompressedImage(1, "camera", "png", clear)), picture())
    flat = cv2.imencode(".png", grey(picture()))[1].tobytes()
    assert_same(rgb_from_message(CompressedImage(1, "camera", "png", flat)), expected("mono8"))


@pytest.mark.parametrize("kind", ["bgr8; jpeg compressed bgr8", "rgb8; png compressed bgr8", "rgb8; png compressed"])
def test_formats_of_image_transport(kind: str) -> None:
    """The file's own colours count, whatever the encoding was that it was made of."""
    data = cv2.imencode(".png", picture()[:, :, ::-1])[1].tobytes()
    assert_same(rgb_from_message(CompressedImage(1, "camera", kind, data)), picture())


@pytest.mark.parametrize("deep", [1, 257])
def test_deep_grey_and_mosaics_in_files(deep: int) -> None:
    """image_transport stores them as they are: a mosaic is a grey file."""
    bits = 8 if deep == 1 else 16
    kind = np.uint8 if deep == 1 else np.uint16
    flat = cv2.imencode(".png", grey(picture()).astype(kind) * deep)[1].tobytes()
    assert_same(rgb_from_message(CompressedImage(1, "camera", f"mono{bits}; png compressed ", flat)), expected("mono8"))
    for name, pattern in BAYER.items():
        raw = cv2.imencode(".png", mosaic(picture(), pattern).astype(kind) * deep)[1].tobytes()
        message = CompressedImage(1, "camera", f"bayer_{name}{bits}; png compressed ", raw)
        assert_same(rgb_from_message(message), picture())
    colour = cv2.imencode(".png", picture()[:, :, ::-1])[1].tobytes()
    made = CompressedImage(1, "camera", f"bayer_rggb{bits}; jpeg compressed bgr8", colour)
    assert_same(rgb_from_message(made), picture())


def refusal(message: Image | CompressedImage) -> str:
    with pytest.raises(MessageError) as error:
        rgb_from_message(message)
    return str(error.value)


def test_damaged_files_are_refused() -> None:
    data = cv2.imencode(".jpg", picture())[1].tobytes()
    assert "cut short" in refusal(CompressedImage(1, "camera", "jpeg", data[:-200]))
    assert "no image" in refusal(CompressedImage(1, "camera", "jpeg", b"hello"))
    assert "empty" in refusal(CompressedImage(1, "camera", "jpeg", b""))
    assert "of a video" in refusal(CompressedImage(1, "camera", "h264", b"\0\0\0\1"))
    assert "depth" in refusal(CompressedImage(1, "camera", "16UC1; compressedDepth png", data))


def test_rows_that_do_not_fit_are_refused() -> None:
    rows = rows_of("rgb8", picture())
    assert "4600 bytes are no 48 x 32 image" in refusal(Image(1, "c", 32, 48, "rgb8", False, 144, bytes(4600)))
    assert "rows of 100 bytes" in refusal(Image(1, "c", 32, 48, "rgb8", False, 100, rows.tobytes()))
    assert "0 x 0" in refusal(Image(1, "c", 0, 0, "rgb8", False, 0, b""))
    line = refusal(Image(1, "c", 32, 48, "32FC1", False, 192, bytes(32 * 192)))
    assert "'32FC1' is no picture but depth" in line
    assert "--image" in line
    assert "bayer_rggb8" in refusal(Image(1, "c", 32, 48, "64FC2", False, 192, bytes(32 * 192)))
    assert "cannot be decoded" in refusal(image("nv21", rows_of("nv21", picture())[:, :47], size=(32, 47)))


def test_the_last_row_needs_no_padding() -> None:
    padded = image("rgb8", rows_of("rgb8", picture()), pad=6)
    short = Image(1, "c", 32, 48, "rgb8", False, padded.step, padded.data[:-6])
    assert (rgb_from_message(short) == picture()).all()
