"""How fast bundles are looked up in large maps, and how the index grows with the map."""

import functools
import resource
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.matching import Matcher, block_diagonal
from mcap_landmarks.maps.database import read_map, read_neighbours, write_map

from tests.benchmark.rows import Row
from tests.benchmark.worlds import Sensor, World, pose_looking_at, random_world, scene

_BATCH, _ROUNDS = 5000, 5
_LARGE = 200_000
_SIZES = (20, 200, 2000, 20_000, _LARGE)
_NEAR_M = 1.0


@dataclass(frozen=True, slots=True)
class _Growth:
    """What a map of some size costs: seconds to build and to load its index, bytes at the peak, seconds per bundle."""

    build_s: float
    load_s: float
    peak_bytes: int
    lookup_s: float
    candidates: float
    found: float


def lookup_rows(seed: int) -> Iterator[Row]:
    """Time of a lookup in a batch, of building and loading an index, and memory, over sizes of the map.

    A lookup is all that turns a bundle of three objects into candidate poses; noise 0.02 m, 0.3 degrees, map 0.03 m.
    Each size is measured in a process of its own, whose peak memory includes the map itself and Python. Loading
    includes reading the map from its database.
    """
    for groups in _SIZES:
        grown = _apart(groups, 10, seed)
        name = "200k" if groups == _LARGE else str(groups)
        goals = {"at_most": 50.0} if groups == _LARGE else {}
        few = {"candidates": grown.candidates, "true one among them": grown.found}
        yield Row(f"lookup_{name}", 1e6 * grown.lookup_s, "us", **goals, cases=_BATCH, peers=few)
        limits = (30.0, 5.0, 2.0) if groups == _LARGE else (None, None, None)
        yield Row(f"index_build_{name}", grown.build_s, "s", at_most=limits[0])
        yield Row(f"index_load_{name}", grown.load_s, "s", at_most=limits[1])
        yield Row(f"index_memory_{name}", grown.peak_bytes / 1e9, "GB", at_most=limits[2])
    three = _apart(_LARGE, 3, seed)
    few = {"candidates": three.candidates, "true one among them": three.found}
    yield Row("lookup_200k_3_classes", 1e6 * three.lookup_s, "us", cases=_BATCH, peers=few)


def _apart(groups: int, classes: int, seed: int) -> _Growth:
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(functools.partial(_grow, groups, classes, seed)).result()


def _grow(groups: int, classes: int, seed: int) -> _Growth:
    world = random_world(np.random.default_rng(seed), groups, classes)
    began = time.perf_counter()
    index = MapIndex.build(world.landmark_map)
    built = time.perf_counter()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    lookup_s, candidates, found = _look_up(world, index, seed)
    with tempfile.TemporaryDirectory() as folder:
        database = Path(folder) / "map.db"
        write_map(database, world.landmark_map)
        before = time.perf_counter()
        again = read_map(database)
        MapIndex.build(again, read_neighbours(database, again))
        load_s = time.perf_counter() - before
    return _Growth(built - began, load_s, peak, lookup_s, candidates, found)


def _look_up(world: World, index: MapIndex, seed: int) -> tuple[float, float, float]:
    """Median seconds per bundle over several rounds, candidates per bundle, share with the true pose among them."""
    rng = np.random.default_rng((seed, 1))
    matcher = Matcher(index, LocalizeConfig())
    points, spread, options, poses = [], [], [], []
    for _ in range(_BATCH):
        members = np.arange(3) + 3 * rng.integers(0, world.group_of.max() + 1)
        poses.append(pose_looking_at(rng, world.positions_xy[members].mean(axis=0), 5.7, 14.8))
        observed, _ = scene(rng, world, poses[-1], Sensor(), members)
        points.append(observed.positions_xy)
        spread.append(observed.covariances)
        options.extend(observed.hypotheses)
    likely = matcher.classes.probabilities(options).reshape(_BATCH, 3, -1)
    spurious = np.full((_BATCH, 3), matcher.config.spurious)
    taken = []
    for _ in range(_ROUNDS):
        began = time.perf_counter()
        sets = matcher.sets(np.array(points), block_diagonal(np.array(spread)), likely, spurious)
        candidates = matcher.candidates(sets, np.ones((_BATCH, 3), dtype=np.bool_))
        taken.append(time.perf_counter() - began)
    miss = np.linalg.norm(candidates.pose[:, :2] - np.array(poses)[candidates.of, :2], axis=1)
    found = len(np.unique(candidates.of[miss < _NEAR_M]))
    return float(np.median(taken)) / _BATCH, len(candidates.of) / _BATCH, found / _BATCH
