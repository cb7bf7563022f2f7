"""Assets: every class builds, the same every time, as closed surfaces that face outwards, in a plausible size."""

import hashlib
from collections import Counter

import numpy as np
import pytest

pytest.importorskip("cv2", reason="needs the extra 'generator'")

from mcap_landmarks.errors import ToolkitError
from mcap_landmarks_generator.assets import catalog
from mcap_landmarks_generator.assets.asset import Asset
from mcap_landmarks_generator.assets.solid import face_normals, welded

EVERYTHING = [(name, variant) for name, variants in catalog.VARIANTS.items() for variant in variants]
SEEDS = (7, 10_001)
# Lowest and highest top in metres.
HEIGHT_M = {
    "person": (1.5, 2.0),
    "bicycle": (0.85, 1.15),
    "car": (1.3, 1.6),
    "traffic light": (2.2, 3.3),
    "fire hydrant": (0.65, 1.0),
    "stop sign": (1.9, 2.7),
    "bench": (0.75, 1.0),
    "backpack": (0.46, 0.65),
    "suitcase": (0.5, 1.2),
    "sports ball": (0.29, 0.31),
    "chair": (0.8, 1.1),
    "potted plant": (0.6, 1.3),
}


def digest(asset: Asset) -> str:
    """A hash over every byte of an asset."""
    state = hashlib.sha256()
    for part in asset.parts:
        for array in (part.vertices, part.uv, part.normals, part.faces, part.texture):
            state.update(np.ascontiguousarray(array).tobytes())
    return state.hexdigest()


def test_classes_distractors_and_structures() -> None:
    assert set(catalog.CLASSES) == set(HEIGHT_M)
    assert set(catalog.DISTRACTORS) == {"cone", "barrel", "box", "bollard", "tree", "table", "pole"}
    assert set(catalog.STRUCTURES) == {"kerb", "facade", "hedge", "bank", "shelving", "reflector", "tag", "glass"}
    assert catalog.COCO_ID["stop sign"] == 11
    assert catalog.COCO_ID["potted plant"] == 58
    assert len(set(catalog.COCO_ID.values())) == 12


@pytest.mark.slow
@pytest.mark.parametrize(("name", "variant"), EVERYTHING)
def test_same_seed_same_bytes_other_seed_others(name: str, variant: str) -> None:
    first = digest(catalog.build(name, variant, 3))
    assert first == digest(catalog.build(name, variant, 3))
    assert first != digest(catalog.build(name, variant, 4))


@pytest.mark.parametrize(("name", "variant"), EVERYTHING)
@pytest.mark.parametrize("seed", SEEDS)
def test_surfaces_are_closed_and_face_outwards(name: str, variant: str, seed: int) -> None:
    _, recipe = catalog._recipe(name, variant)
    for solid in recipe.shape(np.random.default_rng(seed)):
        corners = welded(solid.vertices)[solid.faces]
        edges = Counter(
            map(tuple, np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]).tolist())
        )
        assert all(edges[b, a] == count for (a, b), count in edges.items()), solid.material
        a, b, c = (solid.vertices[solid.faces[:, i]] for i in range(3))
        volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
        assert volume > -1e-9, solid.material


@pytest.mark.parametrize(("name", "variant"), EVERYTHING)
@pytest.mark.parametrize("seed", SEEDS)
def test_parts_are_well_formed(name: str, variant: str, seed: int) -> None:
    asset = catalog.build(name, variant, seed)
    assert 8 <= sum(len(part.faces) for part in asset.parts) <= 1800
    for part in asset.parts:
        assert part.faces.min() >= 0
        assert part.faces.max() == len(part.vertices) - 1
        assert part.uv.shape == (len(part.vertices), 2)
        assert part.uv.min() >= 0
        assert part.uv.max() <= 1
        np.testing.assert_allclose(np.linalg.norm(part.normals, axis=1), 1.0, atol=1e-9)
        facing = face_normals(part.vertices, part.faces)
        assert np.linalg.norm(facing, axis=1).min() > 0
        assert np.einsum("ij,ikj->ik", facing, part.normals[part.faces]).min() > 0
        assert part.texture.dtype == np.uint8
        assert part.texture.shape[2] == 3


@pytest.mark.parametrize(("name", "variant"), [entry for entry in EVERYTHING if entry[0] in HEIGHT_M])
def test_size_is_plausible(name: str, variant: str) -> None:
    for seed in range(2):
        low, high = catalog.build(name, variant, seed).bounds_m
        assert -0.01 <= low[2] <= 0.015
        assert HEIGHT_M[name][0] <= high[2] <= HEIGHT_M[name][1]


def test_only_poles_are_unlabelled() -> None:
    for name in catalog.CLASSES:
        asset = catalog.build(name)
        poles = [part for part in asset.parts if not part.labelled]
        assert bool(poles) == (name in {"stop sign", "traffic light"})
        if poles:
            sign = next(part for part in asset.parts if part.labelled)
            assert sign.vertices[:, 2].min() > 1.0
            assert np.ptp(sign.vertices[:, 2]) < 1.4


def test_held_out_seeds_are_others() -> None:
    assert not set(catalog.TRAIN_SEEDS) & set(catalog.HELD_OUT_SEEDS)
    assert min(catalog.HELD_OUT_SEEDS) == 10_000


def test_unknown_names_are_refused_with_the_known_ones() -> None:
    with pytest.raises(ToolkitError, match="unknown object class 'unicorn': choose one of person"):
        catalog.build("unicorn")
    with pytest.raises(ToolkitError, match="unknown variant 'flying' of car: choose one of saloon"):
        catalog.section("car", "flying")
    with pytest.raises(ToolkitError, match="seed -1 of car"):
        catalog.build("car", seed=-1)
