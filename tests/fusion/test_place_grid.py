"""The grid of places: finds everything near, and forgets what is gone."""

import numpy as np
from mcap_landmarks.fusion.place_grid import PlaceGrid


def test_everything_within_the_radius_is_found() -> None:
    """Against all distances, for many places and radii, also between cells and below zero."""
    rng = np.random.default_rng(1)
    places = rng.uniform(-20, 20, (300, 2))
    grid = PlaceGrid(4.0)
    for i, place in enumerate(places):
        grid.add(str(i), place)
    for centre, radius in zip(rng.uniform(-25, 25, (100, 2)), rng.uniform(0, 12, 100), strict=True):
        within = {str(i) for i in np.flatnonzero(np.hypot(*(places - centre).T) <= radius)}
        assert within <= grid.near(centre, radius)


def test_what_is_far_is_not_looked_at() -> None:
    grid = PlaceGrid(4.0)
    for i in range(-50, 50):
        grid.add(str(i), np.array([4.0 * i + 1.0, 0.0]))
    assert grid.near(np.array([1.0, 1.0]), 2.0) == {"-1", "0"}
    assert grid.near(np.array([2.0, 1.0]), 1.9) == {"0"}
    assert grid.near(np.array([2.0, -10.0]), 5.0) == set()
    assert len(grid.near(np.array([1.0, 0.0]), np.inf)) == 100


def test_a_thing_is_everywhere_it_was() -> None:
    grid = PlaceGrid(4.0)
    for x in (1.0, 9.0):
        grid.add("walker", np.array([x, 1.0]))
    assert grid.near(np.array([1.0, 1.0]), 0.5) == {"walker"}
    assert grid.near(np.array([9.0, 1.0]), 0.5) == {"walker"}


def test_what_is_removed_is_nowhere() -> None:
    grid = PlaceGrid(4.0)
    grid.add("one", np.array([1.0, 1.0]))
    grid.add("two", np.array([1.0, 1.0]))
    grid.remove("one")
    grid.remove("unknown")
    assert grid.near(np.zeros(2), 9.0) == {"two"}
    grid.remove("two")
    assert grid.near(np.zeros(2), np.inf) == set()


def test_places_pass_on_to_another_name() -> None:
    """That is also where it was before, and can be removed with all of them."""
    grid = PlaceGrid(4.0)
    grid.add("old", np.array([1.0, 1.0]))
    grid.add("new", np.array([9.0, 1.0]))
    grid.rename("old", "new")
    assert grid.near(np.array([1.0, 1.0]), 0.5) == {"new"}
    assert grid.near(np.array([9.0, 1.0]), 0.5) == {"new"}
    grid.rename("unknown", "new")
    grid.remove("new")
    assert grid.near(np.zeros(2), np.inf) == set()
