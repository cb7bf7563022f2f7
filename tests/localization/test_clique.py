"""Among outliers, the matcher's inliers are as many as the maximum clique over pairwise consistency has."""

from collections.abc import Iterator

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import transform_points
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.matching import Matcher, block_diagonal
from mcap_landmarks.localization.verification import UNMATCHED
from mcap_landmarks.messages.scene import SceneObjects
from numpy.typing import NDArray

from tests.benchmark.worlds import Sensor, World, pose_looking_at, random_world, scene

Array = NDArray[np.float64]
Pair = tuple[int, int]
_PAIR_SIGMAS, _POINT_SIGMAS = 3.0, 3.5
_MAP_SIGMA_M = 0.03


def cliques(beside: dict[int, set[int]], chosen: list[int], left: set[int], done: set[int]) -> Iterator[list[int]]:
    """All maximal cliques of a graph (Bron and Kerbosch 1973, with the pivot of Tomita et al. 2006)."""
    if not left and not done:
        yield chosen
        return
    pivot = max(left | done, key=lambda node: len(beside[node] & left))
    for node in sorted(left - beside[pivot]):
        yield from cliques(beside, [*chosen, node], left & beside[node], done & beside[node])
        left.remove(node)
        done.add(node)


def consistent(world: World, seen: SceneObjects) -> tuple[list[Pair], dict[int, set[int]]]:
    """Pairs (object, landmark) of one class, and which of them agree: as far apart in the bundle as in the map."""
    labels = [int(options[0][0].split()[1]) for options in seen.hypotheses]
    pairs = [(i, int(m)) for i, label in enumerate(labels) for m in np.flatnonzero(world.class_of == label)]
    objects, landmarks = np.array(pairs).T
    sigma = np.sqrt(np.trace(seen.covariances, axis1=1, axis2=2) / 2 + _MAP_SIGMA_M**2)[objects]
    mapped = world.landmark_map.positions_xy[landmarks]
    apart = np.linalg.norm(seen.positions_xy[objects][:, None] - seen.positions_xy[objects], axis=-1)
    off = np.abs(apart - np.linalg.norm(mapped[:, None] - mapped, axis=-1))
    agree = off < _PAIR_SIGMAS * np.hypot(sigma[:, None], sigma)
    agree &= (objects[:, None] != objects) & (landmarks[:, None] != landmarks)
    return pairs, {i: set(np.flatnonzero(row).tolist()) for i, row in enumerate(agree)}


def fitting(world: World, seen: SceneObjects, clique: list[Pair]) -> list[Pair]:
    """What of a clique fits under one rotation and shift (Umeyama 1991): a mirror image leaves little."""
    while len(clique) > 2:
        objects, landmarks = np.array(clique).T
        points, places = seen.positions_xy[objects], world.landmark_map.positions_xy[landmarks]
        a, b = points - points.mean(axis=0), places - places.mean(axis=0)
        angle = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
        turned = transform_points(np.array([0.0, 0.0, angle]), a)
        sigma = np.sqrt(np.trace(seen.covariances[objects], axis1=1, axis2=2) / 2 + _MAP_SIGMA_M**2)
        miss = np.linalg.norm(turned - b, axis=1) / sigma
        if miss.max() < _POINT_SIGMAS:
            break
        clique = [pair for i, pair in enumerate(clique) if i != miss.argmax()]
    return clique


def largest(world: World, seen: SceneObjects) -> list[Pair]:
    """The maximum clique that is no mirror image, by looking at every maximal one."""
    pairs, beside = consistent(world, seen)
    best: list[Pair] = []
    for clique in cliques(beside, [], set(beside), set()):
        if len(clique) > len(best):
            best = max(best, fitting(world, seen, [pairs[i] for i in clique]), key=len)
    return best


def bundle(rng: np.random.Generator, world: World, count: int, outliers: float) -> SceneObjects:
    """The nearest objects around a robot; of a share of them half are spurious, half have a wrong class."""
    middle = world.positions_xy[rng.integers(0, len(world.positions_xy))]
    seen = scene(rng, world, pose_looking_at(rng, middle, 4.0, 8.0), Sensor(reach_m=60.0))[0]
    near = np.argsort(np.linalg.norm(seen.positions_xy, axis=1))[:count]
    points, options = seen.positions_xy[near], [seen.hypotheses[i] for i in near]
    bad = rng.permutation(count)[: round(count * outliers)]
    strays = bad[len(bad) // 2 :]
    points[strays] = rng.uniform(-1, 1, (len(strays), 2)) * np.abs(points).max()
    for i in bad:
        options[i] = ((f"class {rng.integers(0, 3)}", 1.0),)
    ids = tuple(str(i) for i in range(count))
    return SceneObjects(0, "", ids, tuple(options), points, seen.covariances[near], np.zeros(count))


def among_decoys(rng: np.random.Generator, world: World, count: int) -> SceneObjects:
    """One object of each of some groups, each with two spurious ones beside it that keep its neighbours off."""
    groups = rng.permutation(int(world.group_of.max()) + 1)[:count]
    chosen = np.array([rng.choice(np.flatnonzero(world.group_of == group)) for group in groups])
    pose = pose_looking_at(rng, world.positions_xy.mean(axis=0), 0.0, 8.0)
    seen = scene(rng, world, pose, Sensor(), chosen)[0]
    way = rng.uniform(-np.pi, np.pi, 2 * count)
    decoys = np.repeat(seen.positions_xy, 2, axis=0) + rng.uniform(0.8, 1.2) * np.stack([np.cos(way), np.sin(way)], -1)
    classes = tuple(((f"class {label}", 1.0),) for label in rng.integers(0, 3, 2 * count))
    return SceneObjects(
        0,
        "",
        tuple(str(i) for i in range(3 * count)),
        seen.hypotheses + classes,
        np.concatenate([seen.positions_xy, decoys]),
        np.concatenate([seen.covariances, np.repeat(seen.covariances, 2, axis=0)]),
        np.zeros(3 * count),
    )


def best_place(matcher: Matcher, seen: SceneObjects) -> list[Pair]:
    """What the matcher brings together at the place where it matches most, accepted or not."""
    objects = matcher.objects(seen)
    joint = block_diagonal(objects.covariances[None])
    sets = matcher.sets(objects.points_xy[None], joint, objects.probabilities[None], objects.spurious[None])
    places = matcher.places(sets, matcher.candidates(sets, np.ones((1, len(seen)), dtype=np.bool_)))[0]
    found = [] if places is None else [list(enumerate(row)) for row in places.fits.candidates.landmarks.tolist()]
    matched = [[pair for pair in place if pair[1] != UNMATCHED] for place in found]
    return max(matched, key=len, default=[])


@pytest.mark.parametrize("count", [5, *(pytest.param(n, marks=pytest.mark.slow) for n in (7, 8, 9, 12, 16, 24))])
def test_as_many_inliers_as_the_maximum_clique(count: int) -> None:
    rng = np.random.default_rng(count)
    for _ in range(4):
        world = random_world(rng, 15)
        matcher = Matcher(MapIndex.build(world.landmark_map), LocalizeConfig())
        for _ in range(8):
            seen = bundle(rng, world, count, rng.uniform(0.2, 0.6))
            clique, matched = largest(world, seen), best_place(matcher, seen)
            assert len(matched) >= len(clique)
            # Of few objects several cliques may be as large; of many it is the same one, give or take a doubtful pair.
            assert len(clique) < 5 or len(set(clique) - set(matched)) <= 1


@pytest.mark.slow
def test_cliques_without_near_objects_are_found() -> None:
    rng = np.random.default_rng(3)
    for _ in range(12):
        world = random_world(rng, 15)
        matcher = Matcher(MapIndex.build(world.landmark_map), LocalizeConfig())
        seen = among_decoys(rng, world, 8)
        assert len(best_place(matcher, seen)) >= len(largest(world, seen)) >= 7
