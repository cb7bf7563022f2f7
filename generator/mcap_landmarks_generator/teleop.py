"""Driving by hand: what each key does, as in TurtleBot3's teleop_keyboard (thesis, section 3.3)."""

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.trajectory import COMMAND_NS, Command, Motion

Key = Literal["w", "x", "a", "d", "s", " ", "q"]
KEYS: tuple[Key, ...] = get_args(Key)

_SPEED_STEP_MPS, _TURN_STEP_RADPS = 0.01, 0.1
_DECIMALS = 4
"""Of what is asked for, so that a hundred steps up and down end at zero."""


class KeySteering:
    """Steers as keys say: w and x are faster and slower, a and d turn left and right, s and space stop, q ends.

    `speed_mps` and `turn_radps` are what is asked for; `pressed` are all keys, with the time in ns after the start of
    the command that they count for.
    """

    def __init__(self, speed_factor: float) -> None:
        self.done = False
        self.speed_mps = self.turn_radps = 0.0
        self.time_ns = 0
        self.pressed: list[tuple[int, Key]] = []
        self._motion = Motion(speed_factor)

    def press(self, key: Key) -> None:
        """Take a key; it counts from the next command on."""
        self.pressed.append((self.time_ns, key))
        if key == "q":
            self.done = True
        elif key in {"s", " "}:
            self.speed_mps = self.turn_radps = 0.0
        elif key in {"w", "x"}:
            step = _SPEED_STEP_MPS if key == "w" else -_SPEED_STEP_MPS
            self.speed_mps = _within(self.speed_mps + step, self._motion.most_mps)
        else:
            step = _TURN_STEP_RADPS if key == "a" else -_TURN_STEP_RADPS
            self.turn_radps = _within(self.turn_radps + step, self._motion.most_radps)

    def command(self, _pose: NDArray[np.float64]) -> Command:
        """See `Steering`. The robot stands once nothing is asked for and the wheels have come to rest."""
        self.time_ns += COMMAND_NS
        asked = (self.speed_mps, self.turn_radps, self._motion.speed_mps, self._motion.turn_radps)
        return self._motion.towards(self.speed_mps, self.turn_radps, standing=not any(asked))


def _within(value: float, most: float) -> float:
    return round(min(max(value, -most), most), _DECIMALS)
