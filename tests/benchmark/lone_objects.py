"""Views of one object each, alone in a random world, from a random side: what `appearance` shows to networks."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mcap_landmarks_generator import layout
from mcap_landmarks_generator.assets import catalog
from mcap_landmarks_generator.camera import Intrinsics, Viewpoint
from mcap_landmarks_generator.layout import place
from mcap_landmarks_generator.optics import Image, Optics
from mcap_landmarks_generator.renderer import Renderer
from mcap_landmarks_generator.robot import BASE_FROM_OPTICAL, CAMERA_IN_BASE_M
from mcap_landmarks_generator.scenario import ObjectSpec
from mcap_landmarks_generator.training.worlds import judged, scene
from mcap_landmarks_generator.visibility import true_detections
from numpy.typing import NDArray

# Farther apart than the renderer draws: each object is alone.
_APART_M = 100.0
_OBJECTS_PER_WORLD, _SIDES = 6, 2
# Signs and lights are for those who come towards them.
_SEEN_FROM_FRONT = ("stop sign", "traffic light")
_FRONT_RAD = np.deg2rad(30.0)
# The object stands off the middle of the image by up to this.
_ASIDE_RAD = 0.3
_TRIES = 10
# What hardly ever fits into the image, as a car at 2 m, is given up after so many worlds without a single view.
_WORLDS_WITHOUT = 4


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """An image (H, W, 3) as the camera gives it, and where the object is in it, by its mask."""

    image: Image
    class_name: str
    box_xyxy: NDArray[np.float64]


def views(
    class_name: str, distances_m: tuple[float, float], first: int, count: int, least_share: float
) -> Iterator[View]:
    """Up to `count` views in which `least_share` of the object shows, all variants in turn; fewer if that is rare.

    Worlds, light, camera and looks are those that detectors are judged by, from the seed `first` up.
    """
    shown = 0
    for index in range(-(-_TRIES * count // (_OBJECTS_PER_WORLD * _SIDES))):
        for view in _world(class_name, distances_m, first, index, least_share):
            yield view
            shown += 1
            if shown == count:
                return
        if index + 1 == _WORLDS_WITHOUT and not shown:
            return


def _world(
    class_name: str, distances_m: tuple[float, float], first: int, index: int, least_share: float
) -> Iterator[View]:
    scenario = scene(judged("empty", range(first, first + 10_000)), first, index).scenario
    rng = np.random.default_rng([first, index, catalog.COCO_ID[class_name]])
    layout.built.cache_clear()  # looks hardly ever come twice
    variants = catalog.VARIANTS[class_name]
    objects = place(
        tuple(
            ObjectSpec(
                class_name=class_name,
                at=(_APART_M * number, 0.0),
                yaw_deg=float(rng.uniform(0, 360)),
                variant=variants[(_OBJECTS_PER_WORLD * index + number) % len(variants)],
                look=first + int(rng.integers(10_000)),
            )
            for number in range(_OBJECTS_PER_WORLD)
        )
    )
    optics = Optics(scenario.camera, Intrinsics.of(scenario.camera).focal_px, scenario.seed)
    renderer = Renderer(scenario, objects)
    for number, placed in enumerate(objects * _SIDES):
        side = rng.uniform(*(_FRONT_RAD * np.array([-1, 1]) if class_name in _SEEN_FROM_FRONT else (0, 2 * np.pi)))
        view = _towards(placed.route_xy[0], placed.yaw_rad + side, rng.uniform(*distances_m), rng)
        rendered = renderer.draw(view)
        truth = true_detections(rendered, renderer, view, 0)
        if len(truth.ids) and truth.hypotheses[0][0][1] >= least_share:
            image = optics.developed(optics.expose(rendered.image, number, 0.0))
            yield View(image, class_name, truth.boxes_xyxy[0])


def _towards(object_xy: NDArray[np.float64], from_rad: float, distance_m: float, rng: np.random.Generator) -> Viewpoint:
    """The robot's camera, at a distance on a side of an object, with the object more or less ahead."""
    heading = from_rad + np.pi + rng.uniform(-_ASIDE_RAD, _ASIDE_RAD)
    c, s = np.cos(heading), np.sin(heading)
    world_from_base = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    away = distance_m * np.array([np.cos(from_rad), np.sin(from_rad)])
    eye = np.array([*(object_xy + away), CAMERA_IN_BASE_M[2]])
    return Viewpoint(eye, world_from_base @ BASE_FROM_OPTICAL, 0.0)
