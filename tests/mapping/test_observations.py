"""What one log saw: which objects belong to a bundle, and how they stand from left to right."""

from dataclasses import replace

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


def test_pieces_have_their_own_bundles_and_objects_and_the_fullest_is_first() -> None:
    log = as_observed(drive(landmarks_beside(6.0, 12, 0), 6.0, 0, laps=0.2), ("a",) * 12)
    count = len(log.stamps_ns)
    cut = count // 3
    pieces = replace(log, piece=(np.arange(count) >= cut).astype(np.int64)).pieces()
    assert [len(piece.stamps_ns) for piece in pieces] == [count - cut, cut]
    assert sum(len(piece.bundle) for piece in pieces) == len(log.bundle)
    for piece, first in zip(pieces, (cut, 0), strict=True):
        np.testing.assert_array_equal(piece.odom_from_base, log.odom_from_base[first : first + len(piece.stamps_ns)])
        np.testing.assert_array_equal(piece.points_xy[piece.objects_of(0)], log.points_xy[log.objects_of(first)])
    assert [piece.bundles for piece in pieces] == [log.bundles, 0]


def test_a_piece_that_saw_nothing_is_left_out_and_one_piece_is_the_log() -> None:
    log = as_observed(drive(landmarks_beside(6.0, 12, 0), 6.0, 0, laps=0.1), ("a",) * 12)
    assert log.pieces() == [log]
    count = len(log.stamps_ns)
    seen = log.bundle < count // 2
    blind = replace(
        log,
        bundle=log.bundle[seen],
        classes=log.classes[: seen.sum()],
        points_xy=log.points_xy[seen],
        covariances=log.covariances[seen],
        radii_m=log.radii_m[seen],
        piece=(np.arange(count) >= count // 2).astype(np.int64),
    )
    assert [len(piece.stamps_ns) for piece in blind.pieces()] == [count // 2]
