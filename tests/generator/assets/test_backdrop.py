"""Sky, ground and shadows: seamless, in the right place, and calm far away."""

import numpy as np
import pytest

pytest.importorskip("cv2", reason="needs the extra 'generator'")

from mcap_landmarks_generator.assets import catalog, ground, sky
from mcap_landmarks_generator.assets.backdrop import Backdrop, cast_shadow

WIDTH, HEIGHT, FOCAL = 160, 120, 130.0


def rays() -> np.ndarray:
    """Directions (120,160,3) of a level camera that looks along +x."""
    u, v = np.meshgrid(np.arange(WIDTH) + 0.5 - WIDTH / 2, np.arange(HEIGHT) + 0.5 - HEIGHT / 2)
    directions = np.stack([np.full_like(u, FOCAL), -u, -v], axis=-1)
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)


@pytest.mark.parametrize("kind", ground.KINDS)
def test_ground_repeats_and_tiles(kind: str) -> None:
    image = ground.texture(kind, 5)
    assert image.shape == (ground.SIZE_PX, ground.SIZE_PX, 3)
    np.testing.assert_array_equal(image, ground.texture(kind, 5))
    assert np.any(image != ground.texture(kind, 6))
    if kind in {"grass", "asphalt", "gravel", "soil"}:
        smooth = image.astype(float)
        inner = np.abs(np.diff(smooth, axis=0)).mean()
        assert np.abs(smooth[0] - smooth[-1]).mean() < 1.5 * inner


@pytest.mark.slow
@pytest.mark.parametrize("kind", sky.KINDS)
def test_sky_repeats(kind: str) -> None:
    image = sky.panorama(kind, 2)
    assert image.shape == (sky.HEIGHT_PX, sky.WIDTH_PX, 3)
    np.testing.assert_array_equal(image, sky.panorama(kind, 2))


def test_sky_is_seen_where_it_is() -> None:
    image = np.zeros((sky.HEIGHT_PX, sky.WIDTH_PX, 3), np.uint8)
    image[:, : sky.WIDTH_PX // 4] = 200  # azimuth 0 to 90 degrees
    seen = sky.sample(image, np.array([[1.0, 1.0, 0.2], [-1.0, 1.0, 0.2], [1.0, -1.0, 0.2], [0.7, 0.7, 5.0]]))
    assert seen[:, 0].tolist() == [200, 0, 0, 200]


def test_horizon_parts_sky_and_ground() -> None:
    blue, brown = np.full((sky.HEIGHT_PX, sky.WIDTH_PX, 3), (0, 0, 250), np.uint8), np.full((64, 64, 3), 90, np.uint8)
    image = Backdrop(blue, brown).view((0, 0, 0.5), rays(), 1 / FOCAL)
    assert np.all(image[: HEIGHT // 2] == (0, 0, 250))
    assert np.all(image[HEIGHT // 2 :] == 90)


def test_ground_lies_where_the_rays_meet_it() -> None:
    # A chessboard of 1 m fields: the field at (x, y) is bright where floor(x) + floor(y) is even.
    field = np.kron([[1, 0], [0, 1]], np.ones((32, 32)))[::-1, :, None]
    board = np.repeat((field * 255).astype(np.uint8), 3, axis=2)
    sky_image = np.zeros((sky.HEIGHT_PX, sky.WIDTH_PX, 3), np.uint8)
    eye = np.array([0.3, 0.2, 1.0])
    directions = rays()
    image = Backdrop(sky_image, board, tile_m=2.0).view(eye, directions, 1 / FOCAL)
    row, column = np.mgrid[HEIGHT - 30 : HEIGHT, 0:WIDTH]
    ray = directions[row, column]
    x, y = np.moveaxis(eye[:2] + ray[..., :2] * (eye[2] / -ray[..., 2:]), -1, 0)
    inside = (np.abs(x % 1 - 0.5) < 0.4) & (np.abs(y % 1 - 0.5) < 0.4)
    bright = (np.floor(x) + np.floor(y)) % 2 == 0
    assert inside.sum() > 1000
    assert np.all((image[row, column, 0] > 127)[inside] == bright[inside])


def test_far_ground_is_calm() -> None:
    directions = rays()
    backdrop = Backdrop(sky.panorama("open", 0), ground.texture("chequered", 1), tile_m=0.5)
    image = backdrop.view((0, 0, 0.1), directions, 1 / FOCAL).astype(float)
    near, far = image[-20:], image[HEIGHT // 2 + 1 : HEIGHT // 2 + 3]
    assert far.std(axis=(0, 1)).max() < 0.2 * near.std(axis=(0, 1)).max()


def test_shadow_falls_away_from_the_light() -> None:
    asset = catalog.build("bollard", seed=1)
    shadow = cast_shadow(asset, 0.0, (0.5, 0.0, 1.0)).at(2.0, 1.0)
    white = np.full((4, 3), 200.0)
    points = np.array([[2.0, 1.0], [1.75, 1.0], [2.25, 1.0], [1.75, 1.3]])
    shadow.darken(white, points, 0.5)
    assert white[0, 0] == pytest.approx(100, abs=5)
    assert white[1, 0] == pytest.approx(100, abs=5)
    assert white[2, 0] == 200
    assert white[3, 0] == 200
