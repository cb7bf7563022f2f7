"""Assets in PyBullet: rays hit what is declared."""

from collections.abc import Iterator

import numpy as np
import pytest

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


@pytest.mark.parametrize(("name", "radius"), [("fire hydrant", 0.15), ("person", 0.25)])
def test_rays_meet_the_disc(client: int, name: str, radius: float) -> None:
    AssetStore(client).spawn(catalog.build(name, seed=2), (1.0, -2.0, 0.0), 0.7)
    heading = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    centre = np.array([1.0, -2.0, 0.132])
    far = centre + 3.0 * np.column_stack([np.cos(heading), np.sin(heading), np.zeros(90)])
    hits = pybullet.rayTestBatch(far.tolist(), [centre.tolist()] * 90, physicsClientId=client)
    ranges = np.array([hit[2] for hit in hits]) * 3.0
    assert np.abs(ranges - (3.0 - radius)).max() < 0.004
    assert abs(np.mean(ranges) - (3.0 - radius)) < 0.001


def test_shapes_are_shared(client: int) -> None:
    store, asset = AssetStore(client), catalog.build("chair")
    first, second = store.spawn(asset), store.spawn(asset, (2.0, 0.0, 0.0))
    assert first != second
    assert len(store._shapes) == 1
