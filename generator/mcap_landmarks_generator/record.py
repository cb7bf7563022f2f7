"""Makes a recording of a scenario: simulate, render, write."""

import importlib.metadata
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.manifest import GENERATE, RUN, Manifest
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Stamped

from mcap_landmarks_generator.camera import ImageJob
from mcap_landmarks_generator.checks import Staged
from mcap_landmarks_generator.loading import effective
from mcap_landmarks_generator.rendering import Darkroom, Messages
from mcap_landmarks_generator.simulation import Simulation

_JOBS_PER_WORKER = 4
_MOST_WAITING = 20_000
"""Messages that wait for an image before them: some minutes of a log without images."""


@dataclass(frozen=True, slots=True)
class Summary:
    """What was recorded: messages by topic, simulated time, and when the robot ran into which object."""

    messages: dict[str, int]
    simulated_s: float
    collisions: tuple[tuple[float, str], ...]


def record(staged: Staged, path: Path, workers: int = 1, progress: Callable[[int], None] = lambda _: None) -> Summary:
    """Run a scenario and write what its sensors saw; the same scenario gives the same bytes, however many workers.

    `progress` gets each full simulated second.

    Raises:
        ToolkitError: the robot got stuck, or the file cannot be written; no file is left then.
    """
    if not staged.scenario.trajectory.waypoints:
        raise ToolkitError(f"{staged.name}: trajectory.waypoints is empty; one with stop_s records a standing robot")
    simulation = Simulation(staged)
    with create_recording(path, {RUN: manifest(staged).entries()}) as writer, Darkroom(staged, workers) as darkroom:
        for message in _in_order(simulation.run(progress), darkroom, workers):
            writer.add(message)
        counts = dict(writer.counts)
    collisions = tuple((time_ns / 1e9, name) for time_ns, name in simulation.collisions)
    return Summary(counts, simulation.end_ns / 1e9, collisions)


def manifest(staged: Staged) -> Manifest:
    """What the recording is made from: every value of the scenario, the seed, the versions that shape its bytes."""
    versions = {name: importlib.metadata.version(name) for name in ("pybullet", "opencv-python-headless", "numpy")}
    return Manifest(
        GENERATE,
        config={"scenario": effective(staged.scenario)},
        options={"scenario": staged.name, "versions": versions},
        seed=staged.scenario.seed,
    )


def _in_order(events: Iterator[Stamped | ImageJob], darkroom: Darkroom, workers: int) -> Iterator[Stamped]:
    """Messages in the order of the events, while the images behind the first one are being rendered."""
    waiting: deque[Stamped | ImageJob] = deque()
    for event in events:
        waiting.append(event)
        if isinstance(event, ImageJob):
            darkroom.hand_in(event)
        too_many = darkroom.waiting > _JOBS_PER_WORKER * workers or len(waiting) > _MOST_WAITING
        while waiting and (isinstance(waiting[0], Stamped) or darkroom.is_ready() or too_many):
            yield from _messages(waiting.popleft(), darkroom)
            too_many = False
    for first in waiting:
        yield from _messages(first, darkroom)


def _messages(event: Stamped | ImageJob, darkroom: Darkroom) -> Messages:
    return (event,) if isinstance(event, Stamped) else darkroom.pick_up()
