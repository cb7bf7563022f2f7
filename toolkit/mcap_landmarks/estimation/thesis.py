"""The thesis's position solver (Algorithm 6), as written: three range equations from a fixed initial guess."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import root

Array = NDArray[np.float64]


def solve_position(
    landmarks_xy: ArrayLike, range_m: ArrayLike, initial_guess_xy: Sequence[float] = (0.0, 0.0)
) -> Array:
    """Position (2,) at `range_m` (3,) from `landmarks_xy` (3, 2) by Levenberg-Marquardt, thesis section 4, Algorithm 6.

    It neither says whether it converged nor estimates heading and covariance. Its guess [k1, k2] is not printed there.
    """
    landmarks = np.asarray(landmarks_xy, dtype=np.float64)
    squared = np.asarray(range_m, dtype=np.float64) ** 2

    def equations(position: Array) -> Array:
        residual: Array = ((landmarks - position) ** 2).sum(axis=1) - squared
        return residual

    return np.asarray(root(equations, np.asarray(initial_guess_xy, dtype=np.float64), method="lm").x)
