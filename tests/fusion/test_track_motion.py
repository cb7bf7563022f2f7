"""How fast a tracked object moves, and that nothing which stands is said to move."""

import numpy as np
import pytest
from mcap_landmarks.fusion.track_motion import TrackMotion, TrackPlace
from mcap_landmarks.geometry.se2 import Array

CAR_MPS, WALK_MPS = 10.0, 1.5


def followed(
    places: Array, sigma_m: float, usual_mps: float, period_s: float = 0.1, way_mps: float = 0.0
) -> TrackMotion:
    """The motion of something that was at places (N, 2), seen from a robot 15 m away."""
    motion = TrackMotion()
    for i, place in enumerate(places):
        stamp_ns = 10**9 + round(i * period_s * 1e9)
        seen = TrackPlace(stamp_ns, place, sigma_m**2 * np.eye(2), way_mps * i * period_s, 0.0, 15.0)
        motion.note(seen, usual_mps)
    return motion


def straight(velocity: tuple[float, float], count: int, period_s: float = 0.1) -> Array:
    return np.array([20.0, 3.0]) + np.arange(count)[:, None] * period_s * np.array(velocity)


def test_what_drives_past_is_as_fast_as_it_is() -> None:
    motion = followed(straight((-11.0, 2.0), 12), 0.3, CAR_MPS)
    assert motion.moving == 1
    assert motion.velocity is not None
    np.testing.assert_allclose(motion.velocity.xy_mps, [-11.0, 2.0], atol=1e-9)
    # Two places 1.1 s apart, each known to 0.3 m.
    np.testing.assert_allclose(motion.velocity.covariance, 2 * 0.3**2 / 1.1**2 * np.eye(2), rtol=1e-9)


def test_who_walks_moves_and_who_stands_does_not() -> None:
    rng = np.random.default_rng(4)
    wander = np.cumsum(rng.normal(0.0, 0.01, (20, 2)), axis=0)
    assert followed(straight((1.3, 0.0), 20), 0.12, WALK_MPS).moving == 1
    assert followed(straight((0.0, 0.0), 20) + wander, 0.12, WALK_MPS).moving < 0.5


def test_a_middle_that_wanders_as_more_of_a_car_is_seen_is_no_motion() -> None:
    """Half a metre in two seconds, known to 0.35 m: the far end of a parked car comes into view."""
    assert followed(straight((0.25, 0.0), 20), 0.35, CAR_MPS, way_mps=8.0).moving < 0.5


@pytest.mark.parametrize("usual_mps", [0.0, CAR_MPS])
def test_a_place_that_jumps_is_no_motion(usual_mps: float) -> None:
    """The boxes of a parked car that end are followed by those of the next one."""
    places = straight((0.0, 0.0), 32)
    places[6:] += [5.0, 0.0]
    assert followed(places[:12], 0.2, usual_mps).moving == 0.5  # here and there: nobody knows
    assert followed(places, 0.2, usual_mps).moving < 0.01


def test_one_place_that_is_off_does_not_hide_a_motion() -> None:
    """The first box of a car was of something else: 2 m off, and all others in a line."""
    places = straight((-9.2, 0.0), 20)
    places[0] += [-3.0, 1.5]
    motion = followed(places, 0.3, CAR_MPS)
    assert motion.moving == 1
    assert motion.velocity is not None
    np.testing.assert_allclose(motion.velocity.xy_mps, [-9.2, 0.0], atol=0.6)


def test_two_places_say_little_of_whether_something_moves() -> None:
    assert followed(straight((25.0, 0.0), 2), 0.1, CAR_MPS).moving == 0.3


def test_four_places_in_a_line_are_sure_and_three_are_probable() -> None:
    places = straight((10.0, 0.0), 4)
    assert 0.9 < followed(places[:3], 0.1, CAR_MPS).moving < 1
    assert followed(places, 0.1, CAR_MPS).moving == 1


def test_odometry_that_may_drift_makes_a_velocity_less_sure() -> None:
    still = straight((0.4, 0.0), 20)
    assert followed(still, 0.02, WALK_MPS).moving == 1
    assert followed(still, 0.02, WALK_MPS, way_mps=15.0).moving < 0.5


def test_what_stopped_has_moved() -> None:
    """A car that waits at a light is no landmark: it came, and will go."""
    places = np.concatenate([straight((8.0, 0.0), 10), np.tile(straight((8.0, 0.0), 10)[-1], (40, 1))])
    motion = followed(places, 0.3, CAR_MPS)
    assert motion.moving == 1
    assert motion.velocity is not None
    np.testing.assert_allclose(motion.velocity.xy_mps, [0.0, 0.0], atol=1e-9)


def test_one_place_says_no_velocity() -> None:
    assert followed(straight((1.0, 0.0), 1), 0.1, WALK_MPS).velocity is None
