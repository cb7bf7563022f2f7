"""Worlds of landmarks and what a robot would see of them: the simulator shared by tests and benchmarks of matching."""

import ast
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap_landmarks.geometry.se2 import between, compose, inverse, transform_points
from mcap_landmarks.maps.model import LandmarkMap, MapSource
from mcap_landmarks.messages.scene import SceneObjects
from numpy.typing import NDArray

Array = NDArray[np.float64]
APPENDIX_C = Path(__file__).resolve().parents[1] / "data" / "thesis_appendix_c.txt"


@dataclass(frozen=True, slots=True)
class Sensor:
    """Noise of range and bearing, and what is in view."""

    range_sigma_m: float = 0.02
    bearing_sigma_rad: float = np.deg2rad(0.3)
    reach_m: float = 15.0
    half_view_rad: float = np.pi
    detected: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """True landmarks (N, 2), class number (N,), group number (N,), and the map made of them with its own noise."""

    positions_xy: Array
    class_of: NDArray[np.int64]
    group_of: NDArray[np.int64]
    landmark_map: LandmarkMap


def random_world(rng: np.random.Generator, groups: int, classes: int = 3, map_sigma_m: float = 0.03) -> World:
    """Groups of three on a square lattice of 12 m, shifted by up to 1.5 m, their objects 1 to 7 m apart."""
    side = int(np.ceil(np.sqrt(groups)))
    lattice = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)[:groups] * 12.0
    centres = lattice + rng.uniform(-1.5, 1.5, lattice.shape)
    points = _groups_of_three(rng, groups) + centres[:, None]
    return _world(rng, points.reshape(-1, 2), rng.integers(0, classes, 3 * groups), map_sigma_m)


def _groups_of_three(rng: np.random.Generator, count: int) -> Array:
    """Offsets (count, 3, 2) from a disc of 3.5 m, drawn again until no two are closer than a metre."""
    offsets = np.empty((count, 3, 2))
    todo = np.arange(count)
    while len(todo):
        radius, angle = 3.5 * np.sqrt(rng.uniform(0, 1, (len(todo), 3))), rng.uniform(0, 2 * np.pi, (len(todo), 3))
        offsets[todo] = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
        sides = np.linalg.norm(offsets[todo] - np.roll(offsets[todo], 1, axis=1), axis=-1)
        todo = todo[sides.min(axis=1) < 1.0]
    return offsets


def appendix_c(rng: np.random.Generator, map_sigma_m: float = 0.0) -> World:
    """The thesis's own map: 20 groups of three objects of three classes."""
    rows = [ast.literal_eval(line.split(maxsplit=1)[1]) for line in APPENDIX_C.read_text("utf-8").splitlines()]
    objects = [entry for row in rows for entry in row[:3]]
    names = sorted({name for name, _, _ in objects})
    points = np.array([[x, y] for _, x, y in objects])
    return _world(rng, points, np.array([names.index(name) for name, _, _ in objects]), map_sigma_m)


def _world(rng: np.random.Generator, points: Array, class_of: NDArray[np.int64], map_sigma_m: float) -> World:
    count = len(points)
    covariances = np.broadcast_to(map_sigma_m**2 * np.eye(2), (count, 2, 2))
    mapped = LandmarkMap(
        tuple(f"l{i}" for i in range(count)),
        tuple(f"class {c}" for c in class_of),
        points + rng.normal(0, map_sigma_m, points.shape) if map_sigma_m else points,
        covariances,
        np.zeros(count),
        np.ones(count, dtype=np.int64),
        np.zeros(count, dtype=np.bool_),
        sources=(MapSource("reference", "simulated"),),
    )
    return World(points, np.asarray(class_of), np.arange(count) // 3, mapped)


def scene(
    rng: np.random.Generator,
    world: World,
    map_from_base: Array,
    sensor: Sensor,
    which: NDArray[np.int64] | None = None,
    misclassified: float = 0.0,
    spurious: int = 0,
) -> tuple[SceneObjects, NDArray[np.int64]]:
    """What the sensor sees from a pose, of all landmarks or of some, and which landmark each object is (-1 if none)."""
    near = np.arange(len(world.class_of)) if which is None else which
    points = transform_points(inverse(map_from_base), world.positions_xy[near])
    distance, bearing = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
    if which is None:
        seen = (distance < sensor.reach_m) & (distance > 0.5) & (np.abs(bearing) < sensor.half_view_rad)
        seen &= rng.uniform(size=len(near)) < sensor.detected
        near, distance, bearing = near[seen], distance[seen], bearing[seen]
    classes = int(world.class_of.max()) + 1
    label = world.class_of[near]
    wrong = rng.uniform(size=len(near)) < misclassified
    label = np.where(wrong, (label + rng.integers(1, max(classes, 2), len(near))) % classes, label)
    truth = np.concatenate([near, np.full(spurious, -1)])
    label = np.concatenate([label, rng.integers(0, classes, spurious)])
    middle = np.arctan2(np.sin(bearing).sum(), np.cos(bearing).sum())
    distance = np.concatenate([distance, rng.uniform(2.0, sensor.reach_m, spurious)])
    bearing = np.concatenate([bearing, middle + rng.uniform(-0.5, 0.5, spurious)])
    order = rng.permutation(len(truth))
    return _observed(rng, distance[order], bearing[order], label[order], sensor), truth[order]


def _observed(
    rng: np.random.Generator, distance: Array, bearing: Array, label: NDArray[np.int64], sensor: Sensor
) -> SceneObjects:
    r = distance + rng.normal(0, sensor.range_sigma_m, len(distance))
    b = bearing + rng.normal(0, sensor.bearing_sigma_rad, len(distance))
    c, s = np.cos(b), np.sin(b)
    turn = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    spread = np.zeros((len(r), 2, 2))
    spread[:, 0, 0], spread[:, 1, 1] = sensor.range_sigma_m**2, (r * sensor.bearing_sigma_rad) ** 2
    return SceneObjects(
        0,
        "base_footprint",
        tuple(str(i) for i in range(len(r))),
        tuple(((f"class {k}", 1.0),) for k in label),
        np.stack([r * c, r * s], axis=-1),
        turn @ spread @ turn.transpose(0, 2, 1),
        np.zeros(len(r)),
    )


def pose_looking_at(rng: np.random.Generator, target_xy: Array, near_m: float, far_m: float) -> Array:
    """A pose somewhere around a point at such a distance, any direction, that has it within 20 degrees ahead."""
    angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(near_m, far_m)
    x, y = target_xy + distance * np.array([np.cos(angle), np.sin(angle)])
    return np.array([x, y, angle + np.pi + rng.uniform(-np.deg2rad(20), np.deg2rad(20))])


@dataclass(frozen=True, slots=True)
class Drift:
    """Random walk of odometry per square root of metre."""

    metre: float = 0.02
    rad: float = np.deg2rad(0.5)


def drive(
    rng: np.random.Generator, start: Array, length_m: float, step_m: float, drift: Drift | None = None
) -> tuple[Array, Array]:
    """True poses (K, 3) of a gently bending stretch, and those that odometry believes, from zero."""
    drift = drift or Drift()
    truth, believed = [np.asarray(start, dtype=np.float64)], [np.zeros(3)]
    bend = rng.uniform(-0.03, 0.03)
    for _ in range(round(length_m / step_m)):
        step = np.array([step_m, 0.0, bend * step_m])
        noise = rng.normal(size=3) * np.sqrt(step_m) * np.array([drift.metre, drift.metre / 2, drift.rad])
        truth.append(compose(truth[-1], step))
        believed.append(compose(believed[-1], step + noise))
    return np.array(truth), np.array(believed)


def error(estimate: Array, truth: Array) -> tuple[float, float]:
    """Distance in metres and angle in degrees between two poses."""
    difference = between(truth, estimate)
    return float(np.hypot(*difference[:2])), float(np.rad2deg(abs(difference[2])))
