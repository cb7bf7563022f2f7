"""The search index: what it finds, and what of it is kept with a large map."""

import dataclasses
import sqlite3
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.localization.index import MapIndex, side_lengths
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
