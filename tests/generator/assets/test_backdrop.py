"""Sky, ground and shadows: seamless, in the right place, and calm far away."""

import numpy as np
import pytest

pytest.importorskip("cv2", reason="needs the extra 'generator'")

from mcap_landmarks_generator.assets import catalog, ground, sky
from mcap_landmarks_generator.assets.backdrop import Backdrop, Pinhole
from mcap_landmarks_generator.assets.shadow import Shadow, cast_shadow

WIDTH, HEIGHT, FOCAL = 160, 120, 130.0
CAMERA = Pinhole.of(WIDTH, HEIGHT, FOCAL)
LEVEL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""The rotation of a level camera that looks along +x."""


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
    panorama = sky.Panorama(image)
    c, s = np.cos(np.arange(4) * np.pi / 2), np.sin(np.arange(4) * np.pi / 2)
    seen = []
    for turn in np.moveaxis(np.array([[c, -s, 0 * c], [s, c, 0 * c], [0 * c, 0 * c, 1 + 0 * c]]), 2, 0):
        view = panorama.view(turn @ LEVEL, CAMERA.u, CAMERA.v[: HEIGHT // 2])
        seen.append((view[-1, 5, 0], view[-1, WIDTH // 2 - 5, 0], view[-1, WIDTH // 2 + 5, 0], view[0, -5, 0]))
    # Facing azimuth 0 it is on the left, facing 90 degrees on the right, and behind the back at 180 and 270.
    assert seen == [(200, 200, 0, 0), (0, 0, 200, 200), (0, 0, 0, 0), (0, 0, 0, 0)]


def test_sky_is_looked_up_to_a_fraction_of_its_pixels() -> None:
    """A picture that tells its own columns and rows, seen by a camera that is tilted."""
    column, row = np.meshgrid(np.arange(sky.WIDTH_PX) / 8, np.arange(sky.HEIGHT_PX) / 2)
    image = np.stack([column, row, 0 * row], axis=2).astype(np.uint8)
    tilt, roll = np.deg2rad(12.0), np.deg2rad(3.0)
    turn = LEVEL @ np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    turn = turn @ np.array([[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) @ turn
    seen = sky.Panorama(image).view(quarter, CAMERA.u, CAMERA.v)
    ray = np.moveaxis(rays() @ np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]).T @ quarter.T, 2, 0)
    azimuth, elevation = np.arctan2(ray[1], ray[0]), np.arctan2(ray[2], np.hypot(ray[0], ray[1]))
    columns = azimuth * sky.WIDTH_PX / (2 * np.pi)
    rows = (sky.HIGH_RAD - elevation) * sky.HEIGHT_PX / (sky.HIGH_RAD - sky.LOW_RAD)
    inside = (rows > 0) & (rows < sky.HEIGHT_PX - 1)
    assert np.abs(seen[..., 0] - columns / 8)[inside].max() < 1.5
    assert np.abs(seen[..., 1] - rows / 2)[inside].max() < 1.5


def test_horizon_parts_sky_and_ground() -> None:
    blue, brown = np.full((sky.HEIGHT_PX, sky.WIDTH_PX, 3), (0, 0, 250), np.uint8), np.full((64, 64, 3), 90, np.uint8)
    image = Backdrop(CAMERA, blue, brown).view((0, 0, 0.5), LEVEL)
    assert np.all(image[: HEIGHT // 2] == (0, 0, 250))
    assert np.all(image[HEIGHT // 2 :] == 90)


def test_ground_lies_where_the_rays_meet_it() -> None:
    # A chessboard of 1 m fields: the field at (x, y) is bright where floor(x) + floor(y) is even.
    field = np.kron([[1, 0], [0, 1]], np.ones((32, 32)))[::-1, :, None]
    board = np.repeat((field * 255).astype(np.uint8), 3, axis=2)
    sky_image = np.zeros((sky.HEIGHT_PX, sky.WIDTH_PX, 3), np.uint8)
    eye = np.array([0.3, 0.2, 1.0])
    directions = rays()
    image = Backdrop(CAMERA, sky_image, board, tile_m=2.0).view(eye, LEVEL)
    row, column = np.mgrid[HEIGHT - 30 : HEIGHT, 0:WIDTH]
    ray = directions[row, column]
    x, y = np.moveaxis(eye[:2] + ray[..., :2] * (eye[2] / -ray[..., 2:]), -1, 0)
    inside = (np.abs(x % 1 - 0.5) < 0.4) & (np.abs(y % 1 - 0.5) < 0.4)
    bright = (np.floor(x) + np.floor(y)) % 2 == 0
    assert inside.sum() > 1000
    assert np.all((image[row, column, 0] > 127)[inside] == bright[inside])


def test_far_ground_is_calm() -> None:
    backdrop = Backdrop(CAMERA, sky.panorama("open", 0), ground.texture("chequered", 1), tile_m=0.5)
    image = backdrop.view((0, 0, 0.1), LEVEL).astype(float)
    near, far = image[-20:], image[HEIGHT // 2 + 1 : HEIGHT // 2 + 3]
    assert far.std(axis=(0, 1)).max() < 0.2 * near.std(axis=(0, 1)).max()


def test_shadow_falls_away_from_the_light() -> None:
    asset = catalog.build("bollard", seed=1)
    shadow = cast_shadow(asset, 0.0, (0.5, 0.0, 1.0)).at(2.0, 1.0)
    points = np.array([[2.0, 1.0], [1.75, 1.0], [2.25, 1.0], [1.75, 1.3]], np.float32)
    darkness = shadow.over(points[:, :1], points[:, 1:])
    assert darkness[:, 0] == pytest.approx([1.0, 1.0, 0.0, 0.0], abs=0.05)


def test_shadows_lie_where_the_rays_meet_them() -> None:
    """One ahead, one that reaches from ahead to behind the camera, and one behind it, which nobody sees."""
    white = np.full((64, 64, 3), 200, np.uint8)
    patch = Shadow(np.ones((50, 50), np.float32), np.array([0.0, 0.0]))
    places = [(1.5, 0.2), (-0.5, -1.2), (-4.0, 0.0)]
    eye = np.array([0.3, 0.1, 0.4])
    sky_image = np.zeros((sky.HEIGHT_PX, sky.WIDTH_PX, 3), np.uint8)
    image = Backdrop(CAMERA, sky_image, white).view(eye, LEVEL, [patch.at(*place) for place in places], 0.25)
    ray = rays()[HEIGHT // 2 :]
    points = eye[:2] + ray[..., :2] * (eye[2] / -ray[..., 2:])
    covered, beside = np.zeros(points.shape[:2], bool), np.ones(points.shape[:2], bool)
    for place in places:
        inner, outer = points - place - 0.05, points - place + 0.05
        covered |= np.all((inner > 0) & (inner < 0.9), axis=2)
        beside &= ~np.all((outer > 0) & (outer < 1.1), axis=2)
    assert covered.sum() > 300
    assert np.all(image[HEIGHT // 2 :, :, 0][covered] == 150)
    assert np.all(image[HEIGHT // 2 :, :, 0][beside] == 200)
