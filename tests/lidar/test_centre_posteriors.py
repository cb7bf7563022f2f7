"""Centres of ideal shapes: as near to the truth as their hits and misses allow, with covariances that say so."""

from collections.abc import Iterator

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import Array, rotation
from mcap_landmarks.lidar import shapes
from mcap_landmarks.lidar.beams import sweep
from mcap_landmarks.lidar.cells import Noise
from mcap_landmarks.lidar.centre_posteriors import CentrePosteriors, centres
from mcap_landmarks.lidar.segments import Breaks, points_of, segments
from mcap_landmarks.lidar.shapes import Shape, profile
from mcap_landmarks.lidar.windows import windows

from tests.lidar.scans import ANGLES_RAD, Thing, box, disc, legs, ranges

BREAKS = Breaks(np.deg2rad(10.0), 0.01, 5.0)
CASES = 40


def placed(kind: str, x: float, y: float, rng: np.random.Generator) -> list[Thing]:
    heading = float(rng.uniform(0, 2 * np.pi))
    if kind == "disc":
        return [disc(x, y, 0.15)]
    if kind == "box":
        return [box(x, y, heading, 0.5, 0.28)]
    return legs(x, y, heading, float(rng.uniform(0.16, 0.32)))


KINDS = {"disc": shapes.disc(0.15), "box": shapes.box(0.5, 0.28), "legs": shapes.legs(0.06, (0.16, 0.32))}


def estimates(kind: str, near_m: float, far_m: float) -> Iterator[tuple[Array, CentrePosteriors]]:
    """True centres and what is made of one scan each, from all sides."""
    rng = np.random.default_rng(7)
    for _ in range(CASES):
        away, bearing = rng.uniform(near_m, far_m), rng.uniform(0, 2 * np.pi)
        centre = away * np.array([np.cos(bearing), np.sin(bearing)])
        beams = sweep(ANGLES_RAD, ranges(placed(kind, *centre.tolist(), rng), rng), np.eye(4))
        cluster = tuple(segments(beams, BREAKS, 2.0))
        if cluster:
            yield centre, centres(windows(beams, [cluster]), [KINDS[kind]], Noise())


# Medians in m; targets.md has 0.005 and 0.010 for the disc, 0.006 and 0.013 for the box, 0.008 and 0.046 for legs.
@pytest.mark.parametrize(
    ("kind", "near_m", "far_m", "median_m"),
    [
        ("disc", 2, 4, 0.007),
        ("disc", 8, 10, 0.014),
        ("box", 2, 4, 0.008),
        ("box", 8, 10, 0.018),
        ("legs", 2, 4, 0.011),
        ("legs", 6, 8, 0.045),
    ],
)
def test_centres_are_near_the_truth_and_know_it(kind: str, near_m: float, far_m: float, median_m: float) -> None:
    errors, nees = [], []
    for centre, found in estimates(kind, near_m, far_m):
        off = found.positions_xy[0, 0] - centre
        assert np.isfinite(found.log_evidence[0, 0])
        errors.append(np.hypot(*off))
        nees.append(off @ np.linalg.solve(found.covariances[0, 0], off) / 2)
    assert len(errors) > 0.9 * CASES
    assert np.median(errors) < median_m
    assert 0.35 < np.mean(nees) < 1.8


@pytest.mark.parametrize("kind", KINDS)
def test_the_true_shape_explains_a_thing_best(kind: str) -> None:
    rng = np.random.default_rng(3)
    kinds = [*KINDS.values(), shapes.disc(0.4)]
    right = 0
    for bearing in np.linspace(0, 6, 10):
        things = placed(kind, 2.5 * np.cos(bearing), 2.5 * np.sin(bearing), rng)
        beams = sweep(ANGLES_RAD, ranges(things, rng), np.eye(4))
        cluster = tuple(segments(beams, BREAKS, 2.0))
        evidence = centres(windows(beams, [cluster]), kinds, Noise()).log_evidence[0]
        right += int(np.argmax(evidence)) == list(KINDS).index(kind)
        assert np.isinf(evidence[3])  # beams pass on both sides of where so large a disc would have to be
    assert right >= 8


def test_the_bounding_misses_tell_where_a_thing_of_one_hit_is() -> None:
    """A hit leaves the disc's bearing open by its width; the beams that miss it on either side do not."""
    distances = np.full(360, np.inf)
    distances[90] = 9.85
    turn = rotation(ANGLES_RAD[90])
    beams = sweep(ANGLES_RAD, distances, np.eye(4))
    cluster = tuple(segments(beams, BREAKS, 1.0))
    found = centres(windows(beams, [cluster]), [shapes.disc(0.15)], Noise())
    np.testing.assert_allclose(found.positions_xy[0, 0] @ turn, [9.99, 0.0], atol=0.02)
    away, across = np.sqrt(np.diag(turn.T @ found.covariances[0, 0] @ turn))
    assert away < 0.02
    assert across < 0.03


def test_what_beams_pass_through_has_holes_or_is_none() -> None:
    rng = np.random.default_rng(5)
    feet = [box(4.0, side * 0.58, np.pi / 2, 0.07, 0.38) for side in (1, -1)]
    beams = sweep(ANGLES_RAD, ranges(feet, rng), np.eye(4))
    cluster = tuple(segments(beams, BREAKS, 2.0))
    bench = Shape(boxes=((0.0, 0.58, 0.38, 0.07), (0.0, -0.58, 0.38, 0.07)), turn_rad=np.pi)
    evidence = centres(windows(beams, [cluster]), [bench, shapes.box(1.6, 1.0)], Noise()).log_evidence[0]
    assert len(cluster) == 2
    assert np.isfinite(evidence[0])
    assert np.isinf(evidence[1])


def test_an_occluded_side_leaves_the_centre_open_there() -> None:
    rng = np.random.default_rng(0)
    thing = disc(5.0, 0.0, 0.25)
    free, hidden = ([thing], [thing, box(2.0, 0.5, 0.0, 0.1, 0.94)])
    spread = []
    for things in (free, hidden):
        beams = sweep(ANGLES_RAD, ranges(things, rng), np.eye(4))
        cluster = next((s,) for s in segments(beams, BREAKS, 2.0) if points_of(beams, (s,))[:, 0].min() > 4)
        found = centres(windows(beams, [cluster]), [shapes.disc(0.25)], Noise())
        off = found.positions_xy[0, 0] - [5.0, 0.0]
        assert off @ np.linalg.solve(found.covariances[0, 0], off) < 12
        spread.append(np.sqrt(found.covariances[0, 0, 1, 1]))
    assert spread[1] > 1.3 * spread[0]


def test_a_finer_lidar_and_many_hits() -> None:
    angles = np.linspace(0.0, 2 * np.pi, 3600, endpoint=False)
    rng = np.random.default_rng(2)
    beams = sweep(angles, ranges([box(1.5, 0.3, 0.4, 0.5, 0.28)], rng, angles), np.eye(4))
    cluster = tuple(segments(beams, BREAKS, 2.0))
    found = centres(windows(beams, [cluster]), [shapes.box(0.5, 0.28)], Noise())
    np.testing.assert_allclose(found.positions_xy[0, 0], [1.5, 0.3], atol=0.015)


@pytest.mark.parametrize(
    ("shape", "heading", "offset", "depth"),
    [
        (shapes.disc(0.2), 0.0, 0.0, -0.2),
        (shapes.disc(0.2), 0.0, 0.12, -0.16),
        (shapes.box(0.5, 0.3), 0.0, 0.0, -0.25),
        (shapes.box(0.5, 0.3), np.pi / 2, 0.1, -0.15),
        (shapes.box(0.5, 0.3, 0.05), 0.0, 0.1, -0.25),
        (shapes.legs(0.06, (0.3, 0.3)), 0.0, 0.15, -0.06),
        (shapes.legs(0.06, (0.3, 0.3)), 0.0, 0.0, np.inf),
        (shapes.legs(0.06, (0.3, 0.3)), np.pi / 2, 0.0, -0.21),
    ],
)
def test_profiles(shape: Shape, heading: float, offset: float, depth: float) -> None:
    shown = profile(shape)
    _, turns, offsets = shown.depths_m.shape
    column = round(offset / shown.step_m) + offsets // 2
    row = round(heading / shape.turn_rad * turns) % turns if shape.turn_rad else 0
    np.testing.assert_allclose(shown.depths_m[0, row, column], depth, atol=0.006)


def test_least_widths() -> None:
    assert profile(shapes.box(0.5, 0.28)).least_width_m == pytest.approx(0.28, abs=0.01)
    assert profile(shapes.disc(0.2)).least_width_m == pytest.approx(0.4, abs=0.01)
    assert profile(shapes.legs(0.06, (0.16, 0.32))).least_width_m == 0.0
