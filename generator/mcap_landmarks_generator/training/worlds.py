"""Random worlds for the detector to learn and to be judged by, and random places to look at them from."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks_generator import layout
from mcap_landmarks_generator.assets import catalog, ground, sky
from mcap_landmarks_generator.camera import Viewpoint
from mcap_landmarks_generator.layout import PlacedObject, place
from mcap_landmarks_generator.robot import BASE_FROM_OPTICAL, CAMERA_IN_BASE_M
from mcap_landmarks_generator.scenario import BackgroundSpec, GroundSpec, LightSpec, ObjectSpec, Scenario
from mcap_landmarks_generator.sensor_specs import CameraSpec

Kind = Literal["thesis", "twelve", "empty"]

THESIS_CLASSES = ("fire hydrant", "person", "suitcase")

_RADIUS_M = 11.0
_NEAREST_M, _FARTHEST_M = 1.3, 15.0
_FIELD_RAD = 0.45
_VIEWS_PER_WORLD = 8
_TRIES = 200


@dataclass(frozen=True, slots=True)
class Recipe:
    """What worlds are like: how often each kind comes, how many objects stand in a disc of 11 m, and how they look.

    `handheld` cameras are at times higher than the robot's, and not level.
    """

    kinds: tuple[tuple[Kind, float], ...]
    looks: range
    objects: range = range(12, 26)
    handheld: bool = False


TRAINING = Recipe((("thesis", 0.5), ("twelve", 0.38), ("empty", 0.12)), catalog.TRAIN_SEEDS, handheld=True)


_THESIS_OBJECTS = range(4, 11)


def judged(kind: Kind, looks: range) -> Recipe:
    """Worlds of one kind as the robot's own camera sees them; with `HELD_OUT_SEEDS`, nothing that training has seen.

    The thesis's are as sparse as its groups of three are; those of twelve classes are crowded.
    """
    objects = _THESIS_OBJECTS if kind == "thesis" else TRAINING.objects
    return Recipe(((kind, 1.0),), looks, objects)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A world and the views to render of it."""

    scenario: Scenario
    objects: tuple[PlacedObject, ...]
    views: tuple[Viewpoint, ...]


def scene(recipe: Recipe, seed: int, index: int) -> Scene:
    """The scene of an index; it depends on nothing else than recipe, seed and index."""
    rng = np.random.default_rng([seed, index])
    names, shares = zip(*recipe.kinds, strict=True)
    kind: Kind = names[rng.choice(len(names), p=shares)]
    layout.built.cache_clear()  # looks hardly ever come twice
    objects = place(tuple(_scattered(kind, recipe, rng)))
    scenario = Scenario(
        seed=int(rng.integers(2**31)),
        ground=GroundSpec(kind=_one(ground.KINDS, rng), look=_look(recipe.looks, rng), tile_m=rng.uniform(1.2, 3.5)),
        background=BackgroundSpec(kind=_one(sky.KINDS, rng), look=_look(recipe.looks, rng)),
        light=_light(rng),
        camera=_camera(rng),
    )
    views = tuple(_view(objects, recipe.handheld, rng) for _ in range(_VIEWS_PER_WORLD))
    return Scene(scenario, objects, views)


def _one(names: tuple[str, ...], rng: np.random.Generator) -> str:
    return names[rng.integers(len(names))]


def _look(looks: range, rng: np.random.Generator) -> int:
    return looks[int(rng.integers(len(looks)))]


def _light(rng: np.random.Generator) -> LightSpec:
    return LightSpec(
        azimuth_deg=rng.uniform(0, 360),
        elevation_deg=rng.uniform(15, 80),
        ambient=rng.uniform(0.4, 0.7),
        diffuse=rng.uniform(0.4, 0.9),
        shade=rng.uniform(0.25, 0.6),
    )


def _camera(rng: np.random.Generator) -> CameraSpec:
    return CameraSpec(
        exposure=float(np.exp(rng.normal(0, 0.15))),
        blur_px=rng.uniform(0.2, 0.8),
        noise=rng.uniform(0.5, 5.0),
        jpeg_quality=int(rng.integers(60, 96)),
    )


def _scattered(kind: Kind, recipe: Recipe, rng: np.random.Generator) -> Iterator[ObjectSpec]:
    """Objects that stand free of each other in a disc around the origin."""
    names: list[str] = []
    if kind != "empty":
        classes = THESIS_CLASSES if kind == "thesis" else catalog.CLASSES
        names = [_one(classes, rng) for _ in range(rng.integers(recipe.objects.start, recipe.objects.stop))]
    distractors = rng.integers(6, 16) if kind == "empty" else rng.integers(7)
    names += [_one(catalog.DISTRACTORS, rng) for _ in range(distractors)]
    taken: list[tuple[NDArray[np.float64], float]] = []
    for name in names:
        variant, look = _one(catalog.VARIANTS[name], rng), _look(recipe.looks, rng)
        reach = layout.built(name, variant, look).footprint_radius_m
        spot = _free(lambda: _in_disc(rng), taken, reach + 0.1)
        if spot is not None:
            taken.append((spot, reach))
            yield ObjectSpec(
                class_name=name,
                at=(float(spot[0]), float(spot[1])),
                yaw_deg=rng.uniform(0, 360),
                variant=variant,
                look=look,
            )


def _in_disc(rng: np.random.Generator) -> NDArray[np.float64]:
    angle, distance = rng.uniform(0, 2 * np.pi), _RADIUS_M * np.sqrt(rng.random())
    return np.array([distance * np.cos(angle), distance * np.sin(angle)])


def _free(
    draw: Callable[[], NDArray[np.float64]], taken: list[tuple[NDArray[np.float64], float]], apart_m: float
) -> NDArray[np.float64] | None:
    """A drawn place that is `apart_m` from everything, None if many draws find none."""
    for _ in range(_TRIES):
        spot = draw()
        if all(np.hypot(*(spot - other)) > reach + apart_m for other, reach in taken):
            return spot
    return None


def _view(objects: tuple[PlacedObject, ...], handheld: bool, rng: np.random.Generator) -> Viewpoint:
    """A view from beside everything, towards one of the objects more or less."""
    taken = [(one.route_xy[0], one.asset.footprint_radius_m) for one in objects]
    spot = _free(lambda: _in_disc(rng), taken, _NEAREST_M)
    if spot is None:
        spot = np.array([_RADIUS_M + _NEAREST_M, 0.0])
    away = np.array([place_xy - spot for place_xy, _ in taken]).reshape(-1, 2)
    within = np.flatnonzero(np.hypot(away[:, 0], away[:, 1]) < _FARTHEST_M)
    heading = rng.uniform(-np.pi, np.pi)
    if len(within):
        x, y = away[rng.choice(within)]
        heading = np.arctan2(y, x) + rng.uniform(-_FIELD_RAD, _FIELD_RAD)
    height, pitch, roll = float(CAMERA_IN_BASE_M[2]), 0.0, 0.0
    if handheld and rng.random() < 0.4:
        height = float(np.exp(rng.uniform(np.log(0.08), np.log(1.4))))
        pitch = rng.normal(0, 0.03) + rng.uniform(0, 0.12) * height
        roll = rng.normal(0, 0.03)
    world_from_base = _turn(2, heading) @ _turn(1, pitch) @ _turn(0, roll)
    return Viewpoint(np.array([*spot, height]), world_from_base @ BASE_FROM_OPTICAL, 0.0)


def _turn(axis: int, angle_rad: float) -> NDArray[np.float64]:
    """Rotation (3, 3) about x, y or z."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    matrix = np.eye(3)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    matrix[a, a], matrix[a, b], matrix[b, a], matrix[b, b] = c, -s, s, c
    return matrix
