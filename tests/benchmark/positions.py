"""Positions from three landmarks against the Cramer-Rao bound, and beside other solvers of the same snapshots."""

from collections.abc import Callable, Iterator

import numpy as np
from mcap_landmarks.estimation.pose import solve_poses
from mcap_landmarks.estimation.thesis import solve_position
from numpy.typing import NDArray

from tests.benchmark.peers import betke_gurvits, sayed, total
from tests.benchmark.rows import Row
from tests.estimation.worlds import Array, Snapshots, nees, pose_errors, thesis_like

_FEW = 2000
_WRONG_M = 1.0
_WRONG_SIGMAS = 6.0


def position_rows(quick: bool) -> Iterator[Row]:
    """`crb_ratio`, `nees` (the worst over all noise levels) and `wrong_branch`."""
    worlds = [
        thesis_like(20_000 if quick else 200_000, 3, sigma_range_m, np.radians(sigma_bearing_deg), seed=11)
        for sigma_range_m in (0.01, 0.02, 0.05)
        for sigma_bearing_deg in (0.1, 0.3)
    ]
    measured = [_against_the_bound(world) for world in worlds]
    cases = sum(len(world.poses) for world in worlds)
    yield Row(
        "crb_ratio", max(ratio for ratio, _ in measured), at_most=1.02, cases=cases, peers=_peer_ratios(worlds[3])
    )
    yield Row(
        "nees",
        max((honesty for _, honesty in measured), key=lambda honesty: abs(honesty - 1)),
        at_least=0.95,
        at_most=1.05,
        cases=cases,
    )
    yield _wrong_branch(100_000 if quick else 1_000_000)


def _against_the_bound(world: Snapshots) -> tuple[float, float]:
    solved = solve_poses(world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance)
    errors = pose_errors(solved.map_from_base, world.poses)
    return _rms(errors[:, :2]) / _bound_m(world), nees(errors, solved.covariance)


def _peers(world: Snapshots) -> dict[str, Callable[[int], Array]]:
    """Position (2,) of snapshot i by each of the others. The thesis starts at the middle of all robots."""
    guess = world.poses[:, :2].mean(axis=0)
    return {
        "thesis": lambda i: solve_position(world.landmarks_xy[i], world.range_m[i], guess).position_xy,
        "sayed": lambda i: sayed(world.landmarks_xy[i], world.range_m[i]),
        "total": lambda i: total(world.landmarks_xy[i], world.bearing_rad[i]),
        "betke_gurvits": lambda i: betke_gurvits(world.landmarks_xy[i], world.bearing_rad[i]),
    }


def _peer_ratios(world: Snapshots) -> dict[str, float]:
    """Others' median error over ours, which is at the bound: a root mean square of theirs would be their worst case."""
    solved = solve_poses(world.landmarks_xy[:_FEW], world.range_m[:_FEW], world.bearing_rad[:_FEW], world.covariance)
    ours = _median(solved.map_from_base[:, :2] - world.poses[:_FEW, :2])
    return {
        name: _median(np.array([solver(i) - world.poses[i, :2] for i in range(_FEW)])) / ours
        for name, solver in _peers(world).items()
    }


def _wrong_branch(count: int) -> Row:
    """Solves that end elsewhere: more than a metre off and far beyond the bound. The thesis's has its fixed guess.

    For the others it is their share: no guess either, but fewer of the numbers.
    """
    wrong, done = 0, 0
    while done < count:
        world = thesis_like(min(100_000, count - done), 3, 0.02, np.radians(0.3), seed=100 + done)
        solved = solve_poses(world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance)
        wrong += int(_elsewhere(world, solved.map_from_base[:, :2]).sum())
        done += len(world.poses)
    peers = {
        name: float(_elsewhere(world, np.array([solver(i) for i in range(_FEW)])).mean())
        for name, solver in _peers(world).items()
    }
    return Row("wrong_branch", wrong, "solves", at_most=0, cases=count, peers=peers)


def _elsewhere(world: Snapshots, position_xy: Array) -> NDArray[np.bool_]:
    off = np.linalg.norm(position_xy - world.poses[: len(position_xy), :2], axis=1)
    bound = np.sqrt(np.trace(world.crb()[: len(off), :2, :2], axis1=1, axis2=2))
    return np.asarray(off > np.maximum(_WRONG_M, _WRONG_SIGMAS * bound))


def _median(errors: Array) -> float:
    return float(np.median(np.linalg.norm(errors, axis=1)))


def _bound_m(world: Snapshots) -> float:
    return float(np.sqrt(np.trace(world.crb()[:, :2, :2], axis1=1, axis2=2).mean()))


def _rms(errors: Array) -> float:
    return float(np.sqrt((errors**2).sum(axis=1).mean()))
