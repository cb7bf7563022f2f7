"""Objects of a scan: which segments belong together, and what each could be."""

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.lidar import shapes
from mcap_landmarks.lidar.beams import Beams, sweep, together
from mcap_landmarks.lidar.cells import Noise
from mcap_landmarks.lidar.objects import Hypotheses, objects
from mcap_landmarks.lidar.segments import Breaks, near_clusters, segments
from mcap_landmarks.lidar.shapes import Shape

from tests.lidar.scans import ANGLES_RAD, SIGMA_M, Thing, box, disc, legs, ranges

KINDS: dict[str, tuple[Shape, ...]] = {
    "hydrant": (shapes.disc(0.15),),
    "person": (shapes.legs(0.06, (0.16, 0.36)), shapes.disc(0.25)),
    "suitcase": (shapes.box(0.5, 0.28),),
    "bench": (Shape(boxes=((0.0, 0.58, 0.38, 0.07), (0.0, -0.58, 0.38, 0.07)), turn_rad=np.pi),),
}


def scanned(things: list[Thing], seed: int = 1, lidar: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Beams:
    mounted = np.eye(4)
    c, s = np.cos(lidar[2]), np.sin(lidar[2])
    mounted[:2, :2], mounted[:2, 3] = [[c, -s], [s, c]], lidar[:2]
    distances = ranges(things, np.random.default_rng(seed), base_from_lidar=np.array(lidar))
    return sweep(ANGLES_RAD, distances, mounted)


def explained(beams: Beams) -> list[Hypotheses]:
    found = segments(beams, Breaks(np.deg2rad(10.0), SIGMA_M, 0.3), 2.0)
    return objects(beams, near_clusters(beams, found, 0.13), KINDS, Noise())


def centre(found: Hypotheses, name: str) -> Array:
    return found.positions_xy[found.names.index(name)]


def test_hypotheses_are_ranked_and_sum_to_one() -> None:
    (found,) = explained(scanned([disc(3.0, 1.0, 0.15)]))
    assert found.names[0] == "hydrant"
    assert found.names[-1] == ""
    assert found.shares.sum() == pytest.approx(1.0)
    assert (np.diff(found.shares[:-1]) <= 0).all()
    assert found.shares[0] > 0.9
    assert "person" not in found.names[:1]
    np.testing.assert_allclose(centre(found, "hydrant"), [3.0, 1.0], atol=0.02)
    for covariance in found.covariances:
        assert (np.linalg.eigvalsh(covariance) > 0).all()
    surface = found.positions_xy[-1]
    assert np.hypot(*surface) == pytest.approx(np.hypot(3.0, 1.0) - 0.15, abs=0.03)


@pytest.mark.parametrize("away_m", [1.2, 2.0, 4.0])
def test_two_legs_are_one_person(away_m: float) -> None:
    for heading in (0.0, 0.5, 1.2):
        (found,) = explained(scanned(legs(away_m, 0.5, heading, 0.34)))
        assert found.names[0] == "person" or away_m > 2  # from afar a few hits may be anything's
        np.testing.assert_allclose(centre(found, "person"), [away_m, 0.5], atol=0.06)


def test_the_feet_of_a_bench_are_one_bench() -> None:
    pose = np.array([3.0, -1.0, 0.7])
    feet = [box(*transform_points(pose, [0.0, side * 0.58]).tolist(), 0.7, 0.38, 0.07) for side in (1, -1)]
    (found,) = explained(scanned(feet))
    assert found.names[0] == "bench"
    np.testing.assert_allclose(centre(found, "bench"), pose[:2], atol=0.02)


@pytest.mark.parametrize("gap_m", [0.5, 0.8, 1.2])
def test_neighbours_stay_apart(gap_m: float) -> None:
    things = [disc(4.0, 0.0, 0.15), disc(4.0, 0.3 + gap_m, 0.15)]
    found = explained(scanned(things))
    assert len(found) == 2
    assert {one.names[0] for one in found} == {"hydrant"}


def test_what_no_shape_explains_is_rather_none() -> None:
    (found,) = explained(scanned([box(2.0, 0.0, 0.9, 1.2, 0.05)]))
    assert found.shares[-1] == max(found.shares)


def test_two_lidars_see_one_thing() -> None:
    things = [disc(2.0, 0.6, 0.25)]
    both = together([scanned(things, 1, (0.3, 0.0, 0.0)), scanned(things, 2, (-0.3, 0.0, 3.0))])
    (found,) = explained(both)
    assert found.names[0] == "person"
    np.testing.assert_allclose(centre(found, "person"), [2.0, 0.6], atol=0.015)
    (alone,) = explained(scanned(things, 1, (0.3, 0.0, 0.0)))
    first = found.names.index("person"), alone.names.index("person")
    assert np.linalg.det(found.covariances[first[0]]) < np.linalg.det(alone.covariances[first[1]])


def test_from_opposite_sides_too() -> None:
    things = [box(0.0, 2.0, 0.2, 0.5, 0.28)]
    both = together([scanned(things, 1, (0.0, 0.0, 0.0)), scanned(things, 2, (0.0, 4.0, 0.0))])
    (found,) = explained(both)
    assert found.names[0] == "suitcase"
    np.testing.assert_allclose(centre(found, "suitcase"), [0.0, 2.0], atol=0.015)


def test_without_shapes_only_surfaces_remain() -> None:
    beams = scanned([disc(3.0, 1.0, 0.15)])
    found = segments(beams, Breaks(np.deg2rad(10.0), SIGMA_M, 0.3), 2.0)
    (one,) = objects(beams, near_clusters(beams, found, 0.13), {}, Noise())
    assert one.names == ("",)
    assert one.shares.tolist() == [1.0]


def test_an_empty_scan_has_no_objects() -> None:
    assert explained(scanned([])) == []
