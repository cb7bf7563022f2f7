"""Points of a cloud are of one cluster if they are of one thing."""

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.cloud_clusters import BACKGROUND, cloud_clusters

from tests.lidar.clouds import AHEAD, ALL_AROUND, SIXTEEN, Solid, cloud


def clustered(solids: list[Solid], directions: Array = AHEAD) -> tuple[Array, Array]:
    """What the points of solids are of, and their clusters."""
    points, owner = cloud(solids, directions)
    stands = (owner >= 0) & (points[:, 2] > 0.25)
    labels, _ = cloud_clusters(points[stands, :2], points[stands, 2], 4)
    return owner[stands], labels


def of(owner: Array, labels: Array, solid: int) -> set[int]:
    return {int(label) for label in labels[owner == solid]} - {BACKGROUND}


@pytest.mark.parametrize("directions", [AHEAD, SIXTEEN], ids=["64 rings", "16 rings"])
@pytest.mark.parametrize("x", [6.0, 15.0, 30.0])
def test_a_car_is_one_cluster_near_and_far(x: float, directions: Array) -> None:
    owner, labels = clustered([Solid(x, 1.0, 4.2, 1.7, 1.5, 0.3)], directions)
    found, counts = np.unique(labels[labels != BACKGROUND], return_counts=True)
    assert counts.max() >= 0.9 * len(owner), found


@pytest.mark.parametrize(("x", "apart_m"), [(5.0, 0.9), (12.0, 1.2), (25.0, 2.0)])
def test_two_people_beside_each_other_are_two(x: float, apart_m: float) -> None:
    people = [Solid(x, side * apart_m / 2, 0.4, 0.4, 1.7) for side in (1, -1)]
    owner, labels = clustered(people)
    assert not of(owner, labels, 0) & of(owner, labels, 1)


def test_what_is_above_a_car_is_not_of_it() -> None:
    owner, labels = clustered(
        [Solid(10.0, 0.0, 4.2, 1.7, 1.4), Solid(10.0, 0.0, 3.0, 3.0, 1.0, above_m=3.0)], ALL_AROUND
    )
    assert not of(owner, labels, 0) & of(owner, labels, 1)


def test_a_wall_behind_the_robot_is_one() -> None:
    owner, labels = clustered([Solid(-8.0, 0.0, 0.3, 6.0, 2.0)], ALL_AROUND)
    assert of(owner, labels, 0) == {0}


def test_the_order_of_points_does_not_matter() -> None:
    points, owner = cloud([Solid(9.0, 2.0, 4.2, 1.7, 1.5), Solid(7.0, -3.0, 0.4, 0.4, 1.7)])
    points = points[owner >= 0]
    order = np.random.default_rng(3).permutation(len(points))
    labels, count = cloud_clusters(points[:, :2], points[:, 2], 4)
    shuffled, again = cloud_clusters(points[order, :2], points[order, 2], 4)
    assert count == again
    np.testing.assert_array_equal(shuffled, labels[order])


def test_few_points_and_far_ones_are_background() -> None:
    places = np.array([[5.0, 0.0], [5.0, 0.1], [500.0, 0.0], [500.0, 0.1], [500.0, 0.2], [500.0, 0.3]])
    labels, count = cloud_clusters(places, np.ones(6), 4)
    assert count == 0
    assert set(labels) == {BACKGROUND}
    assert cloud_clusters(np.zeros((0, 2)), np.zeros(0), 4)[1] == 0
