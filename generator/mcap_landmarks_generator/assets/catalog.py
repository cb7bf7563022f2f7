"""Every class of object by name: which there are, their variants and sections, and their assets by seed."""

import importlib
import pkgutil
import zlib
from types import ModuleType

import numpy as np
from mcap_landmarks.errors import ToolkitError

from mcap_landmarks_generator.assets import classes, distractors, structures
from mcap_landmarks_generator.assets.asset import Asset, AssetClass, Variant, assemble
from mcap_landmarks_generator.assets.section import Section

# Shapes and textures are drawn from the seed alone, so disjoint seeds share neither.
TRAIN_SEEDS = range(10_000)
HELD_OUT_SEEDS = range(10_000, 20_000)


def _found(package: ModuleType) -> dict[str, AssetClass]:
    """The classes that a package's modules declare, by name, in the order of their COCO id and name."""
    path, prefix = package.__path__, package.__name__ + "."
    found = [importlib.import_module(module.name).CLASS for module in pkgutil.iter_modules(path, prefix)]
    return {entry.name: entry for entry in sorted(found, key=lambda entry: (entry.coco_id or 0, entry.name))}


_CLASSES = _found(classes)
_DISTRACTORS = _found(distractors)
_STRUCTURES = _found(structures)
_ALL = {**_CLASSES, **_DISTRACTORS, **_STRUCTURES}

CLASSES: tuple[str, ...] = tuple(_CLASSES)
DISTRACTORS: tuple[str, ...] = tuple(_DISTRACTORS)
STRUCTURES: tuple[str, ...] = tuple(_STRUCTURES)
COCO_ID: dict[str, int] = {name: entry.coco_id for name, entry in _CLASSES.items() if entry.coco_id is not None}
VARIANTS: dict[str, tuple[str, ...]] = {name: tuple(entry.variants) for name, entry in _ALL.items()}


def section(name: str, variant: str = "") -> Section:
    """The section of a class at LiDAR height; the empty variant is the class's first.

    Raises:
        ToolkitError: there is no such class or variant.
    """
    return _recipe(name, variant)[1].section


def build(name: str, variant: str = "", seed: int = 0) -> Asset:
    """The asset of a class; the empty variant is the class's first. Same name, variant and seed give the same bytes.

    Raises:
        ToolkitError: there is no such class or variant, or the seed is negative.
    """
    chosen, recipe = _recipe(name, variant)
    if seed < 0:
        raise ToolkitError(f"seed {seed} of {name} is negative: give 0 or more")
    key = [zlib.crc32(f"{name}/{chosen}".encode()), seed]
    solids = recipe.shape(np.random.default_rng([*key, 0]))
    pictures = recipe.paint(np.random.default_rng([*key, 1]))
    return Asset(name, chosen, seed, recipe.section, assemble(solids, pictures))


def _recipe(name: str, variant: str) -> tuple[str, Variant]:
    """The variant's name, the class's first for the empty one, and how to make it."""
    if name not in _ALL:
        raise ToolkitError(f"unknown object class {name!r}: choose one of {', '.join(_ALL)}")
    known = _ALL[name].variants
    if variant and variant not in known:
        raise ToolkitError(f"unknown variant {variant!r} of {name}: choose one of {', '.join(known)}")
    chosen = variant or next(iter(known))
    return chosen, known[chosen]
