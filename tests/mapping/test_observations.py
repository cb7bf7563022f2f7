"""What one log saw: which objects belong to a bundle, and how they stand from left to right."""

import numpy as np
from mcap_landmarks.mapping.observations import left_to_right

from tests.mapping.drives import as_observed, drive, landmarks_beside


def test_objects_of_a_bundle_are_its_rows() -> None:
    log = as_observed(drive(landmarks_beside(6.0, 12, 0), 6.0, 0, laps=0.1), ("a",) * 12)
    rows = [log.objects_of(i).tolist() for i in range(len(log.stamps_ns))]
    assert [row for of_bundle in rows for row in of_bundle] == list(range(len(log.bundle)))
    assert all((log.bundle[of_bundle] == i).all() for i, of_bundle in enumerate(rows))


def test_objects_are_ordered_from_left_to_right() -> None:
    ahead = np.array([[4.0, -1.0], [4.0, 2.0], [4.0, 0.5]])
    assert left_to_right(ahead).tolist() == [1, 2, 0]
    behind = np.array([[-4.0, 1.0], [-4.0, -0.5], [-4.0, 2.0]])  # their bearings are on both sides of 180 degrees
    assert left_to_right(behind).tolist() == [1, 0, 2]
    aside = np.array([[-1.7, -1.0], [-1.0, -1.7], [-1.2, -1.2]])  # behind to the right, as seen when looking there
    assert left_to_right(aside).tolist() == [1, 2, 0]
