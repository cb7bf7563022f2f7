"""How often bundles are matched to the right place, to a wrong one, and not at all: one by one and joined."""

import sys
from collections.abc import Iterator

import numpy as np

from tests.benchmark.rows import Row, main
from tests.benchmark.worlds import (
    Sensor,
    World,
    appendix_c,
    drive,
    error,
    pose_looking_at,
    random_world,
    scene,
)
from toolkit.estimation.odometry import OdometryNoise
from toolkit.geometry.se2 import Array, between
from toolkit.landmarks.index import MapIndex
from toolkit.landmarks.joining import Joiner
from toolkit.landmarks.matching import MatchConfig, Matcher
from toolkit.landmarks.verdicts import Match
from toolkit.stage import OdometryAt

# Development uses seeds below 10,000.
_SEED = 10_000
_WRONG_M, _WRONG_DEG = 1.0, 20.0
_STRETCH_M, _STEP_M, _JOIN_M = 20.0, 1.0, 30.0


def _matcher(world: World) -> Matcher:
    return Matcher(MapIndex.build(world.landmark_map), MatchConfig())


def _judged(match: Match, pose: Array) -> tuple[bool, bool]:
    """Whether a bundle was localized right, and whether wrongly."""
    if match.pose is None:
        return False, False
    far_m, turned_deg = error(match.pose, pose)
    wrong = far_m > _WRONG_M or turned_deg > _WRONG_DEG
    return not wrong, wrong


def _views(count: int) -> tuple[float, float]:
    """Shares right and wrong of Appendix C's groups, seen from any side."""
    rng = np.random.default_rng(_SEED)
    world = appendix_c(rng)
    scenes, poses = [], []
    for i in range(count):
        members = np.flatnonzero(world.group_of == i % 20)
        poses.append(pose_looking_at(rng, world.positions_xy[members].mean(axis=0), 5.7, 14.8))
        scenes.append(scene(rng, world, poses[-1], Sensor(), members)[0])
    judged = np.array([_judged(*pair) for pair in zip(_matcher(world).match(scenes), poses, strict=True)])
    return float(judged[:, 0].mean()), float(judged[:, 1].mean())


def _unknown(groups: int, count: int) -> float:
    """Share of single bundles of groups of another world that are accepted all the same."""
    here = random_world(np.random.default_rng(_SEED + 1), groups)
    rng = np.random.default_rng(_SEED + 2)
    elsewhere = random_world(rng, max(groups, 200))
    scenes = []
    for _ in range(count):
        members = np.flatnonzero(elsewhere.group_of == rng.integers(0, elsewhere.group_of.max() + 1))
        pose = pose_looking_at(rng, elsewhere.positions_xy[members].mean(axis=0), 5.7, 14.8)
        scenes.append(scene(rng, elsewhere, pose, Sensor(), members)[0])
    return sum(match.pose is not None for match in _matcher(here).match(scenes)) / count


def _stretches(groups: int, count: int) -> tuple[float, float, float, int]:
    """Of stretches of 20 m through the world: share found at their end, shares of known and of unknown bundles wrong.

    Each stretch is driven once in the mapped world and once in another; the number of known bundles comes last.
    """
    here = random_world(np.random.default_rng(_SEED + 3), groups)
    elsewhere = random_world(np.random.default_rng(_SEED + 4), groups)
    matcher = _matcher(here)
    found = wrong = accepted = bundles = 0
    for i in range(count):
        for world in (here, elsewhere):
            rng = np.random.default_rng([_SEED, groups, i])
            middle = world.positions_xy[rng.integers(0, len(world.positions_xy))]
            truth, odometry = drive(rng, pose_looking_at(rng, middle, 6.0, 10.0), _STRETCH_M, _STEP_M)
            matches = _joined(matcher, world, truth, odometry, rng)
            if world is here:
                judged = [_judged(match, pose) for match, pose in zip(matches, truth, strict=True)]
                found += judged[-1][0]
                wrong += sum(bad for _, bad in judged)
                bundles += len(judged)
            else:
                accepted += sum(match.pose is not None for match in matches)
    return found / count, wrong / bundles, accepted / bundles, bundles


def _joined(matcher: Matcher, world: World, truth: Array, odometry: Array, rng: np.random.Generator) -> list[Match]:
    joiner = Joiner(matcher, OdometryNoise(), _JOIN_M)
    way_m = turned_rad = 0.0
    matches = []
    for i, (pose, at) in enumerate(zip(truth, odometry, strict=True)):
        if i:
            step = between(odometry[i - 1], at)
            way_m, turned_rad = way_m + float(np.hypot(step[0], step[1])), turned_rad + abs(float(step[2]))
        observed = scene(rng, world, pose, Sensor())[0]
        matches.append(joiner.add(observed, OdometryAt("odom", at, np.zeros((3, 3)), way_m, turned_rad)))
    return matches


def measure(quick: bool) -> Iterator[Row]:
    """Every row; `quick` takes a tenth of the cases."""
    cases, stretches = (1000, 25) if quick else (10_000, 250)
    right, wrong = _views(cases)
    yield Row("appendix_c_any_view", right, at_least=0.995, cases=cases)
    yield Row("appendix_c_any_view_false", wrong, at_most=0.001, cases=cases)
    for groups in (20, 200, 2000) if quick else (20, 200, 2000, 20_000):
        share = _unknown(groups, cases)
        yield Row(f"false_accept_unknown_{groups}", share, at_most=0.001, cases=cases)
        found, known, unknown, bundles = _stretches(groups, stretches)
        yield Row(f"found_after_20m_{groups}", found, at_least=0.6, cases=stretches)
        yield Row(f"false_accept_known_{groups}", known, at_most=0.001, cases=bundles)
        yield Row(f"false_accept_unknown_joined_{groups}", unknown, at_most=0.001, cases=bundles)


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or ""))
