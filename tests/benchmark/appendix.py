"""Positions in the thesis's own map (Appendix C) at its own places (Appendix D), from scans of ideal shapes."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap_landmarks.estimation.thesis import solve_position
from mcap_landmarks.geometry.se2 import Array, inverse, transform_points
from mcap_landmarks.lidar import shapes
from mcap_landmarks.lidar.beams import sweep
from mcap_landmarks.lidar.clustering import cluster, shapes_of
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.objects import Hypotheses
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.localization.index import MapIndex
from mcap_landmarks.localization.matching import Matcher
from mcap_landmarks.maps.exchange_thesis import parse_map, parse_results
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.messages.scene import SceneObjects
from numpy.typing import NDArray

from tests.benchmark.rows import Row
from tests.lidar.scans import ANGLES_RAD, Thing, box, disc, ranges

_TEXTS = Path(__file__).resolve().parents[1] / "data"
_SAME_M, _STATIC = 0.6, 10
_GOALS_M = {"appendix_d_one_scan": 0.035, "appendix_d_ten_scans": 0.015, "appendix_d_from_elsewhere": 0.05}


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """One group from one place: true pose (3,), pose found (3,) or None, and the thesis's position (2,)."""

    truth: Array
    found: Array | None
    thesis_xy: Array


def appendix_rows(quick: bool) -> Iterator[Row]:
    """RMSE of positions from one scan, from ten of a standing robot, and from 90 to 180 degrees elsewhere.

    Detection is taken for perfect: clusters have the class of the object that they are. What the thesis itself printed
    is `printed`; `thesis` is its method on the same scans, near surfaces and a fixed guess.
    """
    printed = parse_results(_text("thesis_appendix_d.txt"), "Appendix D")
    landmark_map = parse_map(_text("thesis_appendix_c.txt"), "Appendix C")
    world = _World(landmark_map, 10_000)
    places = np.array([_looking(xy, world.group(i)) for i, xy in enumerate(printed.reference_xy)])
    rounds = 2 if quick else 10
    near = [world.look(i, pose) for _ in range(rounds) for i, pose in enumerate(places)]
    still = [_mean([world.look(i, pose) for _ in range(_STATIC)]) for i, pose in enumerate(places)]
    far = [world.look(i, world.elsewhere(i, pose)) for _ in range(rounds) for i, pose in enumerate(places)]
    own = float(np.sqrt(((printed.estimate_xy - printed.reference_xy) ** 2).sum(axis=1).mean()))
    for (name, goal_m), seen in zip(_GOALS_M.items(), (near, still, far), strict=True):
        found = [one for one in seen if one.found is not None]
        peers = {"thesis": _rmse_m([one.thesis_xy for one in seen], seen), "found": len(found) / len(seen)}
        peers |= {} if seen is far else {"printed": own}
        poses = [one.found for one in found if one.found is not None]
        yield Row(name, _rmse_m(poses, found), "m", at_most=goal_m, cases=len(seen), peers=peers)


def centre_rows(quick: bool) -> Iterator[Row]:
    """Centre of a disc 10 m away from one scan, root mean square; the thesis takes the surface for the centre."""
    rng, config = np.random.default_rng(10_001), ClusterConfig()
    for radius_m in (0.15, 0.25, 0.40):
        kinds, errors = {"disc": (shapes.disc(radius_m),)}, []
        for _ in range(200 if quick else 1000):
            at = 10.0 * _direction(rng.uniform(-np.pi, np.pi))
            beams = sweep(ANGLES_RAD, ranges([disc(*at, radius_m)], rng), np.eye(4))
            nearest = min(cluster(beams, kinds, config), key=lambda one: float(np.hypot(*(one.positions_xy[0] - at))))
            errors.append([np.hypot(*(nearest.positions_xy[row] - at)) for row in (0, -1)])
        ours, surface = np.sqrt((np.array(errors) ** 2).mean(axis=0)).tolist()
        yield Row(
            f"centre_10m_radius_{radius_m:.2f}", ours, "m", at_most=0.015, cases=len(errors), peers={"thesis": surface}
        )


class _World:
    """Appendix C's objects as ideal shapes, and its map."""

    def __init__(self, landmark_map: LandmarkMap, seed: int) -> None:
        self._map = landmark_map
        self._rng = np.random.default_rng(seed)
        self._matcher = Matcher(MapIndex.build(landmark_map), LocalizeConfig(map_sigma_m=0.001))
        self._turn = self._rng.uniform(-np.pi, np.pi, len(landmark_map))
        self._config = ClusterConfig()
        self._shapes = shapes_of(self._config)

    def rows(self, group: int) -> NDArray[np.int64]:
        """The landmarks of a group, left to right."""
        return np.array([self._map.ids.index(name) for name in self._map.groups[group].landmark_ids])

    def group(self, group: int) -> Array:
        """Their positions (3, 2)."""
        return self._map.positions_xy[self.rows(group)]

    def elsewhere(self, group: int, pose: Array) -> Array:
        """A pose as far from a group, 90 to 180 degrees to either side."""
        middle = self.group(group).mean(axis=0)
        way = self._rng.uniform(np.pi / 2, np.pi) * self._rng.choice([-1, 1])
        return _looking(middle + transform_points(np.array([0.0, 0.0, way]), pose[:2] - middle), self.group(group))

    def look(self, group: int, pose: Array) -> _Seen:
        """One scan from a pose: the group's objects, the pose that they tell, and what the thesis makes of them."""
        places = transform_points(inverse(pose), self._map.positions_xy)
        around = np.flatnonzero(np.hypot(*places.T) < 16.0)
        things = [_thing(self._map.classes[i], places[i], self._turn[i] - pose[2]) for i in around]
        found = cluster(sweep(ANGLES_RAD, ranges(things, self._rng), np.eye(4)), self._shapes, self._config)
        rows = self.rows(group)
        nearest = [min(found, key=lambda one: float(np.hypot(*(one.positions_xy[-1] - places[i])))) for i in rows]
        match = self._matcher.match([_scene(nearest, [self._map.classes[i] for i in rows], places[rows])])[0]
        surface_m = np.array([np.hypot(*one.positions_xy[-1]) for one in nearest])
        guess = self._map.positions_xy.mean(axis=0)
        return _Seen(pose, match.pose, solve_position(self.group(group), surface_m, guess).position_xy)


def _thing(name: str, at: Array, heading: float) -> Thing:
    return box(*at, heading, 0.5, 0.28) if name == "suitcase" else disc(*at, 0.15 if name == "fire hydrant" else 0.25)


def _scene(found: list[Hypotheses], classes: list[str], places: Array) -> SceneObjects:
    """The clusters at an object's place, with its class."""
    seen = [
        (name, one.positions_xy[one.names.index(name)], one.covariances[one.names.index(name)])
        for name, one, place in zip(classes, found, places, strict=True)
        if name in one.names and np.hypot(*(one.positions_xy[-1] - place)) < _SAME_M
    ]
    names, points, covariances = zip(*seen, strict=True) if seen else ((), (), ())
    options = tuple(((name, 1.0),) for name in names)
    ids = tuple(str(i) for i in range(len(seen)))
    spread = np.array(covariances).reshape(-1, 2, 2)
    return SceneObjects(0, "base", ids, options, np.array(points).reshape(-1, 2), spread, np.zeros(len(seen)))


def _mean(looks: list[_Seen]) -> _Seen:
    poses = [one.found for one in looks if one.found is not None]
    thesis_xy = np.mean([one.thesis_xy for one in looks], axis=0)
    return _Seen(looks[0].truth, np.mean(poses, axis=0) if poses else None, thesis_xy)


def _looking(position: Array, group: Array) -> Array:
    """Pose (3,) at a position (2,), facing the middle of the directions to a group (3, 2)."""
    along = group - position
    middle = (along / np.linalg.norm(along, axis=1, keepdims=True)).sum(axis=0)
    return np.array([*position, np.arctan2(middle[1], middle[0])])


def _direction(angle: float) -> Array:
    return np.array([np.cos(angle), np.sin(angle)])


def _rmse_m(found: list[Array], seen: list[_Seen]) -> float:
    off = np.array([pose[:2] - one.truth[:2] for pose, one in zip(found, seen, strict=True)])
    return float(np.sqrt((off**2).sum(axis=1).mean()))


def _text(name: str) -> str:
    return (_TEXTS / name).read_text("utf-8")
