"""The rasterizer's pictures: objects lie where they project to, hide each other, and have their colours and light."""

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="needs the extra 'generator'")

from mcap_landmarks_generator.assets import catalog, section
from mcap_landmarks_generator.assets.asset import Asset, assemble
from mcap_landmarks_generator.assets.shapes import box
from mcap_landmarks_generator.camera import Intrinsics, Viewpoint
from mcap_landmarks_generator.drawing import Drawing, Window, bodies_of
from mcap_landmarks_generator.layout import PlacedObject
from mcap_landmarks_generator.robot import BASE_FROM_OPTICAL
from mcap_landmarks_generator.scenario import LightSpec

CAMERA = Intrinsics(160, 120, 100.0)
WHOLE = Window(0, 0, 160, 120)
AHEAD = Viewpoint(np.array([0.0, 0.0, 0.5]), np.asarray(BASE_FROM_OPTICAL), 0.0)
# Light from behind the camera and above: the front of a cube is lit less than its top.
LIGHT = LightSpec(azimuth_deg=180.0, elevation_deg=30.0, ambient=0.5, diffuse=0.4)
RED, BLUE = (200, 40, 0), (0, 40, 200)


def cube(name: str, colour: tuple[int, int, int], x: float, y: float, post: bool = False) -> PlacedObject:
    """A cube of one metre on the ground, on request with an unlabelled one of 20 cm on top."""
    solids = [box(1.0, 1.0, 1.0, "paint").moved(z_m=-box(1.0, 1.0, 1.0, "paint").vertices[:, 2].min())]
    if post:
        solids.append(box(0.2, 0.2, 0.2, "paint").moved(z_m=1.1).unlabelled())
    parts = assemble(solids, {"paint": np.full((8, 8, 3), colour, np.uint8)})
    asset = Asset(name, "plain", 0, section.box(1.0, 1.0), parts)
    return PlacedObject(name, asset, np.array([[x, y]]), 0.0, 0.0)


def drawn(objects: list[PlacedObject], window: Window = WHOLE, scale: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    return Drawing(CAMERA, LIGHT).render(AHEAD, objects, window, scale)


def test_a_cube_covers_the_pixels_it_projects_to() -> None:
    """Its front is 2 m away, 1 m wide and high, and the eye looks at its middle: 50 pixels in the middle."""
    colours, ids = drawn([cube("one", RED, 2.5, 0.0)])
    expected = np.full((120, 160), -1)
    expected[35:85, 55:105] = 0
    np.testing.assert_array_equal(ids, expected)
    # Ambient light, diffuse light at 30 degrees to the normal, and no gloss upright.
    front = np.array(RED) * (0.5 + 0.4 * np.cos(np.deg2rad(30)))
    np.testing.assert_allclose(colours[ids == 0].astype(float), np.tile(front, (2500, 1)), atol=1.5)
    assert (colours[ids < 0] == 255).all()


def test_a_window_shows_what_the_whole_image_shows_there() -> None:
    objects = [cube("one", RED, 2.5, 0.3), cube("two", BLUE, 4.0, -0.9, post=True)]
    colours, ids = drawn(objects, scale=2.0)
    window = Window(61, 17, 140, 95)
    part_colours, part_ids = drawn(objects, window, 2.0)
    np.testing.assert_array_equal(part_ids, ids[34:190, 122:280])
    assert np.abs(part_colours.astype(int) - colours[34:190, 122:280]).max() <= 1


def test_the_nearer_one_hides_the_farther_one_in_any_order() -> None:
    near, far = cube("near", RED, 2.5, 0.2), cube("far", BLUE, 4.5, -0.9, post=True)
    _, ids = drawn([near, far])
    _, other = drawn([far, near])
    (first,), second = bodies_of([near, far])
    assert [first.labelled, *(body.labelled for body in second)] == [True, True, False]
    # Fronts 2 m and 4 m away: columns 45 to 94, and 90 to 114, the post on the farther one 97 to 102.
    assert ids[60, [44, 45, 94, 95, 114, 115]].tolist() == [-1, 0, 0, 1, 1, -1]
    assert ids[46, [96, 97, 102, 103]].tolist() == [-1, 2, 2, -1]
    np.testing.assert_array_equal(np.array([1, 2, 0, -1])[other], ids)


def test_a_mask_is_of_the_labelled_parts_alone() -> None:
    one = cube("one", RED, 2.5, 0.0, post=True)
    window = Window(-20, -30, 180, 150)
    mask = Drawing(CAMERA, LIGHT).mask(AHEAD, one, window, 1.0)
    assert mask.shape == (180, 200)
    assert mask.sum() == 2500
    assert mask[35 + 30 : 85 + 30, 55 + 20 : 105 + 20].all()


def test_a_wall_that_reaches_behind_the_camera_is_cut_there() -> None:
    """Cubes beside the eye, their sides 0.4 m to the left: one ends 0.5 m ahead, and the view begins there, one 0.8 m
    ahead, which is 100 * 0.4 / 0.8 = 50 pixels left of the middle, and higher than the image."""
    _, ids = drawn([cube("beside", RED, 0.0, 0.9)])
    assert (ids == -1).all()
    _, ids = drawn([cube("beside", RED, 0.3, 0.9)])
    assert (ids[:, :30] == 0).all()
    assert (ids[:, 30:] == -1).all()


def test_nothing_to_draw_is_an_empty_window() -> None:
    colours, ids = drawn([])
    assert (ids == -1).all()
    assert (colours == 255).all()


def towards(asset: Asset, distance_m: float, height_m: float) -> tuple[np.ndarray, np.ndarray]:
    """An asset at the origin, seen from its front at a height."""
    placed = PlacedObject("one", asset, np.zeros((1, 2)), 0.0, 0.0)
    eye, target = np.array([distance_m, 0.0, height_m]), np.array([0.0, 0.0, height_m])
    view = Viewpoint.towards(eye, target, np.array([0.0, 0.0, 1.0]))
    colours, ids = Drawing(CAMERA, LightSpec(azimuth_deg=0.0)).render(view, [placed], WHOLE, 1.0)
    return colours.astype(int), ids


def test_sign_and_pole_are_told_apart() -> None:
    asset = catalog.build("stop sign", seed=1)
    colours, ids = towards(asset, 3.0, 1.6)
    labelled = np.array([part.labelled for part in asset.parts])
    sign, pole = (np.isin(ids, np.flatnonzero(labelled == which)) for which in (True, False))
    red = colours[sign]
    assert np.mean(red[:, 0] > red[:, 1] + 60) > 0.5
    assert np.mean(red.min(axis=1) > 120) > 0.1
    assert np.nonzero(sign)[0].max() < np.median(np.nonzero(pole)[0])


def test_lamps_stand_red_above_green() -> None:
    asset = catalog.build("traffic light", seed=2)
    colours, _ = towards(asset, 2.5, float(asset.parts[0].vertices[:, 2].mean()))
    reddish = np.nonzero(colours[..., 0] > colours[..., 1:].max(axis=2) + 15)[0]
    greenish = np.nonzero(colours[..., 1] > colours[..., [0, 2]].max(axis=2) + 15)[0]
    assert reddish.mean() < greenish.mean() - 10
