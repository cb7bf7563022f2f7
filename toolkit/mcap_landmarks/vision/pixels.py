"""ROS images of every kind that OpenCV can turn into RGB."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mcap_landmarks import memory
from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.messages.video import codec_of
from mcap_landmarks.vision.image_header import size_in_header

Rgb = NDArray[np.uint8]
"""An image (H, W, 3), 8 bits each of red, green and blue."""

_JPEG_START, _JPEG_END = b"\xff\xd8", b"\xff\xd9"
_TRAILER_BYTES = 1024  # some cameras pad a JPEG after its end


@dataclass(frozen=True, slots=True)
class _Encoding:
    """How an encoding lies in memory: samples per pixel, bytes per sample, and OpenCV's conversion (None: RGB already).

    `rows` per image row is above 1 where a second plane follows the first.
    """

    channels: int
    sample_bytes: int
    conversion: int | None
    rows: float = 1.0


def _of_bits(bits: int) -> dict[str, _Encoding]:
    size = bits // 8
    return {
        f"rgb{bits}": _Encoding(3, size, None),
        f"rgba{bits}": _Encoding(4, size, cv2.COLOR_RGBA2RGB),
        f"bgr{bits}": _Encoding(3, size, cv2.COLOR_BGR2RGB),
        f"bgra{bits}": _Encoding(4, size, cv2.COLOR_BGRA2RGB),
        f"mono{bits}": _Encoding(1, size, cv2.COLOR_GRAY2RGB),
        f"{bits}UC1": _Encoding(1, size, cv2.COLOR_GRAY2RGB),
        f"{bits}UC3": _Encoding(3, size, cv2.COLOR_BGR2RGB),
        f"{bits}UC4": _Encoding(4, size, cv2.COLOR_BGRA2RGB),
        f"bayer_rggb{bits}": _Encoding(1, size, cv2.COLOR_BayerRGGB2RGB),
        f"bayer_bggr{bits}": _Encoding(1, size, cv2.COLOR_BayerBGGR2RGB),
        f"bayer_gbrg{bits}": _Encoding(1, size, cv2.COLOR_BayerGBRG2RGB),
        f"bayer_grbg{bits}": _Encoding(1, size, cv2.COLOR_BayerGRBG2RGB),
    }


_ENCODINGS: Mapping[str, _Encoding] = {
    **_of_bits(8),
    **_of_bits(16),
    "yuv422": _Encoding(2, 1, cv2.COLOR_YUV2RGB_UYVY),
    "uyvy": _Encoding(2, 1, cv2.COLOR_YUV2RGB_UYVY),
    "yuv422_yuy2": _Encoding(2, 1, cv2.COLOR_YUV2RGB_YUYV),
    "yuyv": _Encoding(2, 1, cv2.COLOR_YUV2RGB_YUYV),
    "nv12": _Encoding(1, 1, cv2.COLOR_YUV2RGB_NV12, rows=1.5),
    "nv21": _Encoding(1, 1, cv2.COLOR_YUV2RGB_NV21, rows=1.5),
    "nv24": _Encoding(1, 1, cv2.COLOR_YUV2RGB_NV12, rows=3.0),
}
_DEPTH = ("32FC1", "64FC1")
"""Encodings of distances: REP 118 has the first."""
ENCODINGS = tuple(sorted(_ENCODINGS))
"""The encodings of `sensor_msgs/Image` that can be read; generic ones (`8UC3`) count as OpenCV's BGR."""


def rgb_from_message(message: Image | CompressedImage) -> Rgb:
    """The picture of a message.

    Raises:
        MessageError: the data are damaged or cut short, or no colour or grey picture.
    """
    try:
        return _from_file(message) if isinstance(message, CompressedImage) else _from_rows(message)
    except cv2.error as error:
        raise MessageError(f"the image cannot be decoded: {error.err or error}") from error


def _from_file(message: CompressedImage) -> Rgb:
    data = message.data
    if "compressedDepth" in message.format:
        raise MessageError(f"{message.format!r} is a depth image; choose a colour topic with --image")
    if codec_of(message.format):
        raise MessageError(f"{message.format!r} is a packet of a video, no picture without those before it")
    if not data:
        raise MessageError("the image is empty")
    if data.startswith(_JPEG_START) and _JPEG_END not in data[-_TRAILER_BYTES:]:
        raise MessageError(f"the JPEG of {len(data)} bytes is cut short")
    _check_size(data)
    # CameraInfo speaks of pixels as they are stored, so an orientation tag must not turn them.
    mosaic = _ENCODINGS.get(message.format.partition(";")[0].strip())
    mosaic = mosaic if message.format.startswith("bayer_") else None
    kind = cv2.IMREAD_UNCHANGED if mosaic else cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION
    image = cv2.imdecode(np.frombuffer(data, np.uint8), kind)
    if image is None:
        raise MessageError(f"{len(data)} bytes of format {message.format!r} are no image that OpenCV reads")
    if mosaic is not None:  # image_transport stores what is no colour image as it is, in grey
        conversion = mosaic.conversion if image.ndim == 2 else None
        image = cv2.cvtColor(image, cv2.COLOR_BGR2RGB if conversion is None else conversion)
    return _in_8_bits(image)


def _check_size(data: bytes) -> None:
    """Refuse what would decode to more than its bytes can stand for."""
    width, height = size_in_header(data) or (0, 0)
    if problem := memory.excess(width * height * 3, len(data)):
        raise MessageError(f"the image of {width} x {height} pixels is not decoded: {problem}")


def _from_rows(message: Image) -> Rgb:
    encoding = _ENCODINGS.get(message.encoding)
    if message.encoding in _DEPTH:
        raise MessageError(f"encoding {message.encoding!r} is no picture but depth; choose a colour topic with --image")
    if encoding is None:
        raise MessageError(f"encoding {message.encoding!r} is no picture; readable are {', '.join(ENCODINGS)}")
    samples = _samples(message, encoding)
    if message.encoding == "nv24":
        samples = _nv12_from_nv24(samples, message.height_px)
    if encoding.conversion is not None:
        samples = cv2.cvtColor(samples, encoding.conversion)
    return _in_8_bits(samples)


def _in_8_bits(samples: NDArray[Any]) -> Rgb:
    if samples.dtype == np.uint16:
        samples = cv2.convertScaleAbs(samples, alpha=255 / 65535)
    return np.ascontiguousarray(samples, np.uint8)


def _samples(message: Image, encoding: _Encoding) -> NDArray[Any]:
    """The samples (rows, width) or (rows, width, channels) without the padding at the ends of rows."""
    used, rows = message.width_px * encoding.channels * encoding.sample_bytes, int(message.height_px * encoding.rows)
    step = message.step or used
    if not (rows and used) or step < used or len(message.data) < step * (rows - 1) + used:
        raise MessageError(
            f"{len(message.data)} bytes are no {message.width_px} x {message.height_px} image in {message.encoding} "
            f"with rows of {message.step} bytes"
        )
    lines = np.lib.stride_tricks.as_strided(np.frombuffer(message.data, np.uint8), (rows, used), (step, 1))
    if encoding.sample_bytes == 1:
        samples = np.ascontiguousarray(lines)
    else:
        sample = np.dtype(np.uint16).newbyteorder(">" if message.is_bigendian else "<")
        samples = np.ascontiguousarray(lines).view(sample).astype(np.uint16)
    return samples if encoding.channels == 1 else samples.reshape(rows, message.width_px, encoding.channels)


def _nv12_from_nv24(samples: NDArray[Any], height_px: int) -> NDArray[Any]:
    """OpenCV knows chroma at half the size only: luma (H, W), then pairs (H, W, 2) that become (H / 2, W / 2, 2)."""
    width_px = samples.shape[1]
    chroma = samples[height_px:].reshape(height_px, width_px, 2)
    halved = cv2.resize(chroma, (width_px // 2, height_px // 2), interpolation=cv2.INTER_AREA)
    return np.vstack([samples[:height_px], halved.reshape(height_px // 2, width_px)])
