"""A small map that several tests use, and how to compare maps."""

import numpy as np
from mcap_landmarks.maps.model import Group, LandmarkMap, MapSource


def small_map() -> LandmarkMap:
    """Four landmarks, one of them tentative, in two groups."""
    return LandmarkMap(
        ids=("a", "b", "c", "d"),
        classes=("fire hydrant", "person", "suitcase", "person"),
        positions_xy=np.array([[1.0, 2.0], [3.5, -4.25], [0.1, 1 / 3], [9.0, 9.0]]),
        covariances=np.array([[[0.04, 0.01], [0.01, 0.09]], np.zeros((2, 2)), np.eye(2), np.eye(2) * 0.3]),
        radii_m=np.array([0.15, 0.25, 0.0, 0.25]),
        sightings=np.array([12, 3, 0, 1]),
        tentative=np.array([False, False, False, True]),
        groups=(
            Group(("a", "b", "c"), np.array([0.0, -8.0, 1.5]), np.diag([0.01, 0.02, 0.003])),
            Group(("c", "b"), np.array([1.0, 8.0, -1.5])),
        ),
        sources=(MapSource("recording", "f00d", 40, 38), MapSource("import", "beef")),
    )


def assert_same_map(found: LandmarkMap, expected: LandmarkMap) -> None:
    """Every field equal, arrays to the bit."""
    for name in ("ids", "classes", "sources", "frame"):
        assert getattr(found, name) == getattr(expected, name), name
    for name in ("positions_xy", "covariances", "radii_m", "sightings", "tentative"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)
    assert [group.landmark_ids for group in found.groups] == [group.landmark_ids for group in expected.groups]
    for mine, other in zip(found.groups, expected.groups, strict=True):
        np.testing.assert_array_equal(mine.map_from_base, other.map_from_base)
        assert (mine.covariance is None) == (other.covariance is None)
        if mine.covariance is not None:
            np.testing.assert_array_equal(mine.covariance, other.covariance)
