"""Centres under a class: from its own shapes, else a disc behind the surface, and whether a cluster shows them."""

import numpy as np
import pytest
from mcap_landmarks.classes import Size
from mcap_landmarks.fusion.box_geometry import box_geometry
from mcap_landmarks.fusion.class_centres import centre_of, centres_of, is_resolved, radii_in_boxes
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.messages.hypotheses import Hypotheses
from mcap_landmarks.messages.scan_objects import ScanObjects

from tests.fusion.cylinders import K, camera_view


def objects(*hypotheses: Hypotheses) -> ScanObjects:
    """Objects 3, 4, ... m ahead; the centre of the k-th hypothesis is k cm to the left, its variance k + 1 cm^2."""
    return ScanObjects(
        0,
        "base_footprint",
        tuple(f"{i}" for i in range(len(hypotheses))),
        hypotheses,
        tuple(np.array([[3.0 + i, 0.01 * k] for k in range(len(options))]) for i, options in enumerate(hypotheses)),
        tuple(np.array([(k + 1) * 1e-4 * np.eye(2) for k in range(len(options))]) for options in hypotheses),
        np.zeros(len(hypotheses)),
    )


PERSON_IN_TWO_SHAPES = (("suitcase", 0.5), ("person", 0.3), ("person", 0.1), ("", 0.1))


def test_a_class_has_the_centre_of_its_most_probable_shape() -> None:
    position, covariance, _ = centre_of(objects(PERSON_IN_TWO_SHAPES), 0, "person", 9.0, has_shape=True)
    np.testing.assert_allclose(position, [3.0, 0.01])
    np.testing.assert_allclose(covariance, 2e-4 * np.eye(2))


def test_a_fit_is_of_all_shapes_of_a_class_against_the_bare_surface() -> None:
    found = centres_of(objects(PERSON_IN_TWO_SHAPES), "person", np.zeros(1), has_shape=True)
    assert found.fits[0] == pytest.approx(0.4 / 0.5)
    found = centres_of(objects(PERSON_IN_TWO_SHAPES), "suitcase", np.zeros(1), has_shape=True)
    assert found.fits[0] == pytest.approx(0.5 / 0.6)


def test_what_no_shape_explains_hardly_fits() -> None:
    never = (("person", 0.0), ("suitcase", 1e-5), ("", 1.0))
    fits = [centre_of(objects(never), 0, name, 0.0, has_shape=True)[2] for name in ("person", "suitcase")]
    assert fits == [0.001, 0.001]


def test_a_class_without_shapes_is_a_disc_behind_the_surface() -> None:
    """Its radius is sure to 30 %, and so is how far behind the surface it is."""
    found = centres_of(
        objects((("person", 0.5), ("", 0.5)), (("", 1.0),)), "vase", np.array([0.2, 0.4]), has_shape=False
    )
    ahead = [np.array([3.0, 0.01]) / np.hypot(3.0, 0.01), np.array([1.0, 0.0])]
    np.testing.assert_allclose(found.positions_xy, [np.array([3.0, 0.01]) + 0.2 * ahead[0], [4.4, 0.0]])
    np.testing.assert_allclose(found.covariances[0], 2e-4 * np.eye(2) + 0.06**2 * np.outer(ahead[0], ahead[0]))
    np.testing.assert_allclose(found.covariances[1], np.diag([1e-4 + 0.12**2, 1e-4]), atol=1e-15)
    assert found.fits.tolist() == [1.0, 1.0]


def test_a_cluster_without_a_shape_of_a_class_that_has_some_does_not_fit_it() -> None:
    position, _, fit = centre_of(objects((("", 1.0),)), 0, "person", 0.25, has_shape=True)
    np.testing.assert_allclose(position, [3.25, 0.0])
    assert fit == 0.001


def test_a_surface_on_the_robot_itself_has_a_centre() -> None:
    at = objects((("", 1.0),))
    at.positions_xy[0][:] = 0.0
    position, _, _ = centre_of(at, 0, "vase", 0.3, has_shape=False)
    np.testing.assert_allclose(position, [0.3, 0.0])


@pytest.mark.parametrize(("bare", "resolved"), [(0.2, True), (0.19 * 99, False), (0.19 * 98, True)])
def test_a_centre_counts_if_the_scan_shows_it(bare: float, resolved: bool) -> None:
    """Hits of several things that have run together fit no shape; the limit is a share of 1 % against the surface."""
    assert is_resolved(objects((("person", 0.19 - 1e-6), ("", bare))), 0, "person", has_shape=True) == resolved


def test_a_class_that_scans_know_must_be_among_an_objects_hypotheses() -> None:
    only_bare = objects((("", 1.0),))
    assert not is_resolved(only_bare, 0, "person", has_shape=True)
    assert is_resolved(only_bare, 0, "vase", has_shape=False)


def test_discs_fill_their_boxes() -> None:
    """One that is seen 0.2 rad wide to each side is so large that its tangents are there."""
    side = 530.5 * np.tan(0.2)
    boxes = box_geometry(camera_view(), np.array([[K[0, 2] - side, 200.0, K[0, 2] + side, 280.0]]), FuseConfig())
    two = objects((("", 1.0),), (("", 1.0),))
    wide = Size(top_m=(0.1, 6.0), width_m=(0.05, 6.0), radius_m=0.0)
    radii = radii_in_boxes(two, camera_view(), boxes, 0, wide)
    np.testing.assert_allclose(radii / (radii + np.array([2.9, 3.9])), np.sin(0.2))
    narrow = Size(top_m=(0.1, 6.0), width_m=(0.05, 1.6), radius_m=0.0)
    np.testing.assert_allclose(radii_in_boxes(two, camera_view(), boxes, 0, narrow), [radii[0], 0.8])


def test_no_box_is_so_wide_that_the_camera_would_be_inside() -> None:
    boxes = box_geometry(camera_view(), np.array([[K[0, 2] - 3000.0, 200.0, K[0, 2] + 3000.0, 280.0]]), FuseConfig())
    wide = Size(top_m=(0.1, 6.0), width_m=(0.05, 1000.0), radius_m=0.0)
    np.testing.assert_allclose(radii_in_boxes(objects((("", 1.0),)), camera_view(), boxes, 0, wide), [2.9 * 9])
