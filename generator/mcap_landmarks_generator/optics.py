"""What lens, shutter and sensor do to a rendered image."""

import cv2
import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.randomness import Stream, draws
from mcap_landmarks_generator.sensor_specs import CameraSpec

Image = NDArray[np.uint8]

Floats = NDArray[np.float64]

_NOISE_MARGIN_PX = 64
_HUNT_PERIODS_S = (1.7, 4.3)
"""Periods of the swings of automatic exposure and white balance, which take a second or so to settle."""
_SPECK = 1 / 30
_SPECK_SHADE = 0.5
"""Radius of a speck of dirt as a share of the image's width, and the light it takes in its middle."""


class Optics:
    """Blur, exposure, noise and JPEG of one camera; each image's draws depend on the seed and its index only."""

    def __init__(self, spec: CameraSpec, focal_px: float, seed: int) -> None:
        self._spec, self._focal_px, self._seed = spec, focal_px, seed
        # Every image takes its noise from another place of one large field, which is much faster than drawing anew.
        size = (spec.height_px + _NOISE_MARGIN_PX, spec.width_px + _NOISE_MARGIN_PX, 3)
        noise = draws(seed, Stream.IMAGE_NOISE).standard_normal(size, dtype=np.float32) * spec.noise
        self._noise = np.rint(noise).astype(np.int16)
        self._lens = _lens(spec, seed)
        self._phases = draws(seed, Stream.HUNT).uniform(0, 2 * np.pi, (2, len(_HUNT_PERIODS_S)))

    def expose(self, image: Image, index: int, turn_radps: float, time_s: float = 0.0) -> Image:
        """The image (H, W, 3) as the sensor gives it, taken at a time after the start while the camera turned at
        `turn_radps`."""
        spec = self._spec
        rng = draws(self._seed, Stream.IMAGE, index)
        smear_px = abs(turn_radps) * spec.exposure_s * self._focal_px
        if smear_px >= 1:
            image = _smear(image, smear_px)
        if spec.blur_px > 0:
            image = cv2.GaussianBlur(image, (0, 0), spec.blur_px).astype(np.uint8)
        if self._lens is not None:
            image = cv2.multiply(image, self._lens, dtype=cv2.CV_8U).astype(np.uint8)
        gain = max(0.0, spec.exposure * (1 + spec.exposure_jitter * float(rng.normal())))
        gains = gain * self._swings(time_s)
        top, left = rng.integers(0, _NOISE_MARGIN_PX, 2)
        noise = self._noise[top : top + spec.height_px, left : left + spec.width_px]
        curves = np.minimum(np.arange(256)[:, None] * gains, 255).astype(np.uint8)
        bright = cv2.LUT(image, curves[None])
        return np.asarray(cv2.add(bright, noise, dtype=cv2.CV_8U), np.uint8)

    def _swings(self, time_s: float) -> Floats:
        """Gains (3,) of red, green and blue at a time after the start."""
        turns = 2 * np.pi * time_s / np.array(_HUNT_PERIODS_S)
        light, warmth = np.sin(turns + self._phases).mean(axis=1) * (
            self._spec.exposure_hunt,
            self._spec.white_balance_hunt,
        )
        swings: Floats = (1 + light) * np.array([1 + warmth, 1.0, 1 - warmth])
        return swings

    def jpeg(self, image: Image) -> bytes:
        """The bytes of a JPEG file of an RGB image (H, W, 3)."""
        quality = [cv2.IMWRITE_JPEG_QUALITY, self._spec.jpeg_quality]
        _, data = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), quality)
        return data.tobytes()

    def developed(self, image: Image) -> Image:
        """An RGB image (H, W, 3) as it looks after JPEG."""
        decoded = np.asarray(cv2.imdecode(np.frombuffer(self.jpeg(image), np.uint8), cv2.IMREAD_COLOR), np.uint8)
        return np.asarray(cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB), np.uint8)


def _lens(spec: CameraSpec, seed: int) -> NDArray[np.float32] | None:
    """The share (H, W, 3) of light that the lens lets through to each pixel; None if that is all."""
    if not spec.vignetting and not spec.dirt:
        return None
    height, width = spec.height_px, spec.width_px
    y, x = np.mgrid[:height, :width].astype(np.float64)
    corner = np.hypot(width, height) / 2
    through = 1 - spec.vignetting * ((x - width / 2) ** 2 + (y - height / 2) ** 2) / corner**2
    rng = draws(seed, Stream.LENS)
    for centre_x, centre_y, size in rng.uniform((0, 0, 0.5), (width, height, 1.5), (spec.dirt, 3)):
        away = np.hypot(x - centre_x, y - centre_y) / (size * _SPECK * width)
        through *= 1 - _SPECK_SHADE * np.exp(-(away**2))
    return np.repeat(through[..., None], 3, axis=2).astype(np.float32)


def _smear(image: Image, width_px: float) -> Image:
    """Box filter along the rows, its width not necessarily whole."""
    half = (width_px - 1) / 2
    side = int(np.ceil(half))
    kernel = np.ones(2 * side + 1, np.float32)
    if side:
        kernel[[0, -1]] = 1 - (side - half)
    kernel /= kernel.sum()
    return cv2.sepFilter2D(image, -1, kernel, np.ones(1, np.float32)).astype(np.uint8)
