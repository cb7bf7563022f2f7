"""What the LiDAR meets is what the catalog declares: slices of the meshes against the declared sections."""

import numpy as np
import pytest
from mcap_landmarks_generator.assets.section import BAND_M, Box, Disc, Section, box, disc, four_legs, legs

pytest.importorskip("cv2", reason="needs the extra 'generator'")

from mcap_landmarks_generator.assets import catalog
from mcap_landmarks_generator.assets.asset import Asset

from tests.generator.assets.slices import range_to_section_m, range_to_segments_m, rays_around, segments_at

EVERYTHING = [(name, variant) for name, variants in catalog.VARIANTS.items() for variant in variants]
# A bicycle's tyres slope where the plane cuts them, and now and then a spoke is met; kerbs are lower than the LiDAR.
UPRIGHT = [entry for entry in EVERYTHING if entry[0] not in {"bicycle", "kerb"}]


def _hits(asset: Asset, height_m: float) -> tuple[np.ndarray, np.ndarray]:
    """How far off the declared outline rays end that hit the mesh (H,), and which rays (R,) hit it."""
    origins, directions = rays_around(asset.section.radius_m)
    measured = range_to_segments_m(segments_at(asset, height_m), origins, directions)
    hit = np.isfinite(measured)
    ends = origins[hit] + measured[hit, None] * directions[hit]
    return np.abs(asset.section.signed_distance_m(ends)), hit


@pytest.mark.slow
@pytest.mark.parametrize(("name", "variant"), UPRIGHT)
@pytest.mark.parametrize("seed", [0, 10_003])
def test_rays_end_on_the_declared_outline(name: str, variant: str, seed: int) -> None:
    asset = catalog.build(name, variant, seed)
    should = np.isfinite(range_to_section_m(asset.section, *rays_around(asset.section.radius_m)))
    for height in BAND_M:
        off, hit = _hits(asset, height)
        assert off.max() <= 0.005
        assert np.mean(hit != should) <= 0.04


def test_bicycle_is_met_at_its_tyres() -> None:
    off, hit = _hits(catalog.build("bicycle", seed=1), 0.155)
    assert hit.mean() > 0.1
    assert np.mean(off <= 0.035) >= 0.65


def test_centre_of_the_section_is_the_origin() -> None:
    grid = np.stack(np.meshgrid(*[np.linspace(-2.2, 2.2, 441)] * 2), axis=-1).reshape(-1, 2)
    for name, variant in EVERYTHING:
        inside = grid[catalog.section(name, variant).signed_distance_m(grid) <= 0]
        assert np.abs(0.5 * (inside.min(axis=0) + inside.max(axis=0))).max() < 0.016, name


def test_distance_to_simple_sections() -> None:
    points = np.array([[1.0, 0.0], [0.0, 0.0], [0.3, 0.4]])
    np.testing.assert_allclose(disc(0.25).signed_distance_m(points), [0.75, -0.25, 0.25])
    np.testing.assert_allclose(box(0.4, 0.6).signed_distance_m(points), [0.8, -0.2, np.hypot(0.1, 0.1)])
    rounded = box(0.4, 0.6, corner_m=0.1).signed_distance_m(points)
    np.testing.assert_allclose(rounded, [0.8, -0.2, np.hypot(0.2, 0.2) - 0.1])
    np.testing.assert_allclose(legs(0.06, 0.2).signed_distance_m(np.array([[0.0, 0.0], [0.0, 0.1]])), [0.04, -0.06])


def test_radius_encloses_the_section() -> None:
    assert legs(0.06, 0.2).radius_m == pytest.approx(0.16)
    assert four_legs(0.02, 0.6, 0.8).radius_m == pytest.approx(0.52)
    assert Section((Disc(0.1, 0.3), Box(0.2, 0.2, -0.5))).radius_m == pytest.approx(np.hypot(0.6, 0.1))
