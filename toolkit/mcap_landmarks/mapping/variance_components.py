"""How noisy a log really is: sensor, odometry, and how alike the errors of sightings from one place are."""

from dataclasses import astuple

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.estimation.factor_graph import Solved
from mcap_landmarks.estimation.odometry import OdometryNoise
from mcap_landmarks.mapping.log_graph import LogNoise, LogSightings

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Sightings of one landmark within so much way and turning are from one place.
_PLACE_M, _PLACE_RAD = 0.25, 0.3
# An estimate from few residuals stays near what was assumed: that counts as so many.
_ASSUMED = 200
_PROBES = 8
_OUTLIER = 3.0


def places(log: LogSightings) -> Ints:
    """Number (M,) of the place that each sighting of a landmark belongs to; no two landmarks share one."""
    way = np.concatenate([[0.0], np.cumsum(log.motions.distance_m)])[log.pose]
    turned = np.concatenate([[0.0], np.cumsum(log.motions.turn_rad)])[log.pose]
    out = np.empty(len(log.pose), dtype=np.int64)
    place, first = -1, -1
    previous = None
    for row in np.lexsort((log.pose, log.landmark)):
        moved = way[row] - way[first] > _PLACE_M or turned[row] - turned[first] > _PLACE_RAD
        if log.landmark[row] != previous or moved:
            place, first, previous = place + 1, row, log.landmark[row]
        out[row] = place
    return out


def assumed_noise(place: Ints, odometry: OdometryNoise) -> LogNoise:
    """Noise to start with: the covariances as given, and all that was seen from one place as one sighting."""
    return LogNoise(odometry, np.ones(2), np.ones(2), np.bincount(place)[place])


def estimate_noise(log: LogSightings, place: Ints, odometry: OdometryNoise, solved: Solved, seed: int = 0) -> LogNoise:
    """Noise of a log from the residuals of its graph, solved with this `odometry` noise.

    Variances are squared residuals over the redundancy that the fit left them (Foerstner 1979; MacKay 1992). How alike
    sightings from one place are is the intraclass correlation of ranges and of bearings, by analysis of variance.
    """
    redundancy = _redundancy(solved, seed)
    seen = 2 * len(log.pose)
    raw = np.linalg.solve(solved.graph.seen_root, solved.residuals[0][..., None])[..., 0]
    capped = np.clip(raw / np.sqrt(np.diagonal(log.covariance, axis1=1, axis2=2)), -_OUTLIER, _OUTLIER)
    variance = [_blend((capped[:, axis] ** 2).sum(), redundancy[axis:seen:2].sum()) for axis in (0, 1)]
    alike = np.array([_intraclass_correlation(capped[:, axis], place) for axis in (0, 1)])
    squares, left = solved.residuals[1] ** 2, redundancy[seen : seen + 3 * len(solved.graph.motion)].reshape(-1, 3)
    heading = _blend(squares[:, 0].sum(), left[:, 0].sum()) ** 0.5
    position = _blend(squares[:, 1:].sum(), left[:, 1:].sum()) ** 0.5
    grown = OdometryNoise(
        odometry.position_per_metre_m * position,
        odometry.heading_per_metre_rad * heading,
        odometry.heading_per_radian_rad * heading,
    )
    return LogNoise(grown, np.sqrt(variance), alike, np.bincount(place)[place])


def largest_change(before: LogNoise, after: LogNoise) -> float:
    """The largest share of a sigma, the odometry's or the sensor's, by which it changed."""
    old, new = (np.array([*astuple(noise.odometry), *noise.scale]) for noise in (before, after))
    return float((np.abs(new - old) / np.maximum(old, 1e-12)).max())


def _redundancy(solved: Solved, seed: int) -> Array:
    """Share of each whitened residual that the fit could not absorb, its mean exact, by random probes (Hutchinson)."""
    jacobian = solved.jacobian
    probes = np.random.default_rng(seed).normal(size=(jacobian.shape[0], _PROBES))
    absorbed = jacobian @ solved.factor.solve(jacobian.T @ probes)
    return np.asarray(1 - (absorbed**2).mean(axis=1))


def _blend(squares: float, left: float) -> float:
    """Variance relative to the assumed one, which counts as so many residuals."""
    return float((squares + _ASSUMED) / (max(left, 0.0) + _ASSUMED))


def _intraclass_correlation(values: Array, place: Ints) -> float:
    """Share of the variance that sightings from one place have in common; 1 where little speaks against it."""
    count = np.bincount(place)
    mean = np.bincount(place, values) / count
    repeated = count[place] > 1
    free = int((count[count > 1] - 1).sum())
    if not free:
        return 1.0
    within = ((values - mean[place])[repeated] ** 2).sum() / free
    total = (values[repeated] ** 2).mean()
    alike = min(max(1 - within / total, 0.0), 1.0) if total > 0 else 1.0
    return float((alike * free + _ASSUMED) / (free + _ASSUMED))
