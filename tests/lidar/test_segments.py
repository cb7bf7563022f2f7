"""Segments: across the seam of a scan, single hits, walls and what stands before them."""

import numpy as np
from mcap_landmarks.lidar.beams import Beams, sweep
from mcap_landmarks.lidar.segments import Breaks, Cluster, extent_m, near_clusters, points_of, segments

from tests.lidar.scans import ANGLES_RAD, Thing, box, disc, legs, ranges

BREAKS = Breaks(np.deg2rad(10.0), 0.01, 0.3)


def found(things: list[Thing], largest_m: float = 1.0) -> tuple[Beams, list[Cluster]]:
    beams = sweep(ANGLES_RAD, ranges(things, np.random.default_rng(1)), np.eye(4))
    return beams, near_clusters(beams, segments(beams, BREAKS, largest_m), 0.13)


def test_each_thing_is_a_segment_wherever_it_stands() -> None:
    for bearing in np.linspace(-np.pi, np.pi, 13):
        direction = np.array([np.cos(bearing), np.sin(bearing)])
        things = [disc(*(4 * direction), 0.2), disc(*(6 * direction[::-1] * [1, -1]), 0.2)]
        _, clusters = found(things)
        assert len(clusters) == 2, bearing


def test_a_thing_of_one_hit_counts() -> None:
    away = 9.0 * np.array([np.cos(ANGLES_RAD[50]), np.sin(ANGLES_RAD[50])])
    beams, clusters = found([disc(*away.tolist(), 0.07)])
    assert len(clusters) == 1
    assert len(points_of(beams, clusters[0])) == 1


def test_a_lost_beam_does_not_cut_a_thing() -> None:
    distances = ranges([disc(3.0, 0.0, 0.25)])
    hit = np.flatnonzero(np.isfinite(distances))
    distances[hit[len(hit) // 3]] = np.inf
    beams = sweep(ANGLES_RAD, distances, np.eye(4))
    assert len(segments(beams, BREAKS, 1.0)) == 1


def test_walls_are_background_and_what_stands_before_them_is_not() -> None:
    wall = box(4.5, 0.0, 0.0, 0.2, 9.0)
    beams, clusters = found([wall, disc(3.0, 0.5, 0.15), disc(3.7, -1.0, 0.15)])
    assert len(clusters) == 2
    for cluster in clusters:
        assert extent_m(points_of(beams, cluster)) < 0.35
    beams, clusters = found([wall])
    assert not clusters


def test_a_room_all_around_is_background() -> None:
    walls = [box(3, 0, 0, 0.1, 6.1), box(-3, 0, 0, 0.1, 6.1), box(0, 3, 0, 6.1, 0.1), box(0, -3, 0, 6.1, 0.1)]
    _, clusters = found(walls)
    assert not clusters
    _, clusters = found([*walls, disc(1.5, 1.0, 0.2)])
    assert len(clusters) == 1


def test_what_is_near_together_is_one_whatever_lies_behind() -> None:
    wall = box(6.0, 0.0, 0.0, 0.2, 9.0)
    _, clusters = found([wall, *legs(2.0, 0.0, 0.0, 0.17)])
    assert len(clusters) == 1
    _, clusters = found([wall, *legs(2.0, 0.0, 0.0, 0.40)])
    assert len(clusters) == 2


def test_nothing_seen_is_no_segment() -> None:
    beams = sweep(ANGLES_RAD, np.full(360, np.inf), np.eye(4))
    assert segments(beams, BREAKS, 1.0) == []
