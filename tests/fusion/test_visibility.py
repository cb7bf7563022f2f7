"""When an image without a box of an object speaks against it: where it would show it, large and unhidden."""

import numpy as np
import pytest
from mcap_landmarks.fusion.box_geometry import box_geometry
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.visibility import is_missed, nearness_of
from mcap_landmarks.geometry.se2 import Array

from tests.fusion.cylinders import Thing, believe, boxes, camera_view, scanned, tracked

NONE = np.zeros((0, 4))


def missed(
    thing: Thing, boxes_xyxy: Array = NONE, nearness: tuple[float, ...] = (), config: FuseConfig | None = None
) -> bool:
    """Whether a thing that is known is missed in an image with some boxes, of what is so near."""
    objects = scanned((thing,), 0)
    table = tracked(objects, config)
    believe(table, "0", thing.name)
    geometry = box_geometry(camera_view(), boxes_xyxy, table.config)
    return is_missed(objects, 0, table, camera_view(), geometry, np.array(nearness))


def test_an_object_that_the_image_would_show_is_missed() -> None:
    assert missed(Thing("person", 6.0, 0.0))
    assert missed(Thing("person", 6.0, 3.3))
    assert not missed(Thing("person", 6.0, 3.5))  # half of it is beyond the image's side
    assert not missed(Thing("person", -6.0, 0.0))


@pytest.mark.parametrize(("name", "least_m"), [("person", 1.5), ("fire hydrant", 0.6)])
def test_what_is_too_small_in_the_image_is_not_missed(name: str, least_m: float) -> None:
    """Lower than `min_height_px` at its class's least height."""
    limit_m = 0.1 + 530.5 * least_m / 30
    config = FuseConfig(min_height_px=30.0)
    assert missed(Thing(name, limit_m - 0.05, 0.0), config=config)
    assert not missed(Thing(name, limit_m + 0.05, 0.0), config=config)


def test_what_shows_above_the_image_only_is_not_missed() -> None:
    """The middle of the least height counts: 0.75 m of a person, above the image at less than 1.2 m."""
    assert missed(Thing("person", 0.1 + 0.55 * 530.5 / 240 + 0.02, 0.0))
    assert not missed(Thing("person", 0.1 + 0.55 * 530.5 / 240 - 0.02, 0.0))


def test_what_hangs_is_looked_for_where_it_hangs() -> None:
    """A traffic light, from 1 m on and 2 m to its top at least: in the middle of these.

    Its pole has no shape here, so that its centre is 0.15 m behind its surface, not 0.2 m.
    """
    assert missed(Thing("traffic light", 0.15 + 1.3 * 530.5 / 240 + 0.02, 0.0))
    assert not missed(Thing("traffic light", 0.15 + 1.3 * 530.5 / 240 - 0.02, 0.0))


def test_what_stands_behind_a_box_is_not_missed() -> None:
    """Behind what is nearer, whole or in part: half the least width of a person is 0.15 m."""
    person = Thing("person", 6.1, 0.0)
    ahead = boxes([Thing("suitcase", 3.1, 0.0)])
    assert not missed(person, ahead, (3.0,))
    assert missed(person, ahead, (6.5,))  # what is in the box is farther away
    edge = 3.0 * np.tan(np.arcsin(0.25 / 3.0))
    beside = [boxes([Thing("suitcase", 3.1, edge + off)]) for off in (0.06, 0.09)]
    assert [missed(person, one, (3.0,)) for one in beside] == [False, True]


def test_any_box_may_hide_an_object() -> None:
    both = boxes([Thing("suitcase", 3.1, 0.0), Thing("suitcase", 3.1, 1.5)])
    person = Thing("person", 6.1, 3.0)
    assert not missed(person, both, (3.0, 3.0))
    assert missed(person, both[:1], (3.0,))
    assert missed(person, both, (3.0, 7.0))


def test_what_is_in_a_box_is_as_near_as_its_object() -> None:
    things = (Thing("suitcase", 3.1, 0.0), Thing("person", 6.1, 1.0))
    objects = scanned(things, 0)
    geometry = box_geometry(camera_view(), boxes(things), FuseConfig())
    nearness = nearness_of(objects, [(1, 1), (0, 0)], camera_view(), geometry, ["suitcase", "person"], FuseConfig())
    surfaces = [np.hypot(*(objects.positions_xy[i][-1] - [0.1, 0.0])) for i in (0, 1)]
    np.testing.assert_allclose(nearness, surfaces)


def test_what_no_object_is_in_a_box_of_is_as_near_as_its_height_says() -> None:
    """At least so near as the least of its class is, and a fifth more, since boxes err."""
    things = (Thing("suitcase", 3.1, 0.0), Thing("person", 6.1, 0.0))
    geometry = box_geometry(camera_view(), boxes(things), FuseConfig())
    nearness = nearness_of(scanned(things, 0), [], camera_view(), geometry, ["suitcase", "person"], FuseConfig())
    tall = geometry.top - geometry.bottom
    np.testing.assert_allclose(nearness, 0.8 * np.array([0.5, 1.5]) / tall)
    assert nearness[0] < 3.0
    assert nearness[1] < 6.0


def test_a_box_without_height_is_far_away() -> None:
    """Rather than at no distance: its slope is taken for a thousandth."""
    flat = box_geometry(camera_view(), np.array([[300.0, 240.0, 340.0, 240.0]]), FuseConfig())
    nearness = nearness_of(scanned((), 0), [], camera_view(), flat, ["person"], FuseConfig())
    np.testing.assert_allclose(nearness, [0.8 * 1.5 / 1e-3])
