"""The search index: what it finds, and what of it is kept with a large map."""

import dataclasses
import sqlite3
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.localization.index import MapIndex, first_corner, side_lengths
from mcap_landmarks.maps import database
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.maps.neighbours import Neighbours

from tests.benchmark.worlds import random_world


@pytest.fixture
def landmark_map() -> LandmarkMap:
    return random_world(np.random.default_rng(1), 6).landmark_map


def test_every_triangle_of_a_small_map_once_and_counter_clockwise(landmark_map: LandmarkMap) -> None:
    index = MapIndex.build(landmark_map)
    triangles = index.triangles
    assert {frozenset(row) for row in triangles.tolist()} == {frozenset(c) for c in combinations(range(18), 3)}
    assert len(triangles) == 18 * 17 * 16 // 6
    corner = index.positions_xy[triangles]
    u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    assert (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] >= 0).all()
    classes = index.class_of[triangles]
    for turn in (1, 2):
        turned = np.roll(classes, -turn, axis=1)
        assert all(tuple(a) <= tuple(b) for a, b in zip(classes.tolist(), turned.tolist(), strict=True))


def test_lookups_find_what_a_search_of_all_finds(landmark_map: LandmarkMap) -> None:
    index, rng = MapIndex.build(landmark_map), np.random.default_rng(2)
    sides = side_lengths(index.positions_xy[index.triangles])
    lengths = side_lengths(index.positions_xy[index.pairs])[:, 0]
    for tolerance in (0.05, 0.5, 100.0):
        row = int(rng.integers(len(sides)))
        classes = index.class_of[index.triangles[row]]
        query = sides[row] + rng.uniform(-0.04, 0.04, 3)
        same = (index.class_of[index.triangles] == classes).all(axis=1)
        near = same & (np.abs(sides - query) <= tolerance).all(axis=1)
        found = index.find_triangles(query[None], classes[None], np.array([tolerance]))
        assert {frozenset(hit) for hit in found.landmarks.tolist()} >= {
            frozenset(t) for t in index.triangles[near].tolist()
        }
        pair = int(rng.integers(len(lengths)))
        classes = index.class_of[index.pairs[pair]]
        same = (index.class_of[index.pairs] == classes).all(axis=1) & (np.abs(lengths - lengths[pair]) <= tolerance)
        hits = index.find_pairs(lengths[[pair]], classes[None], np.array([tolerance]), 10**6)
        assert {frozenset(hit) for hit in hits.landmarks.tolist()} == {frozenset(p) for p in index.pairs[same].tolist()}
        assert not len(
            index.find_pairs(lengths[[pair]], classes[None], np.array([tolerance]), int(same.sum()) // 2).query
        )


def test_large_maps_keep_their_neighbours(
    landmark_map: LandmarkMap, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database, "_LARGE", 10)
    first, second = tmp_path / "a.db", tmp_path / "b.db"
    for path in (first, second):
        database.write_map(path, landmark_map)
    assert first.read_bytes() == second.read_bytes()
    read = database.read_map(first)
    kept = database.read_neighbours(first, read)
    assert kept is not None
    fresh = Neighbours.of_map(read)
    np.testing.assert_array_equal(kept.triangles, fresh.triangles)
    np.testing.assert_array_equal(kept.pairs, fresh.pairs)
    np.testing.assert_array_equal(MapIndex.build(read, kept).triangles, MapIndex.build(read).triangles)


def test_neighbours_that_do_not_fit_are_left_alone(
    landmark_map: LandmarkMap, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = tmp_path / "small.db"
    database.write_map(small, landmark_map)
    assert database.read_neighbours(small, landmark_map) is None
    monkeypatch.setattr(database, "_LARGE", 10)
    changed = tmp_path / "changed.db"
    database.write_map(changed, landmark_map)
    moved = dataclasses.replace(landmark_map, positions_xy=landmark_map.positions_xy + 1e-6)
    assert database.read_neighbours(changed, moved) is None
    with sqlite3.connect(changed) as connection:
        connection.execute("DROP TABLE search_index")  # as in a database of an older version
    connection.close()
    assert database.read_neighbours(changed, landmark_map) is None


def test_groups_come_in_the_order_of_the_query(landmark_map: LandmarkMap) -> None:
    """Classes and sides of what is found are those that were asked for, corner by corner."""
    index = MapIndex.build(landmark_map)
    rng = np.random.default_rng(5)
    for _ in range(20):
        corners = index.triangles[rng.integers(len(index.triangles))].astype(np.int64)
        corners = np.roll(corners, rng.integers(3))
        sides = side_lengths(index.positions_xy[corners])
        found = index.find_triangles(sides[None], index.class_of[corners][None], np.array([0.01])).landmarks
        assert corners.tolist() in found.tolist()
        for hit in found:
            np.testing.assert_array_equal(index.class_of[hit], index.class_of[corners])
            np.testing.assert_allclose(side_lengths(index.positions_xy[hit]), sides, atol=0.01)
        pair = rng.permutation(index.pairs[rng.integers(len(index.pairs))].astype(np.int64))
        length = side_lengths(index.positions_xy[pair])[:1]
        found = index.find_pairs(length, index.class_of[pair][None], np.array([0.01]), 10**6).landmarks
        assert pair.tolist() in found.tolist()
        for hit in found:
            np.testing.assert_array_equal(index.class_of[hit], index.class_of[pair])


def test_several_queries_at_once_are_told_apart(landmark_map: LandmarkMap) -> None:
    index = MapIndex.build(landmark_map)
    corners = index.triangles[[3, 50, 400]].astype(np.int64)
    sides, classes = side_lengths(index.positions_xy[corners]), index.class_of[corners]
    hits = index.find_triangles(sides, classes, np.full(3, 0.01))
    for number in range(3):
        assert corners[number].tolist() in hits.landmarks[hits.query == number].tolist()
    unknown = index.find_triangles(sides[:1] + 1e3, classes[:1], np.array([0.01]))
    assert len(unknown.query) == 0


def test_what_the_index_knows_of_the_map(landmark_map: LandmarkMap) -> None:
    index = MapIndex.build(landmark_map)
    apart = np.linalg.norm(index.positions_xy[:, None] - index.positions_xy, axis=-1)
    assert index.extent_m[0] == pytest.approx(apart[apart > 0].min(), rel=1e-12)
    assert index.extent_m[1] == pytest.approx(np.linalg.norm(np.ptp(index.positions_xy, axis=0)), rel=1e-12)
    assert index.class_pair_count == 6  # of three classes, each with itself as well
    assert (len(index), index.small) == (18, True)
    some = dataclasses.replace(landmark_map, tentative=np.arange(18) % 3 == 0)
    np.testing.assert_array_equal(MapIndex.build(some).rows, np.flatnonzero(np.arange(18) % 3))


def test_the_first_corner_is_that_from_which_classes_read_lowest() -> None:
    classes = np.array([[0, 1, 2], [2, 0, 1], [1, 2, 0], [1, 1, 0], [0, 0, 0]])
    np.testing.assert_array_equal(first_corner(classes, 3), [0, 1, 2, 2, 0])
