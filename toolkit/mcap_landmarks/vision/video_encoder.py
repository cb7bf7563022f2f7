"""Pictures to a video with PyAV: H.264 in MP4, the same bytes for the same pictures."""

import contextlib
import importlib
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.vision.pixels import Rgb
from mcap_landmarks.vision.video_decoder import INSTALL

_OPTIONS = {"crf": "20", "preset": "veryfast"}
"""A quality at which edges of text stay sharp, at a speed that does not hold up the drawing."""


@contextlib.contextmanager
def create_video(path: Path, size: tuple[int, int], fps: Fraction) -> Iterator[Callable[[Rgb], None]]:
    """Give what writes pictures (H, W, 3) of a `size` of W, H pixels, both even, as the video `path`.

    One thread encodes, and no clock or version goes into the file, so that the bytes are the same.

    Raises:
        RecordingError: PyAV is not installed, its FFmpeg cannot encode H.264, or the file cannot be written.
    """
    try:
        av = importlib.import_module("av")
    except ImportError as error:
        raise RecordingError(f"a video is written with PyAV, which is not installed; {INSTALL}") from error
    if "libx264" not in av.codecs_available:
        raise RecordingError(f"this PyAV cannot encode H.264 (libx264); {INSTALL}")
    with av.open(str(path), "w", format="mp4", container_options={"fflags": "+bitexact"}) as container:
        stream = container.add_stream("libx264", rate=fps, options=_OPTIONS)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        stream.codec_context.thread_count = 1
        stream.codec_context.time_base = 1 / fps

        def add(picture: Rgb) -> None:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")))

        yield add
        container.mux(stream.encode(None))
