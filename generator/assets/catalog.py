"""Every class of object by name: which there are, their variants and sections, and their assets by seed."""

import importlib
import pkgutil
import zlib
from types import MappingProxyType

import numpy as np

from generator.assets import classes, distractors
from generator.assets.asset import Asset, AssetClass, assemble
from generator.assets.section import Section
from toolkit.errors import ToolkitError

# Shapes and textures are drawn from the seed alone, so disjoint seeds share neither.
TRAIN_SEEDS = range(0, 10_000)
HELD_OUT_SEEDS = range(10_000, 20_000)


def _found(package: object) -> dict[str, AssetClass]:
    """The classes that a package's modules declare, by name, in the order of their COCO id and name."""
    path, prefix = package.__path__, package.__name__ + "."  # type: ignore[attr-defined]
    found = [importlib.import_module(module.name).CLASS for module in pkgutil.iter_modules(path, prefix)]
    return {entry.name: entry for entry in sorted(found, key=lambda entry: (entry.coco_id or 0, entry.name))}


_CLASSES = _found(classes)
_DISTRACTORS = _found(distractors)
_ALL = MappingProxyType({**_CLASSES, **_DISTRACTORS})

CLASSES: tuple[str, ...] = tuple(_CLASSES)
DISTRACTORS: tuple[str, ...] = tuple(_DISTRACTORS)
COCO_ID: dict[str, int] = {name: entry.coco_id for name, entry in _CLASSES.items() if entry.coco_id is not None}
VARIANTS: dict[str, tuple[str, ...]] = {name: tuple(entry.sections) for name, entry in _ALL.items()}


def section(name: str, variant: str = "") -> Section:
    """The section of a class at LiDAR height; the empty variant is the class's first.

    Raises:
        ToolkitError: there is no such class or variant.
    """
    return _ALL[_checked(name)].sections[_variant(name, variant)]


def build(name: str, variant: str = "", seed: int = 0) -> Asset:
    """The asset of a class: the same name, variant and seed give the same bytes; the empty variant is the class's first.

    Raises:
        ToolkitError: there is no such class or variant, or the seed is negative.
    """
    entry = _ALL[_checked(name)]
    variant = _variant(name, variant)
    if seed < 0:
        raise ToolkitError(f"seed {seed} of {name} is negative: give 0 or more")
    key = [zlib.crc32(f"{name}/{variant}".encode()), seed]
    solids = entry.shape(variant, np.random.default_rng([*key, 0]))
    pictures = entry.paint(variant, np.random.default_rng([*key, 1]))
    return Asset(name, variant, seed, entry.sections[variant], assemble(solids, pictures))


def _checked(name: str) -> str:
    """The name, if it is a class or a distractor."""
    if name not in _ALL:
        raise ToolkitError(f"unknown object class {name!r}: choose one of {', '.join(_ALL)}")
    return name


def _variant(name: str, variant: str) -> str:
    """The variant, or the class's first for the empty one."""
    known = VARIANTS[name]
    if variant and variant not in known:
        raise ToolkitError(f"unknown variant {variant!r} of {name}: choose one of {', '.join(known)}")
    return variant or known[0]
