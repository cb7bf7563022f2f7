"""Which box is of which object: gates, how much likelier a pair is than chance, and the assignment of all."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from mcap_landmarks.classes import CLASSES
from mcap_landmarks.fusion.box_association import BoxCandidates, assign, candidates, hit_ratio
from mcap_landmarks.fusion.box_geometry import box_geometry, misfits
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.geometry.se2 import Array

from tests.fusion.cylinders import THREE, Thing, believe, boxes, camera_view, scanned, tracked

NAMES = [thing.name for thing in THREE]


def found(
    things: tuple[Thing, ...], boxes_xyxy: Array, names: list[str], config: FuseConfig | None = None
) -> BoxCandidates:
    """Boxes as objects of which nothing is known."""
    objects, config = scanned(things, 0), config or FuseConfig()
    return candidates(
        objects, tracked(objects, config), camera_view(), box_geometry(camera_view(), boxes_xyxy, config), names
    )


def test_every_box_can_be_of_its_object_only() -> None:
    one = found(THREE, boxes(THREE), NAMES)
    assert (one.ratios > 0).tolist() == np.eye(3, dtype=bool).tolist()
    np.testing.assert_allclose(np.diag(one.aside), 0.0, atol=0.05)
    np.testing.assert_allclose(one.odds, one.ratios * 0.03 / 1.03)


def shifted(sigmas: float, config: FuseConfig) -> BoxCandidates:
    """A person with a box beside it, by the sigmas of its bearing."""
    person, view = Thing("person", 6.0, 0.0), camera_view()
    true = boxes([person])
    geometry = box_geometry(view, true, config)
    centres = np.array([[6.0, 0.0]]), 1e-4 * np.eye(2)[None]
    _, sigma, _ = misfits(view, geometry, 0, centres, CLASSES["person"].size, config)
    aside = 530.5 * math.tan(float(sigma[0]) * sigmas)
    return found((person,), true + np.array([aside, 0, aside, 0]), ["person"], config)


def test_the_gate_of_bearings_is_a_chi_square() -> None:
    config = FuseConfig(bearing_gate=4.0)
    assert [shifted(s, config).ratios[0, 0] > 0 for s in (1.9, -1.9, 2.1, -2.1)] == [True, True, False, False]
    np.testing.assert_allclose(shifted(1.5, config).aside, 1.5, rtol=0.01)  # the object is to the left of the box


def test_the_gate_of_sizes_is_a_chi_square() -> None:
    """A suitcase's box that is taken for a person's is far too low, and fits only through a wide gate."""
    things, box = (THREE[2],), boxes([THREE[2]])
    geometry = box_geometry(camera_view(), box, FuseConfig())
    centre = np.array([[4.0, -1.2]]), 1e-4 * np.eye(2)[None]
    upright = float(misfits(camera_view(), geometry, 0, centre, CLASSES["person"].size, FuseConfig())[2][0])
    for share, fits in ((0.95, False), (1.05, True)):
        config = FuseConfig(size_gate=share * upright)
        assert (found(things, box, ["person"], config).ratios[0, 0] > 0) == fits


def test_a_ratio_is_a_density_against_boxes_of_what_the_scan_does_not_show() -> None:
    """Of which there are 0.3 per radian. The scan's fit counts against a usual one, and heights by what they tell."""
    config = FuseConfig()
    one = shifted(1.5, config)
    view, person = camera_view(), Thing("person", 6.0, 0.0)
    geometry = box_geometry(view, boxes([person]), config)
    centres = np.array([[6.0, 0.0]]), 1e-4 * np.eye(2)[None]
    _, sigma, upright = misfits(view, geometry, 0, centres, CLASSES["person"].size, config)
    spread = float(sigma[0]) / math.sqrt(1.3)
    density = math.exp(-0.5 * (1.3 * 1.5**2 + 2 * float(upright[0]))) / (math.sqrt(2 * math.pi) * spread)
    telling = math.log(10) / (math.log(1.95 / 1.5) + 0.2)
    assert one.ratios[0, 0] == pytest.approx(telling * density / 0.3, rel=0.02)


def test_sizes_that_are_off_speak_against_a_pair() -> None:
    """Twice as much as their chi-square says."""
    things, box = (THREE[2],), boxes([THREE[2]])
    config = FuseConfig(size_gate=100.0)
    geometry = box_geometry(camera_view(), box, config)
    centre = np.array([[4.0, -1.2]]), 1e-4 * np.eye(2)[None]
    aside, sigma, upright = (
        float(one[0]) for one in misfits(camera_view(), geometry, 0, centre, CLASSES["person"].size, config)
    )
    density = math.exp(-0.5 * (1.3 * aside**2 + 2 * upright)) / (math.sqrt(2 * math.pi / 1.3) * sigma)
    telling = math.log(10) / (math.log(1.95 / 1.5) + 0.2)
    position = tracked(scanned(things, 0)).centre(scanned(things, 0), 0, "person")[0]
    np.testing.assert_allclose(position, [4.0, -1.2])
    assert upright > 5
    assert found(things, box, ["person"], config).ratios[0, 0] == pytest.approx(telling * density / 0.3)


@pytest.mark.parametrize(("share", "factor"), [(0.8, 1.6), (0.5, 1.0), (0.2, 0.4), (0.001, 0.1)])
def test_the_scans_fit_counts_against_the_usual_one(share: float, factor: float) -> None:
    """And never more than ten times against it, since real objects differ from their classes' shapes."""
    objects = scanned((Thing("person", 6.0, 0.0),), 0)
    options = (("fire hydrant", 0.0), ("person", share), ("suitcase", 0.0), ("", 1 - share))
    fitting = dataclasses.replace(objects, hypotheses=(options,))
    view, config = camera_view(), FuseConfig()
    geometry = box_geometry(view, boxes([Thing("person", 6.0, 0.0)]), config)
    usual, other = (
        candidates(given, tracked(given), view, geometry, ["person"]).ratios[0, 0] for given in (objects, fitting)
    )
    assert other / usual == pytest.approx(factor)


def test_heights_that_the_image_cuts_tell_nothing() -> None:
    person = (Thing("person", 2.0, 0.0),)
    cut = boxes(person)
    assert cut[0, 1] == 0
    geometry, config = box_geometry(camera_view(), cut, FuseConfig()), FuseConfig()
    centre = np.array([[2.0, 0.0]]), 1e-4 * np.eye(2)[None]
    _, sigma, upright = misfits(camera_view(), geometry, 0, centre, CLASSES["person"].size, config)
    expected = math.exp(-float(upright[0])) / (math.sqrt(2 * math.pi / 1.3) * float(sigma[0])) / 0.3
    assert found(person, cut, ["person"]).ratios[0, 0] == pytest.approx(expected)


def test_what_is_known_of_tracks_decides_between_them() -> None:
    """Two in line for one box: the one that is a person already has the better odds."""
    two = (Thing("person", 6.0, 0.05), Thing("person", 6.2, -0.05))
    objects = scanned(two, 0)
    table, view = tracked(objects), camera_view()
    believe(table, "1", "person", 0.9)
    geometry = box_geometry(view, boxes(two[:1]), table.config)
    odds = candidates(objects, table, view, geometry, ["person"])
    assert odds.ratios[0, 0] > odds.ratios[0, 1] > 0
    np.testing.assert_allclose(odds.odds[0] / odds.ratios[0], [0.03 / 1.03, 0.9])
    assert assign(odds.odds) == [(0, 1)]


def test_a_class_without_a_size_gets_a_radius_from_its_box() -> None:
    vase = Thing("vase", 4.0, 0.5)
    one = found((vase,), boxes([vase]), ["vase"])
    np.testing.assert_allclose(one.radii_m, [[0.2]], rtol=0.03)
    assert one.ratios[0, 0] > 0


def test_the_assignment_is_the_most_likely_one() -> None:
    """Against all that there are; a box may be of nothing, and no object has two."""
    rng = np.random.default_rng(3)
    for boxes_, objects in [(3, 4), (4, 3), (1, 1), (5, 5), (2, 0), (0, 3)]:
        for _ in range(10):
            odds = np.where(rng.random((boxes_, objects)) < 0.3, 0.0, np.exp(rng.normal(0, 3, (boxes_, objects))))
            best = 0.0
            for choice in itertools.product(range(-1, objects), repeat=boxes_):
                taken = [i for i in choice if i >= 0]
                if len(set(taken)) == len(taken):
                    gains = [math.log(odds[b, i]) if odds[b, i] else -math.inf for b, i in enumerate(choice) if i >= 0]
                    best = max(best, sum(gains))
            pairs = assign(odds)
            assert len({i for _, i in pairs}) == len({b for b, _ in pairs}) == len(pairs)
            assert sum(math.log(odds[pair]) for pair in pairs) == pytest.approx(best)


def test_a_pair_must_be_likelier_than_chance() -> None:
    assert assign(np.array([[0.99]])) == []
    assert assign(np.array([[1.01]])) == [(0, 0)]
    assert assign(np.array([[0.0, 1.5], [0.0, 0.0]])) == [(0, 1)]


TWO = BoxCandidates(
    ratios=np.array([[50.0, 20.0, 8.0], [0.0, 30.0, 0.0]]),
    odds=np.array([[5.0, 2.0, 0.8], [0.0, 3.0, 0.0]]),
    aside=np.zeros((2, 3)),
    radii_m=np.zeros((2, 3)),
)


def test_what_else_a_box_could_be_of_makes_it_tell_less() -> None:
    """Objects that have boxes of their own are not in question."""
    assert hit_ratio(TWO, [(0, 0)], (0, 0), 1.0) == pytest.approx(50 / (1 + 2.0 + 0.8))
    assert hit_ratio(TWO, [(0, 0), (1, 1)], (0, 0), 1.0) == pytest.approx(50 / (1 + 0.8))
    assert hit_ratio(TWO, [(0, 0), (1, 1)], (1, 1), 1.0) == pytest.approx(30)


def test_a_box_that_the_detector_is_not_sure_of_tells_less() -> None:
    assert hit_ratio(TWO, [(1, 1)], (1, 1), 0.6) == pytest.approx(0.4 + 0.6 * 30)
    assert hit_ratio(TWO, [(1, 1)], (1, 1), 0.0) == 1
