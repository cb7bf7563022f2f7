"""Make the demo's recordings: two drives through the world of the thesis's Appendix C, with drifting odometry.

`python recordings/make_demo.py [FOLDER]` writes demo_map.mcap and demo_localize.mcap, the same bytes every time.
The objects stand where Appendix C has them; the robot sees those within 0.5 to 15 m all around it, with noise, misses
some, and integrates an odometry whose errors grow with the way. Truth goes to channels that no stage reads.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from toolkit.channels import ODOMETRY, SCENE_OBJECTS, TRUTH_OBJECTS, TRUTH_POSE
from toolkit.geometry.angles import wrap
from toolkit.geometry.se2 import Array, between, compose, inverse, transform_points
from toolkit.landmarks.exchange_thesis import parse_map, parse_results
from toolkit.manifest import RUN, Manifest
from toolkit.messages.poses import Odometry, PoseStamped
from toolkit.messages.scene import SceneObjects
from toolkit.recording.writer import create_recording
from toolkit.stage import Stamped

HERE = Path(__file__).resolve().parent
APPENDICES = HERE.parent / "tests" / "data"
START_NS = 1_700_000_000 * 10**9
ODOMETRY_HZ, SCENES_EVERY = 5, 2
SPEED_MPS, TURN_RADPS = 0.7, 0.8
RANGE_SIGMA_M, BEARING_SIGMA_RAD = 0.02, np.radians(0.3)
NEAREST_M, FARTHEST_M, MISSED = 0.5, 15.0, 0.05
DISTANCE_SIGMA, SIDEWAYS_SIGMA, HEADING_SIGMA = 0.01, 0.005, np.radians(0.1)  # per square root of a metre
TURNING_SIGMA = 0.01  # per square root of a radian


@dataclass(frozen=True, slots=True)
class World:
    """Where everything stands: ids, classes and positions_xy (N, 2)."""

    ids: tuple[str, ...]
    classes: tuple[str, ...]
    positions_xy: Array


def drive(waypoints_xy: Array) -> Array:
    """Poses (T, 3) at the odometry's rate: turn on the spot towards each waypoint, then drive straight to it."""
    x, y = waypoints_xy[0]
    heading = float(np.arctan2(*(waypoints_xy[1] - waypoints_xy[0])[::-1]))
    poses = [np.array([[x, y, heading]])]
    for here, there in pairwise(waypoints_xy):
        goal = float(np.arctan2(there[1] - here[1], there[0] - here[0]))
        turn = float(wrap(goal - heading))
        steps = int(np.ceil(abs(turn) / TURN_RADPS * ODOMETRY_HZ))
        turned = heading + turn * np.arange(1, steps + 1) / max(steps, 1)
        poses.append(np.column_stack([np.full(steps, here[0]), np.full(steps, here[1]), wrap(turned)]))
        steps = int(np.ceil(np.linalg.norm(there - here) / SPEED_MPS * ODOMETRY_HZ))
        share = np.arange(1, steps + 1)[:, None] / steps
        poses.append(np.column_stack([here + share * (there - here), np.full(steps, goal)]))
        heading = goal
    return np.concatenate(poses)


def drift(poses: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Odometry (T, 3) of a drive and its covariance (T, 3, 3): steps with noise, added up from the origin."""
    steps = between(poses[:-1], poses[1:])
    way, turn = np.abs(steps[:, 0]), np.abs(steps[:, 2])
    sigmas = np.column_stack(
        [
            DISTANCE_SIGMA * np.sqrt(way),
            SIDEWAYS_SIGMA * np.sqrt(way),
            np.sqrt(HEADING_SIGMA**2 * way + TURNING_SIGMA**2 * turn),
        ]
    )
    noisy = steps + rng.normal(size=steps.shape) * sigmas
    odometry, covariance = np.zeros_like(poses), np.zeros((len(poses), 3, 3))
    for i, (step, sigma) in enumerate(zip(noisy, sigmas, strict=True)):
        odometry[i + 1] = compose(odometry[i], step)
        c, s = np.cos(odometry[i, 2]), np.sin(odometry[i, 2])
        turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        moved = np.eye(3)
        moved[:2, 2] = -(odometry[i + 1] - odometry[i])[1], (odometry[i + 1] - odometry[i])[0]
        covariance[i + 1] = moved @ covariance[i] @ moved.T + turned @ np.diag(sigma**2) @ turned.T
    return odometry, covariance


def see(world: World, pose: Array, stamp_ns: int, rng: np.random.Generator) -> SceneObjects:
    """What the robot makes of the objects around it at one moment."""
    points = transform_points(inverse(pose), world.positions_xy)
    range_m, bearing_rad = np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])
    seen: NDArray[np.int64] = np.flatnonzero(
        (range_m > NEAREST_M) & (range_m < FARTHEST_M) & (rng.random(len(points)) > MISSED)
    )
    measured_m = range_m[seen] + rng.normal(0, RANGE_SIGMA_M, len(seen))
    angle = bearing_rad[seen] + rng.normal(0, BEARING_SIGMA_RAD, len(seen))
    towards = np.column_stack([np.cos(angle), np.sin(angle)])
    across = np.column_stack([-np.sin(angle), np.cos(angle)])
    covariances = RANGE_SIGMA_M**2 * towards[:, :, None] * towards[:, None, :]
    covariances += (measured_m * BEARING_SIGMA_RAD)[:, None, None] ** 2 * across[:, :, None] * across[:, None, :]
    return SceneObjects(
        stamp_ns,
        "base_footprint",
        tuple(str(i) for i in range(len(seen))),
        tuple(((world.classes[i], 0.9),) for i in seen),
        measured_m[:, None] * towards,
        covariances,
        np.zeros(len(seen)),
    )


def messages(world: World, waypoints_xy: Array, seed: int) -> Iterator[Stamped]:
    """One drive, by log time."""
    rng = np.random.default_rng(seed)
    poses = drive(waypoints_xy)
    odometry, covariance = drift(poses, rng)
    n = len(world.ids)
    classes = tuple(((name, 1.0),) for name in world.classes)
    reference = SceneObjects(START_NS, "map", world.ids, classes, world.positions_xy, np.zeros((n, 2, 2)), np.zeros(n))
    yield Stamped(TRUTH_OBJECTS, START_NS, reference)
    for i, pose in enumerate(poses):
        now = START_NS + i * 10**9 // ODOMETRY_HZ
        yield Stamped(TRUTH_POSE, now, PoseStamped.planar(now, "map", pose))
        step = Odometry.planar(now, ("odom", "base_footprint"), odometry[i], covariance[i])
        yield Stamped(ODOMETRY, now, step)
        if i % SCENES_EVERY == 0:
            yield Stamped(SCENE_OBJECTS, now, see(world, pose, now, rng))


def main(folder: Path) -> None:
    """Write both recordings."""
    name = "thesis_appendix_c.txt"
    landmark_map = parse_map((APPENDICES / name).read_text(), name)
    world = World(landmark_map.ids, landmark_map.classes, landmark_map.positions_xy)
    captured = np.array([group.map_from_base[:2] for group in landmark_map.groups])
    name = "thesis_appendix_d.txt"
    asked = parse_results((APPENDICES / name).read_text(), name).reference_xy
    drives = {"demo_map": (np.vstack([captured, captured[:1]]), 1), "demo_localize": (asked[::-1], 2)}
    for stem, (waypoints_xy, seed) in drives.items():
        manifest = Manifest("make_demo", seed=seed)
        with create_recording(folder / f"{stem}.mcap", {RUN: manifest.entries()}) as writer:
            for stamped in messages(world, waypoints_xy, seed):
                writer.add(stamped)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
