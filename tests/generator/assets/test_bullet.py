"""Assets in PyBullet: rays hit what is declared, masks tell signs from poles, textures are the right way up."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("cv2", reason="needs the extra 'generator'")
pytest.importorskip("pybullet", reason="needs the extra 'generator'")

import pybullet
from mcap_landmarks_generator.assets import catalog
from mcap_landmarks_generator.assets.bullet import AssetStore


@pytest.fixture
def client() -> Iterator[int]:
    """A PyBullet world without physics steps."""
    number = pybullet.connect(pybullet.DIRECT)
    yield number
    pybullet.disconnect(number)


def picture(
    client: int, eye: tuple[float, float, float], target: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Image (120,120,3) and segmentation (120,120)."""
    view = pybullet.computeViewMatrix(eye, target, [0, 0, 1])
    projection = pybullet.computeProjectionMatrixFOV(40, 1, 0.05, 50)
    *_, rgba, _, mask = pybullet.getCameraImage(
        120, 120, view, projection, shadow=0, lightDirection=[9, 0, 9],
        renderer=pybullet.ER_TINY_RENDERER, physicsClientId=client,
    )  # fmt: skip
    return np.array(rgba, np.uint8).reshape(120, 120, 4)[..., :3], np.array(mask).reshape(120, 120)


@pytest.mark.parametrize(("name", "radius"), [("fire hydrant", 0.15), ("person", 0.25)])
def test_rays_meet_the_disc(client: int, name: str, radius: float) -> None:
    with AssetStore(client) as store:
        store.spawn(catalog.build(name, seed=2), (1.0, -2.0, 0.0), 0.7)
    heading = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    centre = np.array([1.0, -2.0, 0.132])
    far = centre + 3.0 * np.column_stack([np.cos(heading), np.sin(heading), np.zeros(90)])
    hits = pybullet.rayTestBatch(far.tolist(), [centre.tolist()] * 90, physicsClientId=client)
    ranges = np.array([hit[2] for hit in hits]) * 3.0
    assert np.abs(ranges - (3.0 - radius)).max() < 0.004
    assert abs(np.mean(ranges) - (3.0 - radius)) < 0.001


def test_sign_and_pole_are_told_apart(client: int) -> None:
    with AssetStore(client) as store:
        bodies = store.spawn(catalog.build("stop sign", seed=1))
        image, mask = picture(client, (5.0, 0.0, 1.6), (0.0, 0.0, 1.6))
    sign, pole = (next(body.body_id for body in bodies if body.labelled == labelled) for labelled in (True, False))
    red = image[mask == sign].astype(int)
    assert np.mean(red[:, 0] > red[:, 1] + 60) > 0.5
    assert np.mean(red.min(axis=1) > 120) > 0.1
    rows_of_sign, rows_of_pole = np.nonzero(mask == sign)[0], np.nonzero(mask == pole)[0]
    assert rows_of_sign.max() < np.median(rows_of_pole)


def test_lamps_stand_red_above_green(client: int) -> None:
    with AssetStore(client) as store:
        asset = catalog.build("traffic light", seed=2)
        store.spawn(asset)
        middle = asset.parts[0].vertices[:, 2].mean()
        image, _ = picture(client, (2.5, 0.0, middle), (0.0, 0.0, middle))
    rgb = image.astype(int)
    reddish = np.nonzero(rgb[..., 0] > rgb[..., 1:].max(axis=2) + 15)[0]
    greenish = np.nonzero(rgb[..., 1] > rgb[..., [0, 2]].max(axis=2) + 15)[0]
    assert reddish.mean() < greenish.mean() - 10


def test_shapes_are_shared_and_files_are_gone(client: int) -> None:
    asset = catalog.build("chair")
    with AssetStore(client) as store:
        folder = Path(store._folder.name)
        first, second = store.spawn(asset), store.spawn(asset, (2.0, 0.0, 0.0))
        assert first != second
        assert len(store._shapes) == 1
        assert not list(folder.iterdir())
    assert not folder.exists()


def test_same_world_same_picture() -> None:
    images = []
    for _ in range(2):
        number = pybullet.connect(pybullet.DIRECT)
        with AssetStore(number) as store:
            store.spawn(catalog.build("person", "stride", 4))
            images.append(picture(number, (-3.0, 1.0, 1.0), (0.0, 0.0, 0.9))[0])
        pybullet.disconnect(number)
    np.testing.assert_array_equal(*images)
