"""Real snapshots (UTIAS MRCLAM, Leung et al. 2011): positions from ranges and bearings against the true ones."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap_landmarks.estimation.calibration import calibrate
from mcap_landmarks.estimation.pose import solve_poses
from mcap_landmarks.estimation.thesis import solve_position
from numpy.typing import NDArray
from scipy.io import loadmat

from tests.benchmark.peers import betke_gurvits, sayed, total
from tests.benchmark.rows import Row
from tests.estimation.worlds import Array

# What MRCLAM's scene objects are converted with; `calibrate` finds from there what the log really has.
COVARIANCE = np.diag([0.12**2, 0.03**2])
_ROBUST_DOF = 3.0
_FEW = 300

Solver = Callable[[Array, Array, Array, Array], Array]
"""Position (2,) from landmarks (K, 2), ranges and bearings (K,) and the middle (2,) of all robots."""
# The thesis's and ToTal take the first three landmarks; only the thesis's needs a guess.
_PEERS: dict[str, Solver] = {
    "thesis": lambda xy, distance, _bearing, guess: solve_position(xy[:3], distance[:3], guess).position_xy,
    "sayed": lambda xy, distance, _bearing, _guess: sayed(xy, distance),
    "total": lambda xy, _distance, bearing, _guess: total(xy[:3], bearing[:3]),
    "betke_gurvits": lambda xy, _distance, bearing, _guess: betke_gurvits(xy, bearing),
}


class SnapshotSet(NamedTuple):
    """B true poses, and up to K sightings of each: landmarks (B, K, 2), ranges, bearings and which exist (B, K)."""

    poses: Array
    landmarks_xy: Array
    range_m: Array
    bearing_rad: Array
    mask: NDArray[np.bool_]


def read_snapshots(path: Path) -> SnapshotSet:
    """One `mrclam*.mat` of the TriangulationToolbox."""
    content = loadmat(path)
    poses, landmarks, seen = content["groundtruth"][:, 1:], content["landmark"][:, 1:], content["measurement"]
    seen = seen[np.argsort(seen[:, 0], kind="stable")]
    row = seen[:, 0].astype(int) - 1
    count = np.bincount(row, minlength=len(poses))
    place = np.arange(len(row)) - (np.cumsum(count) - count)[row]
    shape = (len(poses), int(count.max()))
    mask = np.zeros(shape, dtype=np.bool_)
    landmarks_xy, range_m, bearing_rad = np.zeros((*shape, 2)), np.ones(shape), np.zeros(shape)
    mask[row, place] = True
    landmarks_xy[row, place] = landmarks[seen[:, 1].astype(int) - 1]
    range_m[row, place], bearing_rad[row, place] = seen[:, 2], seen[:, 3]
    return SnapshotSet(poses, landmarks_xy, range_m, bearing_rad, mask)


def snapshot_rows(data: Path) -> Iterator[Row]:
    """`mrclam_median`, `mrclam_under_0_2`, `mrclam_under_1`: sensor model and sigmas estimated from each set itself."""
    sets = [read_snapshots(data / "mrclam" / f"mrclam{number}.mat") for number in (1, 2, 3, 4)]
    ours = np.concatenate([_errors(given, calibrated=True) for given in sets])
    plain = np.concatenate([_errors(given, calibrated=False) for given in sets])
    others = {"as_converted": plain}
    others |= {name: np.concatenate([_errors_of(solver, given) for given in sets]) for name, solver in _PEERS.items()}
    cases = len(ours)

    def under(limit_m: float) -> dict[str, float]:
        return {name: float((errors < limit_m).mean()) for name, errors in others.items()}

    medians = {name: float(np.median(errors)) for name, errors in others.items()}
    yield Row("mrclam_median", float(np.median(ours)), "m", at_most=0.042, cases=cases, peers=medians)
    yield Row("mrclam_under_0_2", float((ours < 0.2).mean()), at_least=0.97, cases=cases, peers=under(0.2))
    yield Row("mrclam_under_1", float((ours < 1).mean()), at_least=0.999, cases=cases, peers=under(1.0))


def _errors(given: SnapshotSet, *, calibrated: bool) -> Array:
    covariance, distance = COVARIANCE, given.range_m
    if calibrated:
        model = calibrate(given.landmarks_xy, given.range_m, given.bearing_rad, COVARIANCE, mask=given.mask).model
        covariance = COVARIANCE * np.outer(model.scale, model.scale)
        distance = model.distance_m(given.range_m, given.bearing_rad)
    solved = solve_poses(
        given.landmarks_xy, distance, given.bearing_rad, covariance, mask=given.mask, robust_dof=_ROBUST_DOF
    )
    return np.asarray(np.linalg.norm(solved.map_from_base[:, :2] - given.poses[:, :2], axis=1))


def _errors_of(solver: Solver, given: SnapshotSet) -> Array:
    """Another solver's errors on some snapshots."""
    middle = given.poses[:, :2].mean(axis=0)
    rows = np.linspace(0, len(given.poses) - 1, _FEW).astype(int)
    found = [
        solver(given.landmarks_xy[i, seen], given.range_m[i, seen], given.bearing_rad[i, seen], middle)
        for i, seen in zip(rows, given.mask[rows], strict=True)
    ]
    return np.asarray(np.linalg.norm(np.array(found) - given.poses[rows, :2], axis=1))
