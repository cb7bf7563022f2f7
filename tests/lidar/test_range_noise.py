"""The noise of ranges as scans tell it: found where it is more than assumed, and never where it is not."""

from collections.abc import Iterator

import numpy as np
import pytest
from mcap_landmarks.lidar.beams import Beams, sweep
from mcap_landmarks.lidar.clustering import shapes_of
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.range_noise import with_noise

from tests.lidar.scans import ANGLES_RAD, box, disc, ranges

CONFIG = ClusterConfig()
SHAPES = shapes_of(CONFIG)


def scans(sigma_m: float, count: int) -> Iterator[tuple[int, Beams]]:
    """Scans of two discs and two boxes of known classes' sizes, a little elsewhere each time."""
    rng = np.random.default_rng(8)
    for number in range(count):
        x, y = rng.uniform(-0.5, 0.5, 2)
        things = [
            disc(3.0 + x, 0.6, 0.15),
            disc(-2.5, y, 0.2),
            box(2.5, y - 2.0, x, 0.5, 0.28),
            box(x, 3.0, y, 0.5, 0.28),
        ]
        exact = ranges(things)
        yield number, sweep(ANGLES_RAD, exact + rng.normal(0.0, sigma_m, len(exact)), np.eye(4))


def test_scans_that_are_noisier_than_assumed_say_so_from_the_first_on() -> None:
    found = [known.sigma_m for _, _, known in with_noise(scans(0.03, 70), SHAPES, CONFIG, lambda _: False)]
    assert len(found) == 70
    assert found[0] == pytest.approx(0.03, rel=0.3)
    assert found == [found[0]] * 70


@pytest.mark.parametrize("sigma_m", [0.002, 0.01])
def test_scans_as_good_as_assumed_or_better_change_nothing(sigma_m: float) -> None:
    known = [known for _, _, known in with_noise(scans(sigma_m, 66), SHAPES, CONFIG, lambda _: False)]
    assert all(one is CONFIG for one in known)


def test_large_scans_do_not_wait_for_one_another() -> None:
    given = []

    def noting() -> Iterator[tuple[int, Beams]]:
        for number, beams in scans(0.03, 40):
            given.append(number)
            yield number, beams

    found = with_noise(noting(), SHAPES, CONFIG, lambda _: True)
    assert next(found)[0] == 0
    assert given == [0]
    assert [known for _, _, known in found][-1].sigma_m == pytest.approx(0.03, rel=0.3)


def test_what_has_no_beams_is_let_through_in_its_place() -> None:
    mixed = [(0, next(scans(0.01, 1))[1]), (1, None), (2, None)]
    assert [number for number, *_ in with_noise(mixed, SHAPES, CONFIG, lambda _: False)] == [0, 1, 2]
