"""Renders images in this process or in several workers: the pictures are the same."""

import contextlib
import signal
from collections import deque
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Self

import cv2
from mcap_landmarks.channels import TRUTH_DETECTIONS
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.stage import Stamped

from mcap_landmarks_generator.camera import ImageJob
from mcap_landmarks_generator.checks import Staged
from mcap_landmarks_generator.distortion import Lens
from mcap_landmarks_generator.lens_renderer import LensRenderer, has_plain_lens
from mcap_landmarks_generator.mounts import Mount, mounts
from mcap_landmarks_generator.optics import Optics
from mcap_landmarks_generator.renderer import Rendered, Renderer
from mcap_landmarks_generator.visibility import Drawn, true_detections

Messages = tuple[Stamped, ...]

_DIED = "a rendering worker died, perhaps for lack of memory; try --workers 1"


class Photographer:
    """Turns jobs into messages: the image, its CameraInfo and its true detections."""

    def __init__(self, staged: Staged) -> None:
        cv2.setNumThreads(1)
        self._cameras = [_Studio(staged, mount) for mount in mounts(staged.scenario)]

    def take(self, job: ImageJob) -> Messages:
        """The messages of one image."""
        return self._cameras[job.camera].take(job)


class _Studio:
    """Takes the images of one camera."""

    def __init__(self, staged: Staged, mount: Mount) -> None:
        self._mount, self._lens = mount, Lens.of(mount.spec)
        self._optics = Optics(mount.spec, self._lens.focal_px, mount.seed)
        scenario = mount.scenario(staged.scenario)
        if has_plain_lens(mount.spec):
            renderer = Renderer(scenario, staged.objects)
            self._drawn_by: Drawn = renderer
            self._draw: Callable[[ImageJob], Rendered] = lambda job: renderer.draw(job.view)
        else:
            bending = LensRenderer(scenario, staged.objects)
            self._drawn_by = bending
            self._draw = lambda job: bending.draw(job.view, job.readout)

    def take(self, job: ImageJob) -> Messages:
        """The messages of one image."""
        mount, stamp_ns = self._mount, job.stamp_ns
        rendered = self._draw(job)
        detections = true_detections(rendered, self._drawn_by, job.view, stamp_ns, mount.frame_id)
        exposed = self._optics.expose(rendered.image, job.index, job.turn_radps, job.view.time_s)
        image = CompressedImage(stamp_ns, mount.frame_id, "jpeg", self._optics.jpeg(exposed))
        return (
            Stamped(mount.image, job.log_time_ns, image),
            Stamped(mount.info, job.log_time_ns, self._lens.info(stamp_ns, mount.frame_id)),
            Stamped(TRUTH_DETECTIONS, job.log_time_ns, detections),
        )


class Darkroom:
    """Where jobs are handed in and their messages picked up in order; a context manager that ends its workers.

    Jobs go to the workers in turn, each over its own pipe: nothing is shared that a killed worker could leave locked.
    """

    def __init__(self, staged: Staged, workers: int) -> None:
        """One worker is this process itself."""
        self._handed_in = self._picked_up = 0
        self._done: deque[Messages] = deque()
        self._photographer = Photographer(staged) if workers == 1 else None
        context = get_context("spawn")
        self._workers: list[tuple[SpawnProcess, Connection]] = []
        for _ in range(workers if workers > 1 else 0):
            ours, theirs = context.Pipe()
            process = context.Process(target=_work, args=(staged, theirs), daemon=True)
            process.start()
            theirs.close()
            self._workers.append((process, ours))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process, pipe in self._workers:
            pipe.close()
            process.terminate()
            process.join()

    @property
    def waiting(self) -> int:
        """Jobs handed in and not picked up yet."""
        return self._handed_in - self._picked_up

    def hand_in(self, job: ImageJob) -> None:
        """Have an image rendered.

        Raises:
            ToolkitError: a worker died.
        """
        if self._photographer is not None:
            self._done.append(self._photographer.take(job))
        else:
            try:
                self._pipe(self._handed_in).send(job)
            except OSError as error:
                raise ToolkitError(_DIED) from error
        self._handed_in += 1

    def is_ready(self) -> bool:
        """Whether the next messages can be picked up without waiting."""
        return bool(self._done) or (self.waiting > 0 and self._pipe(self._picked_up).poll())

    def pick_up(self) -> Messages:
        """The messages of the job that waits longest, once they are there.

        Raises:
            ToolkitError: a worker died.
        """
        if self._photographer is not None:
            messages = self._done.popleft()
        else:
            try:
                messages = self._pipe(self._picked_up).recv()
            except (EOFError, OSError) as error:
                raise ToolkitError(_DIED) from error
        self._picked_up += 1
        return messages

    def _pipe(self, number: int) -> "Connection":
        return self._workers[number % len(self._workers)][1]


def _work(staged: Staged, pipe: "Connection") -> None:
    """Take images until nobody asks for more."""
    # An interrupt and the terminal's end reach every process of a terminal; the first one ends the others.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    photographer = Photographer(staged)
    with contextlib.suppress(EOFError, OSError):
        while True:
            pipe.send(photographer.take(pipe.recv()))
