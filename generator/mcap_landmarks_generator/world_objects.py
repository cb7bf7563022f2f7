"""Objects of a scenario from the models of an SDF world: which class each is of, and what stands for those of none."""

import re
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from mcap_landmarks_generator import footprints
from mcap_landmarks_generator.assets import catalog
from mcap_landmarks_generator.layout import place
from mcap_landmarks_generator.scenario import ObjectSpec
from mcap_landmarks_generator.sdf_world import SdfModel

_BY_WORD = {
    "barrier": "box", "bike": "bicycle", "cardboard": "box", "casual": "person", "crate": "box", "cube": "box",
    "desk": "table",
    "drum": "barrel", "hatchback": "car", "hydrant": "fire hydrant", "lamp": "pole", "light": "pole", "oak": "tree",
    "pallet": "box", "pedestrian": "person", "pickup": "car", "pine": "tree", "plant": "potted plant", "post": "pole",
    "prius": "car", "shelf": "box", "suv": "car", "trash": "barrel", "visitor": "person", "walker": "person",
}  # fmt: skip
"""Words in the names of models of Gazebo's public collections that are no names of classes here."""
_NO_OBJECTS = {"asphalt", "ceiling", "floor", "ground", "roof", "sun"}
"""Words in the names of models that are no objects."""
_HANGS_M = 2.0
"""A model whose origin is higher hangs from a ceiling; that of one that stands is at its foot or in its middle."""
_OF_NO_CLASS = (
    "of no class, so that they stand as distractors; name their classes in the scenario, as in "
    '[world] classes = { "shelf_*" = "box" }'
)
_SPEED_MPS = 1.2
"""Of one who walks in no time, as a script without times has it."""


class WorldObjects(NamedTuple):
    """The objects that models become, the name of each one's model, and warnings of what is not as in the world."""

    objects: tuple[ObjectSpec, ...]
    models: tuple[str, ...]
    warnings: tuple[str, ...]


def objects_of(models: Sequence[SdfModel], classes: Mapping[str, str]) -> WorldObjects:
    """The objects that models become.

    `classes` are classes or distractors by pattern of names (`*` is any text); an empty one leaves the model out. Where
    no pattern fits, words of the name decide. What is of no class stands as a distractor of about its shape, unless it
    would stand inside another object.
    """
    objects: list[tuple[str, ObjectSpec]] = []
    stand_ins: list[tuple[str, ObjectSpec]] = []
    for number, model in enumerate(models):
        found = _class_of(model, classes)
        if found:
            objects += [(model.name, _spec(model, found, look=number))] if _stands(model) else []
        elif found is None and model.solid != "plane" and _stands(model):
            stand_ins.append((model.name, _spec(model, _by_shape(model), look=number)))
    kept, inside = _apart(objects, stand_ins)
    all_ = [*objects, *kept]
    warnings = _warnings([name for name, _ in stand_ins], inside, models, classes)
    return WorldObjects(tuple(map(itemgetter(1), all_)), tuple(map(itemgetter(0), all_)), warnings)


def _stands(model: SdfModel) -> bool:
    return not (model.is_scattered or _hangs(model))


def _hangs(model: SdfModel) -> bool:
    return bool(model.world_from_model[2, 3] > _HANGS_M)


def _warnings(
    stand_ins: Sequence[str], inside: Sequence[str], models: Sequence[SdfModel], classes: Mapping[str, str]
) -> tuple[str, ...]:
    """What is not as in the world, one line for each reason."""
    hanging = [model.name for model in models if _hangs(model) and _class_of(model, classes) != ""]
    scattered = [model.name for model in models if model.is_scattered]
    reasons = (
        (stand_ins, _OF_NO_CLASS),
        (inside, "left out, since what stands for them would be inside another object"),
        (hanging, f"left out, since they hang more than {_HANGS_M:g} m above the ground"),
        (scattered, "left out, since Gazebo scatters the members of a population"),
    )
    return tuple(f"{_named(names)}: {why}" for names, why in reasons if names)


def _class_of(model: SdfModel, classes: Mapping[str, str]) -> str | None:
    """A class or distractor; empty for what is no object, None for what is of no class."""
    names = [name for name in (model.name, model.uri) if name]
    for pattern, class_name in classes.items():
        if any(fnmatchcase(name.lower(), pattern.lower()) for name in names):
            return class_name
    told = [_told_by(_words(name)) for name in names]
    return next((class_name for class_name in told if class_name is not None), None)


def _words(name: str) -> list[str]:
    """The words of a name, in small letters: of `TrashCanC_01` trash, can and c."""
    return re.sub(r"[^a-z]+", " ", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()).split()


def _told_by(words: Sequence[str]) -> str | None:
    """What the words of a name say, as `_class_of` tells it; of two classes in a name the longer one is meant."""
    name = " ".join(words)
    known = [one for one in (*catalog.CLASSES, *catalog.DISTRACTORS, *catalog.STRUCTURES) if f" {one} " in f" {name} "]
    if known:
        return max(known, key=len)
    by_word = next((_BY_WORD[word] for word in words if word in _BY_WORD), None)
    return "" if by_word is None and not _NO_OBJECTS.isdisjoint(words) else by_word


def _by_shape(model: SdfModel) -> str:
    """The distractor that is most like a model's collision shape."""
    if model.solid != "cylinder" or len(model.size_m) != 2:
        return "box"
    radius_m, length_m = model.size_m
    if radius_m > 0.15:
        return "barrel"
    return "pole" if length_m > 1.5 else "bollard"


def _spec(model: SdfModel, class_name: str, look: int) -> ObjectSpec:
    x, y = model.world_from_model[:2, 3]
    ways = np.vstack([[[x, y]], model.way_xy])
    length_m = float(np.hypot(*np.diff(ways, axis=0).T).sum())
    speed = length_m / model.walks_s if model.walks_s > 0 and length_m else _SPEED_MPS
    return ObjectSpec(
        class_name=class_name,
        at=(round(float(x), 3), round(float(y), 3)),
        yaw_deg=round(float(np.rad2deg(model.heading_rad)), 1),
        look=look,
        walk=tuple((round(float(px), 3), round(float(py), 3)) for px, py in model.way_xy),
        speed_mps=round(speed, 3),
    )


def _apart(
    objects: Sequence[tuple[str, ObjectSpec]], stand_ins: Sequence[tuple[str, ObjectSpec]]
) -> tuple[list[tuple[str, ObjectSpec]], list[str]]:
    """The stand-ins that are not inside an object or one another, and the names of the others."""
    standing = list(place(tuple(spec for _, spec in objects)))
    kept, inside = list[tuple[str, ObjectSpec]](), list[str]()
    for name, spec in stand_ins:
        (placed,) = place((spec,))
        if any(footprints.overlap(placed, other) for other in standing):
            inside.append(name)
        else:
            standing.append(placed)
            kept.append((name, spec))
    return kept, inside


def _named(names: Sequence[str]) -> str:
    shown = ", ".join(names[:5])
    return f"{shown} and {len(names) - 5} more" if len(names) > 5 else shown
