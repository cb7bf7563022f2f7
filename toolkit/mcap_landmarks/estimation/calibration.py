"""What a sensor's ranges really measure, and how noisy it is, found from the bundles that it saw and a map."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcap_landmarks.estimation.pose import solve_poses
from mcap_landmarks.estimation.termination import Termination
from mcap_landmarks.geometry.angles import wrap

Array = NDArray[np.float64]

# What is believed before, as sigmas: offsets of decimetres are odd, ranges may as well be depths as distances.
_PRIOR_SIGMA = np.array([0.05, 1.0])
# Both parameters together must explain so much chi-square, else none is applied: noise does once in three million logs.
_WORTH_IT = 30.0
# Residuals beyond so many sigmas count as that (winsorised): of normal noise that takes half a percent of the variance.
_OUTLIER = 3.0
# The sigmas that are given count as so many residuals, so that a log of a few bundles stays near them.
_GIVEN = 10.0
# Rounds shrink the change by a factor of three to six; on MRCLAM it is below 1e-6 after so many.
_ROUNDS = 15
_CONVERGED = 1e-4
# So many bundles, evenly chosen, give the offset to 1 to 6 mm and the depth to half a percent, within a second.
_MOST_BUNDLES = 4000
# Degrees of freedom that bear a tenth of wrong observations, as in `localize`.
_ROBUST_DOF = 3.0


@dataclass(frozen=True, slots=True)
class SensorModel:
    """measured range = offset_m + distance * (1 - depth * (1 - cos(bearing))); `scale` (2,) multiplies the sigmas.

    With `depth` 0 the sensor measures the distance, with 1 the part of it along its axis, as cameras do.
    """

    offset_m: float = 0.0
    depth: float = 0.0
    scale: Array = field(default_factory=lambda: np.ones(2))

    def distance_m(self, range_m: ArrayLike, bearing_rad: ArrayLike) -> Array:
        """Distances (...) of measured ranges and bearings (...)."""
        return (np.asarray(range_m) - self.offset_m) / self._gain(np.asarray(bearing_rad, dtype=np.float64))

    def derivatives(self, range_m: Array, bearing_rad: Array) -> Array:
        """Derivatives (..., 2) of the distance by offset and depth."""
        gain = self._gain(bearing_rad)
        return np.stack([-1 / gain, (range_m - self.offset_m) * (1 - np.cos(bearing_rad)) / gain**2], axis=-1)

    def _gain(self, bearing_rad: Array) -> Array:
        return np.asarray(1 - self.depth * (1 - np.cos(bearing_rad)))


class Calibration(NamedTuple):
    """A sensor's model, and how the search for it ended; without an iteration where there was nothing to search in.

    Converged: the last round changed offset and depth by less than 1e-4 of what is believed of them before, and the
    sigmas by less than that share of themselves. The cost sums the squared weighted residuals before the last round.
    """

    model: SensorModel
    termination: Termination


def calibrate(
    landmarks_xy: Array,
    range_m: Array,
    bearing_rad: Array,
    covariance: ArrayLike,
    *,
    landmark_covariance: Array | None = None,
    mask: NDArray[np.bool_] | None = None,
) -> Calibration:
    """Sensor model that makes B bundles of up to K observations fit the map best; arguments as in `pose.solve_poses`.

    No truth is needed: a bundle of two landmarks has one number more than its pose, one of three has three. Poses are
    eliminated from each bundle (variable projection, Golub and Pereyra 1973); sigmas come from what redundancy is left
    (variance component estimation: Helmert 1907, Foerstner 1979). Sensors without a bearing
    to speak of, or too little data, give the plain model.
    """
    exists = np.ones(range_m.shape, dtype=np.bool_) if mask is None else mask
    rows = np.flatnonzero(exists.sum(axis=1) >= 2)
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), _MOST_BUNDLES)).astype(np.int64)]
    if not len(rows):
        return Calibration(SensorModel(), Termination(converged=True, iterations=0, cost=0.0))
    noise = np.broadcast_to(np.asarray(covariance, dtype=np.float64), (*range_m.shape, 2, 2))[rows]
    spread = None if landmark_covariance is None else landmark_covariance[rows]
    part = _Bundles(landmarks_xy[rows], range_m[rows], bearing_rad[rows], noise, spread, exists[rows])
    found, explained = _search(part, plain=False)
    return found if explained >= _WORTH_IT else _search(part, plain=True)[0]


def _search(bundles: "_Bundles", *, plain: bool) -> tuple[Calibration, float]:
    """The model after all rounds, `plain` ones with sigmas alone, and how much chi-square offset and depth explain."""
    model, changed, explained, cost = SensorModel(), np.inf, 0.0, 0.0
    for _ in range(_ROUNDS):
        before = model
        model, explained, cost = bundles.improve(before)
        if plain:
            model = SensorModel(scale=model.scale)
        changed = _change(before, model)
    return Calibration(model, Termination(changed < _CONVERGED, _ROUNDS, cost)), explained


def _change(before: SensorModel, after: SensorModel) -> float:
    """The largest change of a parameter, by its sigma beforehand, or of a sigma, by itself."""
    by_prior = np.array([after.offset_m - before.offset_m, after.depth - before.depth]) / _PRIOR_SIGMA
    return float(np.abs([*by_prior, *np.log(after.scale / before.scale)]).max())


@dataclass(frozen=True, slots=True)
class _Bundles:
    landmarks_xy: Array
    range_m: Array
    bearing_rad: Array
    covariance: Array
    landmark_covariance: Array | None
    mask: NDArray[np.bool_]

    def improve(self, model: SensorModel) -> tuple[SensorModel, float, float]:
        """One Gauss-Newton step of the model, how much chi-square its two parameters explain, and the cost before."""
        residual, by_pose, by_model, root_weight = self._whitened(model)
        plain = np.divide(residual, root_weight, out=np.zeros_like(residual), where=root_weight > 0)
        basis, _ = np.linalg.qr(by_pose)
        residual, by_model = _beyond(basis, residual[..., None])[..., 0], _beyond(basis, by_model)
        at = np.array([model.offset_m, model.depth])
        information = np.einsum("bij,bik->jk", by_model, by_model)
        right = np.einsum("bij,bi->j", by_model, residual)
        stiff = np.diag(1 / _PRIOR_SIGMA**2)
        new = at + np.linalg.solve(information + stiff, right - stiff @ at)
        left = np.clip(1 - (basis**2).sum(axis=2), 0, 1).reshape(*self.mask.shape, 2)[self.mask].sum(axis=0)
        squares = (np.clip(plain, -_OUTLIER, _OUTLIER) ** 2).reshape(*self.mask.shape, 2)[self.mask].sum(axis=0)
        scale = np.sqrt((squares * model.scale**2 + _GIVEN) / (left + _GIVEN))
        cost = float((residual**2).sum())
        return SensorModel(float(new[0]), float(new[1]), scale), float(new @ information @ new), cost

    def _whitened(self, model: SensorModel) -> tuple[Array, Array, Array, Array]:
        """Weighted residuals (B, 2 K) at the best poses, minus their derivatives by pose (B, 2 K, 3) and model
        (B, 2 K, 2), and the square roots of the robust weights (B, 2 K).
        """
        distance = model.distance_m(self.range_m, self.bearing_rad)
        noise = self.covariance * model.scale[:, None] * model.scale
        solved = solve_poses(
            self.landmarks_xy,
            distance,
            self.bearing_rad,
            noise,
            landmark_covariance=self.landmark_covariance,
            mask=self.mask,
            robust_dof=_ROBUST_DOF,
        )
        d = self.landmarks_xy - solved.map_from_base[:, None, :2]
        reach = np.maximum(np.hypot(d[..., 0], d[..., 1]), 1e-6)
        nx, ny, zero = d[..., 0] / reach, d[..., 1] / reach, np.zeros_like(reach)
        e_bearing = wrap(self.bearing_rad - np.arctan2(d[..., 1], d[..., 0]) + solved.map_from_base[:, None, 2])
        residual = np.stack([distance - reach, e_bearing], axis=-1)
        by_pose = np.stack([_row(-nx, -ny, zero), _row(ny / reach, -nx / reach, zero - 1)], axis=-2)
        by_distance = model.derivatives(self.range_m, self.bearing_rad)
        by_model = np.stack([-by_distance, np.zeros_like(by_distance)], axis=-2)
        usable = self.mask & (solved.weights > 0)
        root = np.linalg.inv(np.linalg.cholesky(np.where(usable[..., None, None], noise, np.eye(2))))
        root_weight = np.sqrt(solved.weights)
        values = root @ np.concatenate([residual[..., None], by_pose, by_model], axis=-1)
        values = np.where(usable[..., None, None], values * root_weight[..., None, None], 0.0)
        values = values.reshape(len(reach), -1, 6)
        return values[..., 0], values[..., 1:4], values[..., 4:], np.repeat(root_weight, 2, axis=1)


def _row(*entries: Array) -> Array:
    return np.stack(entries, axis=-1)


def _beyond(basis: Array, columns: Array) -> Array:
    """What of the columns (B, N, C) the orthonormal basis (B, N, P) cannot express."""
    return np.asarray(columns - basis @ (basis.swapaxes(1, 2) @ columns))
