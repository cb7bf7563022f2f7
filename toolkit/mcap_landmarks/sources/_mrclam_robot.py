"""One robot of an MRCLAM data set as arrays: integrated odometry with covariance, measured objects, truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import exp, rotation
from mcap_landmarks.sources._mrclam_files import Array, MrclamTable, keep

FIRST_LANDMARK = 6  # subjects 1 to 5 are the robots


@dataclass(frozen=True, slots=True)
class MrclamConfig:
    """Generic errors of sensors and wheels.

    range_sd_m and bearing_sd_rad belong to one measurement. The odometry's errors grow like a random walk:
    slip_sd_m per square root of a metre, turn_sd_rad per square root of a radian turned, drift_sd_rad per square root
    of a metre.
    """

    range_sd_m: float = 0.12
    bearing_sd_rad: float = 0.03
    slip_sd_m: float = 0.05
    turn_sd_rad: float = 0.1
    drift_sd_rad: float = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Scans:
    """Measurements grouped by time stamp: scan i has the rows `bounds[i]` to `bounds[i + 1]`.

    time_ns (scans,), barcodes (N,), positions_xy (N, 2), covariances (N, 2, 2).
    """

    time_ns: NDArray[np.int64]
    bounds: NDArray[np.int64]
    barcodes: NDArray[np.int64]
    positions_xy: Array
    covariances: Array


def clean_odometry(table: MrclamTable, name: str) -> None:
    """Keep one row per time stamp, the last, which is the speed that holds from then on."""
    last = np.append(np.diff(table.time_ns) > 0, np.ones(min(len(table.time_ns), 1), dtype=bool))
    keep(table, last, f"{name}: same time as the next row")


def integrate(time_ns: NDArray[np.int64], speeds: Array) -> Array:
    """Poses (N, 3) from (0, 0, 0) by exact arcs.

    `speeds` (N, 2) are forward in m/s and turn in rad/s; each holds until the next.
    """
    seconds = np.diff(time_ns) * 1e-9
    twists = np.zeros((len(seconds), 3))
    twists[:, 0], twists[:, 2] = speeds[:-1, 0] * seconds, speeds[:-1, 1] * seconds
    heading = np.concatenate([[0.0], np.cumsum(twists[:, 2])])[: len(time_ns)]
    moves = np.einsum("nij,nj->ni", rotation(heading[:-1]), exp(twists)[:, :2])
    xy = np.concatenate([np.zeros((1, 2)), np.cumsum(moves, axis=0)])[: len(time_ns)]
    return np.column_stack([xy, wrap(heading)])


def odometry_covariance(time_ns: NDArray[np.int64], speeds: Array, poses: Array, config: MrclamConfig) -> Array:
    """Covariances (N, 3, 3) of x, y, heading of integrated poses, in the frame in which these start at zero.

    Each step's own error in heading turns all that follows about the place of the step, so every entry is a running
    sum over the steps of its variance times 1, place, or place squared.
    """
    seconds = np.diff(time_ns) * 1e-9
    way = np.abs(speeds[:-1, 0]) * seconds
    slip = config.slip_sd_m**2 * way
    turn = config.turn_sd_rad**2 * np.abs(speeds[:-1, 1]) * seconds + config.drift_sd_rad**2 * way
    middle = (poses[:-1, :2] + poses[1:, :2]) / 2
    p, s0 = poses[:, :2], _running(turn)
    s1 = _running(turn[:, None] * middle)
    s2 = _running(turn[:, None, None] * middle[:, :, None] * middle[:, None, :])
    cross = p[:, :, None] * s1[:, None, :]
    levers = s0[:, None, None] * p[:, :, None] * p[:, None, :] - cross - cross.transpose(0, 2, 1) + s2
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    covariance = np.zeros((len(time_ns), 3, 3))
    covariance[:, :2, :2] = quarter @ levers @ quarter.T + _running(slip)[:, None, None] * np.eye(2)
    covariance[:, :2, 2] = covariance[:, 2, :2] = (s0[:, None] * p - s1) @ quarter.T
    covariance[:, 2, 2] = s0
    return covariance


def _running(steps: Array) -> Array:
    """Sums before each of the N poses, from the N - 1 steps between them."""
    return np.concatenate([np.zeros((1, *steps.shape[1:])), np.cumsum(steps, axis=0)])


def scans(table: MrclamTable, name: str, subjects: dict[int, int], config: MrclamConfig) -> Scans:
    """Measured objects in the robot's frame; a scan whose rows are all left out stays, empty.

    `table.values` are barcode, range, bearing; `subjects` gives the subject of a barcode.
    """
    stamps = np.unique(table.time_ns)
    known = np.array([subjects.get(int(code), FIRST_LANDMARK) for code in table.values[:, 0]], dtype=np.int64)
    keep(table, known >= FIRST_LANDMARK, f"{name}: barcode of a robot")
    rows = np.column_stack([table.time_ns.astype(np.float64), table.values])
    first = np.zeros(len(rows), dtype=bool)
    first[np.unique(rows, axis=0, return_index=True)[1]] = True
    keep(table, first, f"{name}: measured twice")
    keep(table, table.values[:, 1] > 0, f"{name}: range is not positive")
    ranges, bearings = table.values[:, 1], table.values[:, 2]
    c, s = np.cos(bearings), np.sin(bearings)
    # Columns: along the ray and across it, each with its standard deviation in metres.
    axes = np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
    deviations = np.stack([np.full_like(ranges, config.range_sd_m), ranges * config.bearing_sd_rad], axis=-1)
    scaled = axes * deviations[:, None, :]
    bounds = np.append(np.searchsorted(table.time_ns, stamps), len(table.time_ns))
    return Scans(
        stamps,
        bounds,
        table.values[:, 0].astype(np.int64),
        np.column_stack([ranges * c, ranges * s]),
        scaled @ scaled.transpose(0, 2, 1),
    )
