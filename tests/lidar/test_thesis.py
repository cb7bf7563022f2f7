"""Algorithm 2 of the thesis."""

import numpy as np
import pytest
from mcap_landmarks.lidar import thesis


def test_the_view_is_cut_and_so_are_ranges() -> None:
    filtered = thesis.filter_view(np.full(360, 5.0))
    assert np.flatnonzero(np.isfinite(filtered)).tolist() == [*range(31), *range(330, 360)]
    assert np.isinf(thesis.filter_view(np.full(360, 0.4))).all()
    assert np.isinf(thesis.filter_view(np.full(360, 15.1))).all()


@pytest.mark.parametrize(
    ("ones", "middles"),
    [
        ([10, 11, 12], [11]),
        ([10, 11], [11]),
        ([358, 359, 0, 1, 2], [0]),
        ([5, 350, 351, 352, 20, 21, 22], [21, 5, 351]),
        ([], []),
    ],
)
def test_the_middle_beam_of_every_run_from_left_to_right(ones: list[int], middles: list[int]) -> None:
    pattern = np.zeros(360, dtype=np.bool_)
    pattern[ones] = True
    assert thesis.middle_beams(pattern).tolist() == middles


def test_indices_are_taken_for_degrees() -> None:
    ranges = np.full(360, np.inf)
    ranges[[20, 340]] = 2.0, 3.0
    places = thesis.places(ranges, np.array([20, 340]))
    x, y = np.cos(np.deg2rad(20.0)), np.sin(np.deg2rad(20.0))
    np.testing.assert_allclose(places, [[2 * x, 2 * y], [3 * x, -3 * y]])
