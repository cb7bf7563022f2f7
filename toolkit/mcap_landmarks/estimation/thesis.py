"""The thesis's position solver (Algorithm 6), as written: three range equations from a fixed initial guess."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import root

from mcap_landmarks.estimation.termination import Termination

Array = NDArray[np.float64]


class ThesisPosition(NamedTuple):
    """A position (2,) in the map frame, and how MINPACK's `lmdif` ended, whose criteria are relative changes of 1.5e-8.

    Its iterations are evaluations of the equations, its cost their squared residuals in m^4. A converged solution is a
    local minimum, seldom one of cost zero: three noisy ranges have no common point.
    """

    position_xy: Array
    termination: Termination


def solve_position(
    landmarks_xy: ArrayLike, range_m: ArrayLike, initial_guess_xy: Sequence[float] = (0.0, 0.0)
) -> ThesisPosition:
    """Position at `range_m` (3,) from `landmarks_xy` (3, 2) by Levenberg-Marquardt, thesis section 4, Algorithm 6.

    It estimates neither heading nor covariance, and the thesis takes what comes out, converged or not. Its guess
    [k1, k2] is not printed there.
    """
    landmarks = np.asarray(landmarks_xy, dtype=np.float64)
    squared = np.asarray(range_m, dtype=np.float64) ** 2

    def equations(position: Array) -> Array:
        residual: Array = ((landmarks - position) ** 2).sum(axis=1) - squared
        return residual

    found = root(equations, np.asarray(initial_guess_xy, dtype=np.float64), method="lm")
    cost = float((np.asarray(found.fun) ** 2).sum())
    return ThesisPosition(np.asarray(found.x), Termination(bool(found.success), int(found.nfev), cost))
