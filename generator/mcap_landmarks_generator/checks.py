"""What makes a scenario impossible, found before anything moves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from mcap_landmarks.errors import ToolkitError
from numpy.typing import NDArray

from mcap_landmarks_generator import footprints
from mcap_landmarks_generator.distortion import Lens
from mcap_landmarks_generator.groups import arrange
from mcap_landmarks_generator.layout import PlacedObject, built, place
from mcap_landmarks_generator.loading import LoadedScenario
from mcap_landmarks_generator.scenario import Scenario
from mcap_landmarks_generator.sdf_world import read_world
from mcap_landmarks_generator.sensor_specs import CameraSpec
from mcap_landmarks_generator.toml_lines import KeyPath
from mcap_landmarks_generator.world_objects import objects_of

Floats = NDArray[np.float64]

ROBOT_RADIUS_M = 0.24
"""Radius of the circle about base_footprint that holds the robot, in whichever direction it turns."""
_WALKER_RADIUS_M = 0.3
"""What one who walks needs to either side; a car half of its width."""
_TAKEN = ("camera", "landmarks", "ground_truth")
"""Namespaces of topics that are others'."""
_FISHEYE = 4
"""Coefficients of the model equidistant."""


@dataclass(frozen=True, slots=True, eq=False)
class Staged:
    """A scenario that can be run: its groups arranged, its objects built, its start known (x, y, heading).

    `warnings` say what of a world in SDF is not as it is there.
    """

    name: str
    scenario: Scenario
    objects: tuple[PlacedObject, ...]
    start: Floats
    warnings: tuple[str, ...] = ()


def stage(loaded: LoadedScenario) -> Staged:
    """Arrange and build a scenario, and refuse what cannot be.

    Raises:
        ToolkitError: a world that cannot be read, an unknown variant, objects inside each other, a start inside an
            object, a waypoint that the robot cannot reach straight from the one before; the message names the line.
    """
    scenario = loaded.scenario
    warnings: tuple[str, ...] = ()
    models: tuple[str, ...] = ()
    if scenario.world is not None:
        objects, models, warnings = objects_of(read_world(Path(scenario.world.file)), scenario.world.classes)
        loaded = loaded.with_world(scenario.world.file, len(objects))
        scenario = replace(scenario, objects=objects, groups=None, world=None)
    _check_variants(loaded, scenario)
    _check_lens(loaded, scenario.camera, ("camera", "distortion"))
    for i, spec in enumerate(scenario.cameras):
        _check_lens(loaded, spec, ("cameras", i, "distortion"))
        if spec.name in {*_TAKEN, *(other.name for other in scenario.cameras[:i])}:
            raise loaded.fault(("cameras", i, "name"), f"{spec.name} is taken; each camera needs a name of its own")
    if scenario.groups is not None:
        if scenario.trajectory.waypoints:
            raise loaded.fault(("trajectory", "waypoints"), "groups bring a way of their own; remove one of the two")
        objects, way = arrange(scenario.groups, scenario.seed)
        scenario = replace(
            scenario,
            objects=scenario.objects + objects,
            groups=None,
            trajectory=replace(scenario.trajectory, waypoints=way),
        )
    present = [i for i, spec in enumerate(scenario.objects) if not spec.sessions or scenario.session in spec.sessions]
    # Of all sessions' objects the present ones: an object has one id in all of them.
    everything = place(scenario.objects)
    placed = tuple(everything[i] for i in present)
    _check_objects(loaded, placed, present, models)
    staged = Staged(loaded.name, scenario, placed, start_pose(scenario), warnings)
    _check_way(loaded, staged)
    return staged


def start_pose(scenario: Scenario) -> Floats:
    """x, y, heading (3,) of the robot at the start: as given, else on the first waypoint, facing the next."""
    if scenario.robot.start is not None:
        x, y, heading_deg = scenario.robot.start
        return np.array([x, y, np.deg2rad(heading_deg)])
    points = scenario.trajectory.waypoints
    if not points:
        return np.zeros(3)
    first = points[0]
    if first.heading_deg is not None:
        return np.array([*first.at, np.deg2rad(first.heading_deg)])
    ahead = np.subtract(points[1].at, first.at) if len(points) > 1 else np.array([1.0, 0.0])
    return np.array([*first.at, np.arctan2(ahead[1], ahead[0])])


def _check_variants(loaded: LoadedScenario, scenario: Scenario) -> None:
    for i, spec in enumerate(scenario.objects):
        try:
            built(spec.class_name, spec.variant, spec.look)
        except ToolkitError as error:
            raise loaded.fault(("objects", i, "variant"), str(error)) from error


def _check_lens(loaded: LoadedScenario, spec: CameraSpec, where: KeyPath) -> None:
    if spec.distortion_model == "equidistant" and (len(spec.distortion) > _FISHEYE or not any(spec.distortion)):
        # Readers such as ROS's image_geometry take coefficients that are all zero for a camera without distortion.
        raise loaded.fault(where, "equidistant has k1 to k4, and one of them must not be zero")
    if Lens.of(spec).folds_inside(spec.field_of_view_deg):
        raise loaded.fault(where, "it folds the image back before its corners; take weaker ones or a narrower view")


def _check_objects(
    loaded: LoadedScenario, placed: Sequence[PlacedObject], present: Sequence[int], models: Sequence[str]
) -> None:
    """Refuse objects inside each other, or that walk into others; of a world's `models` these are named, too.

    `present` are their places among all objects of the scenario.
    """
    names = [one.object_id for one in placed]
    if models:
        names = [f"{name} (model {model})" for name, model in zip(names, models, strict=True)]
    centres = np.array([one.route_xy[0] for one in placed]).reshape(-1, 2)
    reaches = np.array([one.asset.footprint_radius_m for one in placed])
    for i, second in enumerate(placed):
        away = np.hypot(*(centres[:i] - centres[i]).T)
        for k in np.flatnonzero(away < reaches[:i] + reaches[i]).tolist():
            if footprints.overlap(placed[k], second):
                raise loaded.fault(("objects", present[i]), f"{names[i]} stands inside {names[k]}; move one of them")
        if second.moves:
            _check_walk(loaded, second, placed, present[i], names)


def _check_walk(
    loaded: LoadedScenario, walker: PlacedObject, placed: Sequence[PlacedObject], number: int, names: Sequence[str]
) -> None:
    low, high = walker.asset.bounds_m
    radius_m = max(_WALKER_RADIUS_M, float(high[1] - low[1]) / 2)
    for k, (start, end) in enumerate(pairwise([*walker.route_xy, walker.route_xy[0]])):
        blocking = _blocking(start, end, placed, radius_m)
        if blocking is not None:
            place = min(k, len(walker.route_xy) - 2)
            problem = f"{names[placed.index(walker)]} would walk into {names[placed.index(blocking)]}; move one of them"
            raise loaded.fault(("objects", number, "walk", place), problem)


def _check_way(loaded: LoadedScenario, staged: Staged) -> None:
    start = staged.start[:2]
    blocking = _blocking(start, start, staged.objects, ROBOT_RADIUS_M)
    if blocking is not None:
        where: KeyPath = ("robot", "start") if staged.scenario.robot.start else ("trajectory", "waypoints", 0)
        raise loaded.fault(where, f"the robot would start inside {blocking.object_id}; move one of them")
    points = [start, *(np.array(point.at) for point in staged.scenario.trajectory.waypoints)]
    for i, (here, there) in enumerate(pairwise(points)):
        blocking = _blocking(here, there, staged.objects, ROBOT_RADIUS_M)
        if blocking is not None:
            x, y = there
            raise loaded.fault(
                ("trajectory", "waypoints", i),
                f"waypoint {i} at ({x:g}, {y:g}) cannot be reached: {blocking.object_id} is in the way",
            )
    if staged.scenario.trajectory.laps > 1 and len(points) > 1:
        blocking = _blocking(points[-1], points[1], staged.objects, ROBOT_RADIUS_M)
        if blocking is not None:
            raise loaded.fault(("trajectory", "laps"), f"{blocking.object_id} is in the way to the next lap")


def _blocking(start: Floats, end: Floats, objects: Sequence[PlacedObject], radius_m: float) -> PlacedObject | None:
    """The first object that stands still and is closer than a radius to a straight way."""
    low, high = np.minimum(start, end) - radius_m, np.maximum(start, end) + radius_m
    for placed in objects:
        reach, centre = placed.asset.footprint_radius_m, placed.route_xy[0]
        if placed.moves or (centre + reach < low).any() or (centre - reach > high).any():
            continue
        if footprints.clearance(start, end, placed) < radius_m:
            return placed
    return None
