"""The velocities of a scene's objects, and which objects of a new scan are which of the scan before."""

import numpy as np
import pytest
from mcap_landmarks.fusion.object_motions import ObjectMotions
from mcap_landmarks.geometry.se2 import Array, inverse, transform_points
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.velocities import SceneVelocities
from mcap_landmarks.stage import OdometryAt

SPREAD = 0.04 * np.eye(2)
PERIOD_NS = 10**8


class Follower:
    """Names and follows objects of a robot that drives along x at 5 m/s, turned to the left."""

    def __init__(self) -> None:
        self.motions, self.stamp_ns = ObjectMotions(), 10**9

    def see(
        self, places: list[tuple[str, float, float]], *, widen: bool = False
    ) -> tuple[tuple[str, ...], SceneVelocities | None]:
        """Objects (class, x, y in the world) of the next scan: their ids and velocities."""
        self.stamp_ns += PERIOD_NS
        base = np.array([5.0 * (self.stamp_ns - 10**9) / 1e9, 0.0, np.pi / 2])
        points: Array = transform_points(inverse(base), np.array([place[1:] for place in places]).reshape(-1, 2))
        classes, spreads = tuple(place[0] for place in places), np.tile(SPREAD, (len(places), 1, 1))
        names = self.motions.names(self.stamp_ns, base, (points, spreads), classes)
        if widen:
            spreads = spreads * self.motions.surprises(self.stamp_ns, base, (points, spreads), names)[:, None, None]
        scene = SceneObjects(
            self.stamp_ns,
            "base",
            names,
            tuple(((name, 0.9),) for name in classes),
            points,
            spreads,
            np.ones(len(names)),
        )
        way_m = 5.0 * (self.stamp_ns - 10**9) / 1e9
        return names, self.motions.add(scene, OdometryAt("odom", base, np.zeros((3, 3)), way_m, 0.0))


def test_a_car_that_drives_keeps_its_id_and_has_its_velocity() -> None:
    follower = Follower()
    for i in range(10):
        names, velocities = follower.see([("car", 40.0 - 1.2 * i, 2.0), ("car", 20.0, -4.0)])
        assert names == ("1", "2")
    assert velocities is not None
    assert velocities.ids == ("1", "2")
    assert velocities.moving.tolist() == [1.0, 0.0]
    assert velocities.moving_ids == {"1"}
    # The robot looks to the left of its way: what comes towards it along x goes to its left.
    np.testing.assert_allclose(velocities.velocities_mps, [[0.0, 12.0], [0.0, 0.0]], atol=1e-9)


def test_parked_cars_that_are_missed_now_and_then_stay_themselves() -> None:
    follower, row = Follower(), [("car", x, -4.0) for x in (10.0, 16.0, 22.0)]
    first, _ = follower.see(row)
    seen, velocities = follower.see([row[0], row[2]])
    assert seen == (first[0], first[2])
    again, velocities = follower.see(row)
    assert again == first
    assert velocities is not None
    assert not velocities.moving_ids


def test_a_person_is_none_of_the_cars() -> None:
    follower = Follower()
    follower.see([("car", 20.0, 0.0)])
    names, _ = follower.see([("person", 20.6, 0.4)])
    assert names == ("2",)
    names, _ = follower.see([("truck", 20.1, 0.0)])
    assert names == ("1",)


def test_what_was_not_seen_for_long_is_another_object() -> None:
    follower = Follower()
    follower.see([("fire hydrant", 20.0, 0.0)])
    follower.stamp_ns += 29 * PERIOD_NS
    assert follower.see([("fire hydrant", 20.0, 0.0)])[0] == ("1",)
    follower.stamp_ns += 31 * PERIOD_NS
    assert follower.see([("fire hydrant", 20.0, 0.0)])[0] == ("2",)


def test_without_odometry_nothing_is_followed() -> None:
    motions, classes, places = ObjectMotions(), ("car",), np.array([[9.0, 0.0]])
    names = [motions.names(stamp, None, (places, SPREAD[None]), classes) for stamp in (1, 2)]
    assert names == [("1",), ("2",)]
    scene = SceneObjects(1, "base", ("1",), ((("car", 0.9),),), places, SPREAD[None], np.ones(1))
    assert motions.add(scene, None) is None


def test_a_place_off_the_others_is_a_surprise_and_one_where_it_should_be_is_none() -> None:
    follower = Follower()
    for _ in range(5):
        follower.see([("car", 20.0, 0.0), ("car", 20.0, 8.0)])
    stamp_ns, base = follower.stamp_ns + PERIOD_NS, np.array([5.0, 0.0, 0.0])
    points = transform_points(inverse(base), np.array([[20.0, 0.0], [20.0, 9.2], [3.0, 3.0]]))
    seen = points, np.tile(SPREAD, (3, 1, 1))
    there, off, new = follower.motions.surprises(stamp_ns, base, seen, ("1", "2", "3"))
    assert there == 1.0
    # 1.2 m off, where both are known to 0.2 m, and tracks to 5 cm more at best.
    assert off == pytest.approx(1.2**2 / (2 * (0.2**2 + 0.05**2)) / 2)
    assert new == 1.0
    assert follower.motions.surprises(stamp_ns, None, seen, ("1", "2", "3")).tolist() == [1.0, 1.0, 1.0]


def test_what_drives_is_expected_where_its_velocity_takes_it() -> None:
    follower = Follower()
    for i in range(8):
        follower.see([("car", 40.0 - 1.2 * i, 2.0)])
    stamp_ns, base = follower.stamp_ns + PERIOD_NS, np.zeros(3)
    seen = np.array([[40.0 - 1.2 * 8, 2.0]]), SPREAD[None]
    assert follower.motions.surprises(stamp_ns, base, seen, ("1",)).tolist() == [1.0]


def test_what_surprises_is_not_less_sure_to_move() -> None:
    """The first place was of something else, and all others are in a line: a scene's wider covariances are not used."""
    follower = Follower()
    for i in range(14):
        velocities = follower.see([("car", 43.0 if i == 0 else 40.0 - 1.0 * i, 2.0)], widen=True)[1]
    assert velocities is not None
    assert velocities.moving.tolist() == [1.0]
