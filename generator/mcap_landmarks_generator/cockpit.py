"""What a driver by hand sees: the speeds, the world from above, what the LiDAR and the detector see."""

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from mcap_landmarks.channels import SCAN
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.stage import Stamped
from numpy.typing import NDArray

from mcap_landmarks_generator.checks import Staged
from mcap_landmarks_generator.teleop import KEYS, KeySteering
from mcap_landmarks_generator.top_view import echoes, letters, nearest, top_view
from mcap_landmarks_generator.trajectory import Command

Floats = NDArray[np.float64]
Look = Callable[[CompressedImage], Detections]

_DRAWN_EVERY = 12
"""In commands: five pictures in a second, which a slow line can carry."""
_MOST_BEHIND_S = 0.25
"""Where the simulation falls behind by more, time goes on from there: nobody can drive a robot that catches up."""
_SIZE, _METRES_PER_ROW = (79, 15), 0.5
_HELP = "w/x faster, slower   a/d left, right   s or space stop   q end"


class Terminal(Protocol):
    """Where keys come from and pictures go to; `is_over` once it is lost, or somebody says to end."""

    @property
    def is_over(self) -> bool:
        """Whether the drive has to end."""

    def keys(self, wait_s: float) -> str:
        """The keys that were pressed, after so many seconds without one."""

    def draw(self, lines: Sequence[str]) -> None:
        """Show lines in place of those before."""


@dataclass(slots=True)
class _Seen:
    """The latest of what the sensors gave."""

    scan: LaserScan | None = None
    detections: str = ""


class Cockpit:
    """Steers the robot by the keys of a terminal, in the time of the clock on the wall, and draws what it sees."""

    def __init__(self, staged: Staged, terminal: Terminal, title: str, look: Look | None) -> None:
        self._staged, self._terminal, self._title = staged, terminal, title
        self._steering = KeySteering(staged.scenario.robot.speed_factor)
        self._letters = letters(staged.objects)
        self._seen, self._lookout = _Seen(), _Lookout(look) if look is not None else None
        self._commands = 0
        self._began_s = self._behind_s = 0.0

    @property
    def done(self) -> bool:
        """See `Steering`."""
        return self._steering.done or self._terminal.is_over

    @property
    def pressed(self) -> Sequence[tuple[int, str]]:
        """See `ByHand`."""
        return self._steering.pressed

    def command(self, pose: Floats) -> Command:
        """See `Steering`; waits until it is time, and takes the keys that come meanwhile."""
        if self._commands == 0:
            self._began_s = time.monotonic()
        due_s = self._began_s + self._steering.time_ns / 1e9
        while True:
            for key in self._terminal.keys(due_s - time.monotonic()):
                known = next((one for one in KEYS if one == key.lower()), None)
                if known is not None:
                    self._steering.press(known)
            late_s = time.monotonic() - due_s
            if late_s >= 0 or self.done:
                break
        if late_s > _MOST_BEHIND_S:
            self._began_s += late_s
            self._behind_s += late_s
        if self._commands % _DRAWN_EVERY == 0:
            self._terminal.draw(self._picture(pose))
        self._commands += 1
        return self._steering.command(pose)

    def see(self, message: Stamped) -> None:
        """See `ByHand`."""
        if message.channel is SCAN and isinstance(message.message, LaserScan):
            self._seen.scan = message.message
        if self._lookout is not None and isinstance(message.message, CompressedImage):
            self._lookout.offer(message.message)

    def _picture(self, pose: Floats) -> list[str]:
        steering, scan, seconds = self._steering, self._seen.scan, self._steering.time_ns / 1e9
        by_letter: dict[str, list[Floats]] = {}
        for placed in self._staged.objects:
            by_letter.setdefault(self._letters[placed.asset.name], []).append(placed.pose_at(seconds)[:2])
        objects = {letter: np.array(points) for letter, points in by_letter.items()}
        hits = echoes(scan, pose) if scan is not None else np.zeros((0, 2))
        shortest = nearest(scan) if scan is not None else {}
        ranges = [
            f"{where} {f'{range_m:.2f} m' if np.isfinite(range_m) else '-'}" for where, range_m in shortest.items()
        ]
        slow = f", {self._behind_s:.0f} s behind the clock" if self._behind_s >= 1 else ""
        return [
            f"{self._title}   {seconds:.0f} s{slow}",
            _HELP,
            f"currently:   linear velocity {steering.speed_mps:.2f}   angular velocity {steering.turn_radps:.1f}",
            f"LiDAR:   {'   '.join(ranges)}",
            *([f"detections:   {self._lookout.found}"] if self._lookout is not None else []),
            *top_view(pose, objects, hits, _METRES_PER_ROW, _SIZE),
            f". LiDAR   {'   '.join(f'{letter} {name}' for name, letter in self._letters.items())}",
        ]


class _Lookout:
    """Looks at the latest image in a thread of its own, as often as the detector can; `found` is what, in words."""

    def __init__(self, look: Look) -> None:
        self.found = ""
        self._look, self._busy = look, threading.Lock()

    def offer(self, image: CompressedImage) -> None:
        """Look at an image, unless another one is being looked at."""
        if self._busy.acquire(blocking=False):
            threading.Thread(target=self._run, args=(image,), daemon=True).start()

    def _run(self, image: CompressedImage) -> None:
        try:
            detections = self._look(image)
            best = [hypotheses[0] for hypotheses in detections.hypotheses]
            self.found = ", ".join(f"{name} {score:.2f}" for name, score in best) or "none"
        except ToolkitError as error:
            self.found = f"error: {error}"
        finally:
            self._busy.release()
