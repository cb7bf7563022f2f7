"""Renders images in this process or in several workers: the pictures are the same."""

from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from multiprocessing import get_context
from typing import Self

import cv2

from generator.camera import ImageJob, Intrinsics
from generator.checks import Staged
from generator.optics import Optics
from generator.renderer import Renderer
from generator.robot import OPTICAL_FRAME
from generator.visibility import true_detections
from toolkit.channels import CAMERA_IMAGE, CAMERA_INFO, TRUTH_DETECTIONS
from toolkit.errors import ToolkitError
from toolkit.messages.images import CompressedImage
from toolkit.stage import Stamped

Messages = tuple[Stamped, ...]


class Photographer:
    """Turns jobs into messages: the image, its CameraInfo and its true detections."""

    def __init__(self, staged: Staged) -> None:
        cv2.setNumThreads(1)
        spec, seed = staged.scenario.camera, staged.scenario.seed
        self._intrinsics = Intrinsics.of(spec)
        self._optics = Optics(spec, self._intrinsics.focal_px, seed)
        self._stack = ExitStack()
        self._renderer = self._stack.enter_context(Renderer(staged.scenario, staged.objects))

    def close(self) -> None:
        """Disconnect from PyBullet."""
        self._stack.close()

    def take(self, job: ImageJob) -> Messages:
        """The messages of one image."""
        rendered = self._renderer.draw(job.view)
        detections = true_detections(rendered, self._renderer, job.view, job.stamp_ns)
        exposed = self._optics.expose(rendered.image, job.index, job.turn_radps)
        image = CompressedImage(job.stamp_ns, OPTICAL_FRAME, "jpeg", self._optics.jpeg(exposed))
        info = self._intrinsics.info(job.stamp_ns)
        return (
            Stamped(CAMERA_IMAGE, job.log_time_ns, image),
            Stamped(CAMERA_INFO, job.log_time_ns, info),
            Stamped(TRUTH_DETECTIONS, job.log_time_ns, detections),
        )


class Darkroom:
    """Where jobs are handed in and their messages picked up; a context manager that ends its workers."""

    def __init__(self, staged: Staged, workers: int) -> None:
        self._stack = ExitStack()
        self._take: Callable[[ImageJob], Messages] | None = None
        if workers == 1:
            photographer = Photographer(staged)
            self._stack.callback(photographer.close)
            self._take = photographer.take
        else:
            self._pool = ProcessPoolExecutor(workers, get_context("spawn"), _start_worker, (staged,))
            self._stack.callback(self._pool.shutdown, cancel_futures=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def submit(self, job: ImageJob) -> "Future[Messages]":
        """Hand in a job; without workers it is done at once."""
        if self._take is None:
            return self._pool.submit(_take_in_worker, job)
        done: Future[Messages] = Future()
        done.set_result(self._take(job))
        return done


def picked_up(future: "Future[Messages]") -> Messages:
    """The messages of a job, waiting for them.

    Raises:
        ToolkitError: a worker died.
    """
    try:
        return future.result()
    except BrokenProcessPool as error:
        raise ToolkitError("a rendering worker was killed, perhaps for memory; try --workers 1") from error


_photographers: list[Photographer] = []


def _start_worker(staged: Staged) -> None:
    _photographers.append(Photographer(staged))


def _take_in_worker(job: ImageJob) -> Messages:
    return _photographers[0].take(job)
