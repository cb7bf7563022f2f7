"""A network tried out on images: what it is, what it finds, and how long it takes."""

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mcap_landmarks.locations import Location
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.vision.batching import images_at_once, takes_several
from mcap_landmarks.vision.config import DetectConfig
from mcap_landmarks.vision.detection import Found, Prepared, find, prepare, thresholds
from mcap_landmarks.vision.detector import Detector, read_detector
from mcap_landmarks.vision.onnx_session import open_session
from mcap_landmarks.vision.pixels import Rgb
from mcap_landmarks.vision.providers import settled

_RUNS = 7
"""Odd, so that the median is one of them; the slowest networks (1 s an image) then take some seconds."""


@dataclass(frozen=True, slots=True)
class Speed:
    """The median time of the network alone for an image, in `parts` of `input_px` (height, width)."""

    threads: int
    parts: int
    input_px: tuple[int, int]
    ms: float


class Trial:
    """A network that is tried out.

    Raises:
        ModelError: it is of no known family, or its metadata cannot be read.
        UsageError: the configuration does not fit the model.
    """

    def __init__(self, model: Location, names_file: Location | None, config: DetectConfig) -> None:
        self._model, self._names_file, self._config = model, names_file, settled(config)
        self.detector = self._opened(threads=config.threads)
        self._above = thresholds(self.detector, config)

    def runs_on(self) -> str:
        """What runs it, and how many images at once."""
        provider, at_once = self.detector.session.provider, images_at_once(self.detector, self._config.batch)
        if at_once > 1:
            return f"{provider}, {at_once} images at once"
        if provider == "cpu" or takes_several(self.detector):
            return f"{provider}, one image at a time"
        return f"{provider}, one image at a time; it takes several if its batch axis is free (yolo export dynamic=True)"

    def detections(self, rgb: Rgb) -> Detections:
        """What it finds in an image."""
        found = self.found(rgb)
        names = [self.detector.names[i] for i in found.class_ids.tolist()]
        options = tuple(((name, score),) for name, score in zip(names, found.scores.tolist(), strict=True))
        return Detections(0, "", ("",) * len(names), options, found.boxes_xyxy)

    def found(self, rgb: Rgb) -> Found:
        """What it finds in an image, by class id."""
        parts = prepare(rgb, self.detector, self._config)
        outputs = [self.detector.run(part.array) for part in parts]
        return find(outputs, parts, self.detector, self._above, self._config)

    def speeds(self, rgb: Rgb) -> list[Speed]:
        """How fast it runs on an image: with one thread, as `detect` runs it on each core, and with all of them."""
        return [self._speed(rgb, threads) for threads in dict.fromkeys((1, os.cpu_count() or 1))]

    def _speed(self, rgb: Rgb, threads: int) -> Speed:
        detector = self._opened(threads)
        parts = prepare(rgb, detector, self._config)
        _seconds(detector, parts)  # the first run allocates
        times_s = [_seconds(detector, parts) for _ in range(_RUNS)]
        return Speed(threads, len(parts), parts[0].input_px, 1e3 * float(np.median(times_s)))

    def _opened(self, threads: int) -> Detector:
        session = open_session(self._model, self._config.provider, threads)
        return read_detector(session, self._names_file, self._config)


def _seconds(detector: Detector, parts: Sequence[Prepared]) -> float:
    began = time.perf_counter()
    for part in parts:
        detector.run(part.array)
    return time.perf_counter() - began
