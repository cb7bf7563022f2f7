"""The pose solver's speed against scipy.optimize.root, and its accuracy against the Cramer-Rao bound."""

import sys
import time
from collections.abc import Callable, Iterator

import numpy as np
from mcap_landmarks.estimation.pose import solve_poses
from mcap_landmarks.estimation.thesis import solve_position

from tests.benchmark.rows import Row, main
from tests.estimation.worlds import Snapshots, nees, pose_errors, thesis_like

SIGMAS_RANGE_M = (0.01, 0.02, 0.05)
SIGMAS_BEARING_DEG = (0.1, 0.3)


def measure(quick: bool) -> Iterator[Row]:
    """The rows of issue 2."""
    yield from _speed(rounds=5 if quick else 15)
    for sigma_range_m in SIGMAS_RANGE_M:
        for sigma_bearing_deg in SIGMAS_BEARING_DEG:
            yield from _accuracy(50_000 if quick else 300_000, sigma_range_m, sigma_bearing_deg)


def _speed(rounds: int) -> Iterator[Row]:
    """Solves per second with three landmarks, on one thread each, in turns; scipy takes a part of the same problems."""
    world = thesis_like(100_000, 3, 0.02, np.radians(0.3), seed=0)
    arrays = (world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance)
    few = 300
    start = world.poses[:few, :2].mean(axis=0)

    def scipy_root() -> None:
        for landmarks, ranges in zip(world.landmarks_xy[:few], world.range_m[:few], strict=True):
            solve_position(landmarks, ranges, start)

    def robust() -> None:
        solve_poses(*arrays, robust_dof=3)

    contestants: dict[str, tuple[Callable[[], object], int]] = {
        "ours": (lambda: solve_poses(*arrays), len(world.poses)),
        "robust": (robust, len(world.poses)),
        "scipy.optimize.root": (scipy_root, few),
    }
    seconds: dict[str, list[float]] = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, (run, count) in contestants.items():
            began = time.perf_counter()
            run()
            seconds[name].append((time.perf_counter() - began) / count)
    rates = {name: 1 / float(np.median(times)) for name, times in seconds.items()}
    ours, peer = rates.pop("ours"), rates["scipy.optimize.root"]
    yield Row("speed_ratio", ours / peer, "x", at_least=50, cases=len(world.poses), peers={"scipy.optimize.root": 1.0})
    yield Row("solves_per_second", ours, "1/s", at_least=1e6, cases=len(world.poses), peers=rates)


def _accuracy(count: int, sigma_range_m: float, sigma_bearing_deg: float) -> Iterator[Row]:
    world = thesis_like(count, 3, sigma_range_m, np.radians(sigma_bearing_deg), seed=1)
    solved = solve_poses(world.landmarks_xy, world.range_m, world.bearing_rad, world.covariance)
    errors = pose_errors(solved.map_from_base, world.poses)
    bound = world.crb()
    ratio = _rms(errors[:, :2]) / float(np.sqrt(np.trace(bound[:, :2, :2], axis1=1, axis2=2).mean()))
    case = f"{sigma_range_m:g}m_{sigma_bearing_deg:g}deg"
    few = slice(0, 1000)
    peers = {"thesis": _rms(_thesis_errors(world, few)) / _rms(errors[few, :2]) * ratio}
    yield Row(f"crb_ratio_{case}", ratio, at_most=1.02, cases=count, peers=peers)
    yield Row(f"nees_{case}", nees(errors, solved.covariance), at_least=0.95, at_most=1.05, cases=count)


def _thesis_errors(world: Snapshots, few: slice) -> np.ndarray:
    guess = world.poses[:, :2].mean(axis=0)
    pairs = zip(world.landmarks_xy[few], world.range_m[few], strict=True)
    return (
        np.array([solve_position(landmarks, ranges, guess).position_xy for landmarks, ranges in pairs])
        - world.poses[few, :2]
    )


def _rms(errors: np.ndarray) -> float:
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or ""))
