"""The robot's recent past, so that a sensor can measure at any time between two steps of physics."""

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator.robot import RobotState
from mcap_landmarks_generator.world import STEP_NS

Floats = NDArray[np.float64]
Times = NDArray[np.int64]

_ROWS = 4096
_POSITION, _ORIENTATION, _WHEELS, _STANDING = slice(0, 3), slice(3, 7), slice(7, 9), 9


class History:
    """States of the robot at every step of the last 16 s, by time in ns after the start."""

    def __init__(self) -> None:
        self._rows = np.zeros((_ROWS, 10))
        self._count = 0

    @property
    def end_ns(self) -> int:
        """Time of the latest state."""
        return (self._count - 1) * STEP_NS

    def append(self, state: RobotState, standing: bool) -> None:
        """Add the state one step after the latest; `standing` says that the robot waits at a stop."""
        row = self._rows[self._count % _ROWS]
        row[_POSITION], row[_ORIENTATION], row[_WHEELS] = state.position_m, state.orientation_xyzw, state.wheels_rad
        row[_STANDING] = standing
        self._count += 1

    def positions(self, times_ns: Times) -> Floats:
        """Positions (N, 3) of base_footprint in the world."""
        return self._between(times_ns)[:, _POSITION]

    def orientations(self, times_ns: Times) -> Floats:
        """Rotations world from base_footprint as unit quaternions (N, 4)."""
        quaternions = self._between(times_ns)[:, _ORIENTATION]
        unit: Floats = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
        return unit

    def wheels(self, times_ns: Times) -> Floats:
        """Angles (N, 2) of the left and right wheel."""
        return self._between(times_ns)[:, _WHEELS]

    def standing(self, time_ns: int) -> bool:
        """Whether the robot was waiting at a stop."""
        return bool(self._rows[time_ns // STEP_NS % _ROWS, _STANDING])

    def _between(self, times_ns: Times) -> Floats:
        """Rows (N, 10), interpolated; of two opposite quaternions the second is turned over."""
        step, rest = np.divmod(times_ns, STEP_NS)
        before, after = self._rows[step % _ROWS], self._rows[np.minimum(step + 1, self._count - 1) % _ROWS].copy()
        opposite = (before[:, _ORIENTATION] * after[:, _ORIENTATION]).sum(axis=1) < 0
        after[opposite, _ORIENTATION] *= -1
        mixed: Floats = before + (after - before) * (rest / STEP_NS)[:, None]
        return mixed


def rotate(quaternions_xyzw: Floats, vectors: Floats) -> Floats:
    """Vectors (N, 3) turned by unit quaternions (N, 4)."""
    axis, scalar = quaternions_xyzw[:, :3], quaternions_xyzw[:, 3:]
    doubled = 2 * _cross(axis, vectors)
    turned: Floats = vectors + scalar * doubled + _cross(axis, doubled)
    return turned


def _cross(first: Floats, second: Floats) -> Floats:
    """Cross products (N, 3), at a fifth of what NumPy's takes for a few vectors."""
    product: Floats = first[:, [1, 2, 0]] * second[:, [2, 0, 1]] - first[:, [2, 0, 1]] * second[:, [1, 2, 0]]
    return product
