"""Small worlds of a few landmarks, and what a robot sees of them, exactly or a little off."""

import numpy as np
from mcap_landmarks.geometry.se2 import Array, inverse, transform_points
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.matching import Matcher
from mcap_landmarks.maps.model import LandmarkMap, MapSource
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import OdometryAt
from numpy.typing import ArrayLike

SIGMA_M = 0.03
# Five landmarks, no two sides alike.
PLACE_XY = np.array([[0.0, 0.0], [3.1, 0.4], [1.2, 2.7], [4.6, 3.3], [-1.9, 1.6]])
PLACE_CLASSES = ("bench", "person", "person", "hydrant", "bench")


def landmark_map(positions_xy: ArrayLike, classes: tuple[str, ...]) -> LandmarkMap:
    """A surveyed map, landmarks l0, l1 and so on, whose covariances are unknown."""
    names = tuple(f"l{i}" for i in range(len(classes)))
    return LandmarkMap.surveyed(names, classes, np.asarray(positions_xy), MapSource("import", "test"))


def elsewhere(count: int = 24, seed: int = 1) -> tuple[Array, tuple[str, ...]]:
    """Landmarks 60 m and more away, of the same classes: what makes a place of five a rare thing."""
    rng = np.random.default_rng(seed)
    side = int(np.ceil(np.sqrt(count)))
    lattice = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)[:count] * 4.0
    names = ("bench", "person", "hydrant")
    return lattice + rng.uniform(-1.2, 1.2, lattice.shape) + 60.0, tuple(names[i] for i in rng.integers(0, 3, count))


def one_place() -> LandmarkMap:
    """The place of five at the origin, and others far away."""
    far_xy, far_classes = elsewhere()
    return landmark_map(np.concatenate([PLACE_XY, far_xy]), PLACE_CLASSES + far_classes)


def two_places(apart_m: float = 40.0) -> LandmarkMap:
    """The place of five twice, and others far away."""
    far_xy, far_classes = elsewhere()
    both = np.concatenate([PLACE_XY, PLACE_XY - np.array([apart_m, 0.0]), far_xy])
    return landmark_map(both, PLACE_CLASSES * 2 + far_classes)


def matcher(world: LandmarkMap, config: LocalizeConfig | None = None) -> Matcher:
    """The matcher of a map."""
    return Matcher(MapIndex.build(world), config or LocalizeConfig())


def seen(
    world: LandmarkMap,
    pose: ArrayLike,
    rows: ArrayLike,
    off_m: ArrayLike = 0.0,
    *,
    classes: tuple[str, ...] | None = None,
    stamp_ns: int = 0,
) -> SceneObjects:
    """Landmarks as they are seen from a pose, off by so much (K, 2) or alike; sigma is always `SIGMA_M`."""
    which = np.asarray(rows, dtype=np.int64)
    points = transform_points(inverse(np.asarray(pose, dtype=np.float64)), world.positions_xy[which]) + off_m
    names = classes or tuple(world.classes[i] for i in which)
    spread = np.tile(SIGMA_M**2 * np.eye(2), (len(which), 1, 1))
    ids = tuple(str(i) for i in range(len(which)))
    return SceneObjects(
        stamp_ns, "base", ids, tuple(((name, 1.0),) for name in names), points, spread, np.zeros(len(which))
    )


def odometry(pose: ArrayLike, way_m: float, turned_rad: float = 0.0) -> OdometryAt:
    """Odometry at a pose after some way."""
    return OdometryAt("odom", np.asarray(pose, dtype=np.float64), np.zeros((3, 3)), way_m, turned_rad)
