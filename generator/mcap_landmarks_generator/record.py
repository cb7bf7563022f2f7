"""Makes a recording of a scenario: simulate, render, write."""

import importlib.metadata
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import GENERATE, RUN, Manifest
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Stamped

from mcap_landmarks_generator.camera import ImageJob
from mcap_landmarks_generator.checks import Staged
from mcap_landmarks_generator.loading import effective
from mcap_landmarks_generator.rendering import Darkroom, Messages
from mcap_landmarks_generator.simulation import Simulation
from mcap_landmarks_generator.trajectory import Steering

TELEOP = "teleop"
_JOBS_PER_WORKER = 4
_MOST_WAITING = 20_000
"""Messages that wait for an image before them: some minutes of a log without images."""


@dataclass(frozen=True, slots=True)
class Summary:
    """What was recorded: messages by topic, simulated time, and when the robot ran into which object."""

    messages: dict[str, int]
    simulated_s: float
    collisions: tuple[tuple[float, str], ...]


class ByHand(Steering, Protocol):
    """Steers by keys, and sees each message once it is written."""

    @property
    def pressed(self) -> Sequence[tuple[int, str]]:
        """The keys so far, each with its time in ns after the start."""

    def see(self, message: Stamped) -> None:
        """Take a message that was written."""


def record(
    staged: Staged,
    path: Location,
    workers: int = 1,
    progress: Callable[[int], None] = lambda _: None,
    by_hand: ByHand | None = None,
) -> Summary:
    """Run a scenario and write what its sensors saw; the same scenario gives the same bytes, however many workers.

    `progress` gets each full simulated second. A drive `by_hand` gives the same bytes for the same keys.

    Raises:
        ToolkitError: the robot got stuck, or the file cannot be written; no file is left then.
    """
    if by_hand is None and not staged.scenario.trajectory.waypoints:
        raise ToolkitError(f"{staged.name}: trajectory.waypoints is empty; one with stop_s records a standing robot")
    simulation = Simulation(staged, by_hand)
    with create_recording(path, {RUN: manifest(staged).entries()}) as writer, Darkroom(staged, workers) as darkroom:
        for message in _in_order(simulation.run(progress), darkroom, workers):
            writer.add(message)
            if by_hand is not None:
                by_hand.see(message)
        counts = dict(writer.counts)
        if by_hand is not None:
            writer.metadata[RUN] = manifest(staged, by_hand.pressed).entries()
    collisions = tuple((time_ns / 1e9, name) for time_ns, name in simulation.collisions)
    return Summary(counts, simulation.end_ns / 1e9, collisions)


def manifest(staged: Staged, pressed: Sequence[tuple[int, str]] | None = None) -> Manifest:
    """What the recording is made from: every value of the scenario, the seed, the versions that shape its bytes, and
    the keys `pressed` with their times in ns after the start where it was driven by hand."""
    versions = {name: importlib.metadata.version(name) for name in ("pybullet", "opencv-python-headless", "numpy")}
    keys = {} if pressed is None else {"keys": [list(press) for press in pressed]}
    return Manifest(
        GENERATE if pressed is None else TELEOP,
        config={"scenario": effective(staged.scenario)},
        options={"scenario": staged.name, "versions": versions, **keys},
        seed=staged.scenario.seed,
        generated=pressed is not None,
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
