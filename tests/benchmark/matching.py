"""How often bundles are matched to the right place, to a wrong one, and not at all; how fast, and in how large maps."""

import sys
from collections.abc import Iterator

import numpy as np
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.matching import Matcher

from tests.benchmark.lookups import lookup_rows
from tests.benchmark.modulo import modulo_rows
from tests.benchmark.outliers import outlier_rows
from tests.benchmark.rows import Row, main
from tests.benchmark.stretches import CAMERA, Conditions, in_parallel, judged, stretch
from tests.benchmark.worlds import Sensor, World, appendix_c, pose_looking_at, random_world, scene
from tests.shared import data_folder

# Development uses seeds below 10,000.
_SEED = 10_000
_STRETCHES, _FEW_STRETCHES = 480, 25  # of 21 bundles each


def _matcher(world: World) -> Matcher:
    return Matcher(MapIndex.build(world.landmark_map), LocalizeConfig())


def _views(count: int) -> tuple[float, float]:
    """Shares right and wrong of Appendix C's groups, seen from any side."""
    rng = np.random.default_rng(_SEED)
    world = appendix_c(rng)
    scenes, poses = [], []
    for i in range(count):
        members = np.flatnonzero(world.group_of == i % 20)
        poses.append(pose_looking_at(rng, world.positions_xy[members].mean(axis=0), 5.7, 14.8))
        scenes.append(scene(rng, world, poses[-1], Sensor(), members)[0])
    found = np.array([judged(*pair) for pair in zip(_matcher(world).match(scenes), poses, strict=True)])
    return float(found[:, 0].mean()), float(found[:, 1].mean())


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


def _stretches(groups: int, count: int, conditions: Conditions) -> tuple[float, float, float, int]:
    """Of stretches of 20 m through the world: share found at their end, shares of known and of unknown bundles wrong.

    Each stretch is driven once in the mapped world and once in another; the number of known bundles comes last.
    """
    here = random_world(np.random.default_rng(_SEED + 3), groups)
    elsewhere = random_world(np.random.default_rng(_SEED + 4), groups)
    matcher = _matcher(here)

    def one(i: int) -> tuple[bool, int, int, int]:
        known = [judged(*pair) for pair in stretch(matcher, here, (_SEED, groups, i), conditions)]
        unknown = sum(
            match.pose is not None for match, _ in stretch(matcher, elsewhere, (_SEED, groups, i), conditions)
        )
        return known[-1][0], sum(bad for _, bad in known), unknown, len(known)

    found, wrong, accepted, bundles = np.sum(in_parallel(one, count), axis=0).tolist()
    return found / count, wrong / bundles, accepted / bundles, bundles


def _stretch_rows(groups: int, count: int, conditions: Conditions, suffix: str) -> Iterator[Row]:
    found, known, unknown, bundles = _stretches(groups, count, conditions)
    name = f"{groups}{suffix}"
    yield Row(f"found_after_20m_{name}", found, at_least=None if suffix else 0.6, cases=count)
    yield Row(f"false_accept_known_{name}", known, at_most=0.001, cases=bundles)
    yield Row(f"false_accept_unknown_joined_{name}", unknown, at_most=0.001, cases=bundles)


def measure(quick: bool) -> Iterator[Row]:
    """Every row; `quick` takes a tenth of the cases or less. Rows on data that others made need that data."""
    cases, stretches = (1000, _FEW_STRETCHES) if quick else (10_000, _STRETCHES)
    right, wrong = _views(cases)
    yield Row("appendix_c_any_view", right, at_least=0.995, cases=cases)
    yield Row("appendix_c_any_view_false", wrong, at_most=0.001, cases=cases)
    yield from outlier_rows(_SEED, quick)
    for groups in (20, 200, 2000) if quick else (20, 200, 2000, 20_000):
        share = _unknown(groups, cases)
        yield Row(f"false_accept_unknown_{groups}", share, at_most=0.001, cases=cases)
        yield from _stretch_rows(groups, stretches, Conditions(), "")
    for groups in (200,) if quick else (200, 2000):
        yield from _stretch_rows(groups, stretches, Conditions(CAMERA), "_camera")
    yield from lookup_rows(_SEED)
    data = data_folder()
    if data is not None:
        yield from modulo_rows(data)


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or ""))
