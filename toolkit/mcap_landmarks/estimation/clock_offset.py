"""How far the clock of odometry is from a sensor's: the lag at which both turn alike."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation.robust import student_loss, student_weight
from mcap_landmarks.geometry.se2 import Array

WIDEST_LAG_S = 2.0
"""Messages farther apart are never associated (`time_association.WINDOW_NS`); clocks farther apart show there."""

_GRID_S = 0.02
"""Lags are tried this close together: a tenth of the shortest turns that robots make, which are as wide as the peak."""
_GAP_NS = 2 * 10**9
"""Headings are not interpolated over longer gaps (`odometry_track.WIDEST_GAP_NS`)."""
_LEAST_TURNS = 20
"""Fewer turns than this do not tell their own noise."""
_DOF = 4.0
"""Degrees of freedom of the Student-t: wheels slip, and matching errs now and then by a lot."""
_LEAST_NOISE_RAD = 1e-3
"""No turn is measured better: a fifth of the beams' spacing of a fine LiDAR."""
_TELLING = 0.7
"""The noise is that of the tenths above: of the turns that say most of the lag. A robot that stands has less."""
_LEAST_SIGMA_S = 0.004
"""No offset is known better: drivers stamp within some milliseconds, and odometry at 50 Hz is interpolated over 20."""
_RIVAL_S = 0.25
_RIVAL_LOSS = 25.0
"""Data determine an offset if every lag farther than `_RIVAL_S` from it is worse by such a loss: five sigmas, counted
after the correlation of the residuals."""
_LEAST_ALIKE = 0.9
"""Correlation below which the two do not show the same motion; for logs in order it is 0.97 and more."""
_STEPS = 5


@dataclass(frozen=True, slots=True, eq=False)
class Turns:
    """How far a sensor saw itself turn to the left between the times `starts_ns` and `ends_ns`, each (N,)."""

    starts_ns: NDArray[np.int64]
    ends_ns: NDArray[np.int64]
    turned_rad: Array

    def __len__(self) -> int:
        return len(self.turned_rad)


@dataclass(frozen=True, slots=True, eq=False)
class Headings:
    """Heading (N,) of odometry at stamps (N,) that rise strictly; whole turns add up."""

    stamps_ns: NDArray[np.int64]
    heading_rad: Array


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """How much later odometry is stamped than the sensor, with its standard uncertainty.

    `slope` is how far the sensor turned for each turn of the odometry, `alike` the correlation of both at that lag.
    """

    offset_s: float
    sigma_s: float
    slope: float
    alike: float


def clock_offset(turns: Turns, headings: Headings) -> ClockOffset | None:
    """The lag that best explains turns by headings; None where the data do not determine it.

    The turn of odometry between both ends of each turn, shifted by a lag and scaled, is fitted to it: all lags within
    `WIDEST_LAG_S` are tried, and the best is refined by Gauss-Newton steps with Student-t weights. The noise is that of
    the residuals, and counts for more where these are correlated from one turn to the next. Too little turning, a
    motion that repeats itself, or none in common leave the lag open. Temporal calibration by continuous-time
    alignment goes back to Furgale, Rehder and Siegwart 2013; here the turn rate alone is aligned.
    """
    if len(turns) < _LEAST_TURNS or len(headings.stamps_ns) < 2:
        return None
    lags_s = np.arange(-WIDEST_LAG_S - _RIVAL_S, WIDEST_LAG_S + _RIVAL_S + _GRID_S / 2, _GRID_S)
    predicted, known = _predicted(turns, headings, lags_s)
    enough = known.sum(axis=1) >= max(_LEAST_TURNS, 0.7 * known.sum(axis=1).max())
    alike = np.where(enough, _alike(turns.turned_rad, predicted, known), -1.0)
    fit = _refine(turns, headings, float(lags_s[np.argmax(alike)]))
    if fit is None:
        return None
    best = int(np.argmin(np.where(enough, _loss(turns, fit, predicted, known), np.inf)))
    fit = _refine(turns, headings, float(lags_s[best]))  # now outliers weigh less in the choice
    if fit is None or abs(fit.lag_s) > WIDEST_LAG_S or alike[best] < _LEAST_ALIKE:
        return None
    loss = np.where(enough, _loss(turns, fit, predicted, known), np.inf)
    if loss[np.abs(lags_s - fit.lag_s) > _RIVAL_S].min() - loss[best] < _RIVAL_LOSS:
        return None
    return ClockOffset(fit.lag_s, max(fit.sigma_s, _LEAST_SIGMA_S), fit.slope, float(alike[best]))


@dataclass(frozen=True, slots=True)
class _Fit:
    """A lag with its sigma, the slope, the noise of a turn, and how much fewer turns count for being correlated."""

    lag_s: float
    sigma_s: float
    slope: float
    noise_rad: float
    inflation: float


def _refine(turns: Turns, headings: Headings, lag_s: float) -> _Fit | None:
    """The least-squares lag and slope near a lag; None if the turns there say nothing of it."""
    slope, turned = 1.0, turns.turned_rad
    for _ in range(_STEPS):
        (early, here, late), known = _predicted(turns, headings, lag_s + np.array([-_GRID_S, 0.0, _GRID_S]))
        usable = known.all(axis=0)
        if usable.sum() < _LEAST_TURNS:
            return None
        jacobian = np.stack([slope * (late - early) / (2 * _GRID_S), here], axis=1)[usable]
        residual = (turned - slope * here)[usable]
        telling = np.abs(jacobian[:, 0]) >= np.quantile(np.abs(jacobian[:, 0]), _TELLING)
        noise = max(float(1.4826 * np.median(np.abs(residual[telling]))), _LEAST_NOISE_RAD)
        weight = student_weight((residual / noise) ** 2, _DOF)
        information = jacobian.T @ (weight[:, None] * jacobian)
        if np.linalg.cond(information) > 1e12:
            return None
        step = np.linalg.solve(information, jacobian.T @ (weight * residual))
        lag_s += float(np.clip(step[0], -_RIVAL_S, _RIVAL_S))
        slope += float(step[1])
    inflation = _inflation(np.sqrt(weight) * residual)
    sigma_s = noise * np.sqrt(np.linalg.inv(information)[0, 0] * inflation)
    return _Fit(lag_s, float(sigma_s), slope, noise, inflation)


def _loss(turns: Turns, fit: _Fit, predicted: Array, known: NDArray[np.bool_]) -> Array:
    """The loss (L,) of each lag's predicted turns (L, N) with a fit's slope and noise, as if all turns were known."""
    chi2 = ((turns.turned_rad - fit.slope * predicted) / fit.noise_rad) ** 2
    counts = known.sum(axis=1)
    loss: Array = np.where(known, student_loss(chi2, _DOF), 0.0).sum(axis=1) / np.maximum(counts, 1)
    loss *= counts.max() / fit.inflation
    return loss


def _inflation(residual: Array) -> float:
    """By how much the variance of a mean grows because each residual is like the one before it (first order)."""
    square = float(residual @ residual)
    alike = float(residual[1:] @ residual[:-1]) / square if square else 0.0
    alike = min(max(alike, 0.0), 0.9)
    return (1 + alike) / (1 - alike)


def _alike(turned: Array, predicted: Array, known: NDArray[np.bool_]) -> Array:
    """The normalised correlation (L,) of turns (N,) with those that were predicted at each lag (L, N)."""
    product = np.where(known, turned * predicted, 0.0).sum(axis=1)
    square = np.where(known, predicted**2, 0.0).sum(axis=1) * np.where(known, turned**2, 0.0).sum(axis=1)
    alike: Array = product / np.sqrt(np.maximum(square, 1e-12))
    return alike


def _predicted(turns: Turns, headings: Headings, lags_s: Array) -> tuple[Array, NDArray[np.bool_]]:
    """The turns (L, N) of odometry at each lag, and which of them are known."""
    starts, starts_known = _at(headings, turns.starts_ns, lags_s)
    ends, ends_known = _at(headings, turns.ends_ns, lags_s)
    return ends - starts, starts_known & ends_known


def _at(headings: Headings, times_ns: NDArray[np.int64], lags_s: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Headings (L, N) at times (N,) later by lags (L,), and whether each lies between two stamps close together."""
    first_ns = headings.stamps_ns[0]
    stamps_s, times_s = (headings.stamps_ns - first_ns) * 1e-9, (times_ns - first_ns) * 1e-9
    asked = times_s + lags_s[:, None]
    right = np.clip(np.searchsorted(stamps_s, asked), 1, len(stamps_s) - 1)
    near = np.diff(headings.stamps_ns)[right - 1] <= _GAP_NS
    inside: NDArray[np.bool_] = (asked >= stamps_s[0]) & (asked <= stamps_s[-1])
    return np.interp(asked, stamps_s, headings.heading_rad), near & inside
