"""Levenberg-Marquardt on a batch of pose problems: thousands of small ones at once, with their covariances."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation import robust
from mcap_landmarks.estimation.linearise import Linearised, Observations, Poses, choose, linearise, select
from mcap_landmarks.estimation.symmetric import factor3, inverse3, solve3

Array = NDArray[np.float64]
Prepare = Callable[[slice | NDArray[np.int64]], tuple[Observations, Poses, NDArray[np.bool_]]]

# Observations solved together: of 24 Ki, an array of float64 is 192 KiB and the dozen in use stay in a core's L2 cache.
_CHUNK = 24576
# A step shorter than a thousandth of a standard deviation is the last one: its squared Mahalanobis length.
_CONVERGED = 1e-6
# Marquardt's (1963) first damping; a step that is damped more is short whatever is left to go.
_FIRST_DAMPING = 1e-3
# Of made-up poses with three landmarks 99.98 % converge within so many steps, 81 % with robust weights; the others are
# gathered and solved apart.
_QUICK = 4
# Costs that differ by no more than rounding are equal, else the last steps would be refused.
_ROUNDING = 1e-9, 1e-12


@dataclass(frozen=True, slots=True)
class PoseSolutions:
    """B solved poses: `map_from_base` (B, 3) as x, y, heading, covariance (B, 3, 3) in the map frame, and the fit.

    `chi2` (B,) sums the squared Mahalanobis distances `observation_chi2` (B, K), `dof` (B,) is what it should be near,
    `weights` (B, K) what the robust loss left of each observation (0 where there is none). Where geometry or number of
    observations leaves the pose open, the covariance's diagonal is infinite.

    `converged` (B,) says whether the last step was shorter than a thousandth of a standard deviation and the pose not
    open, `iterations` (B,) how many steps it took, `cost` (B,) the sum of losses there: `chi2`, if the loss is not
    robust.
    """

    map_from_base: Array
    covariance: Array
    chi2: Array
    dof: NDArray[np.int64]
    weights: Array
    observation_chi2: Array
    converged: NDArray[np.bool_]
    iterations: NDArray[np.int64]
    cost: Array

    @classmethod
    def empty(cls, count: int, width: int) -> Self:
        """Room for so many problems of so many observations."""
        return cls(
            np.empty((count, 3)),
            np.empty((count, 3, 3)),
            np.empty(count),
            np.empty(count, dtype=np.int64),
            np.empty((count, width)),
            np.empty((count, width)),
            np.empty(count, dtype=np.bool_),
            np.empty(count, dtype=np.int64),
            np.empty(count),
        )


def solve_batch(
    prepare: Prepare, count: int, width: int, *, numbers: int, robust_dof: float | None, max_iterations: int
) -> PoseSolutions:
    """Solve `count` problems of up to `width` observations of one or two `numbers` each (range, bearing).

    `prepare` gives some problems' observations (K, B), start poses, and which observations (K, B) count.
    """
    out = PoseSolutions.empty(count, width)
    rows, size = np.arange(count), max(_CHUNK // max(width, 1), 1)
    for iterations in (_QUICK, max_iterations):
        for start in range(0, len(rows), size):
            part = rows[start : start + size] if len(rows) < count else slice(start, start + size)
            with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is left out
                observed, start_poses, used = prepare(part)
            poses, converged, steps = _minimise(observed, start_poses, robust_dof, iterations)
            fit = linearise(observed, poses, robust_dof, newton=False)
            _write(out, part, poses, converged, fit, used, robust_dof)
            out.iterations[part] = steps
            out.dof[part] = np.maximum(numbers * used.sum(axis=0) - 3, 0)
        rows = np.flatnonzero(~out.converged)
    return out


def _minimise(
    observed: Observations, start: Poses, robust_dof: float | None, max_iterations: int
) -> tuple[Poses, NDArray[np.bool_], NDArray[np.int64]]:
    """Levenberg-Marquardt on all problems, undamped while steps help; poses, who converged, steps. Solved ones go."""
    result = Poses(*(a.copy() for a in start))
    converged = np.zeros(len(start.x), dtype=np.bool_)
    steps = np.full(len(start.x), max_iterations, dtype=np.int64)
    columns = np.arange(len(start.x))
    poses, fit, damping = start, linearise(observed, start, robust_dof), np.zeros(len(columns))
    for iteration in range(1, max_iterations + 1):
        factor = factor3(fit.information, damping)
        step = solve3(factor, fit.right)
        trial = poses.moved(step)
        gain = sum(s * r for s, r in zip(step, fit.right, strict=True))
        last = (gain < _CONVERGED) & (damping <= _FIRST_DAMPING) & (factor.regular | (damping > 0))
        for whole, part in zip(result, trial, strict=True):
            whole[columns] = part
        converged[columns] = last & factor.regular
        steps[columns[last]] = iteration
        if last.all():
            return result, converged, steps
        if last.any():
            columns, damping, regular = columns[~last], damping[~last], factor.regular[~last]
            observed, fit = select(observed, ~last), select(fit, ~last)
            poses, trial = select(poses, ~last), select(trial, ~last)
        else:
            regular = factor.regular
        trial_fit = linearise(observed, trial, robust_dof)
        better = trial_fit.cost <= fit.cost * (1 + _ROUNDING[0]) + _ROUNDING[1]
        if not better.all():
            trial, trial_fit = choose(better, trial, poses), choose(better, trial_fit, fit)
        poses, fit = trial, trial_fit
        damping = np.where(better & regular, damping / 10, np.maximum(damping * 10, _FIRST_DAMPING))
    for whole, part in zip(result, poses, strict=True):
        whole[columns] = part
    return result, converged, steps


def _write(
    out: PoseSolutions,
    part: slice | NDArray[np.int64],
    poses: Poses,
    converged: NDArray[np.bool_],
    fit: Linearised,
    used: NDArray[np.bool_],
    robust_dof: float | None,
) -> None:
    """Fill one chunk of the result."""
    factor = factor3(fit.information)
    out.map_from_base[part] = np.stack([poses.x, poses.y, np.arctan2(poses.sine, poses.cosine)], axis=-1)
    out.covariance[part] = inverse3(factor)
    out.chi2[part] = fit.chi2.sum(axis=0)
    out.observation_chi2[part] = fit.chi2.T
    out.weights[part] = used.T
    out.converged[part] = converged & factor.regular
    out.cost[part] = fit.cost
    if robust_dof is not None:
        out.weights[part] *= robust.student_weight(fit.chi2.T, robust_dof)
        factors = [robust.student_covariance_factor(robust_dof, min(1.5 / max(k, 1), 1)) for k in range(len(used) + 1)]
        out.covariance[part] *= np.array(factors)[used.sum(axis=0), None, None]
