"""How the robot is driven along its way: pure pursuit, turns on the spot, stops."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from mcap_landmarks.geometry.angles import wrap
from numpy.typing import NDArray

from mcap_landmarks_generator.robot import MAX_SPEED_MPS, MAX_TURN_RADPS
from mcap_landmarks_generator.scenario import TrajectorySpec, Waypoint
from mcap_landmarks_generator.world import STEP_NS

Floats = NDArray[np.float64]

STEPS_PER_COMMAND = 4
COMMAND_NS = STEPS_PER_COMMAND * STEP_NS
"""The wheels get a command at 62.5 Hz."""

_ACCELERATION_MPS2 = 0.5
_TURN_ACCELERATION_RADPS2 = 3.0
# Faster through a bend, the wheels would slide.
_SIDEWAYS_MPS2 = 0.8
# Braking is planned softer than it could be, so that the wheels can follow.
_BRAKING = 0.7
_TURN_FIRST_RAD = np.deg2rad(25.0)
_ARRIVED_M, _ARRIVED_RAD = 0.002, 0.001
_LEAST_SPEED_MPS, _LEAST_TURN_RADPS = 0.004, 0.004


@dataclass(frozen=True, slots=True)
class Command:
    """What the wheels are asked for, and whether the robot stands at a stop."""

    speed_mps: float
    turn_radps: float
    standing: bool


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """A way (N, 2) without a stop in between, and the stop at its end; `index` is the last waypoint's."""

    way_xy: Floats
    stop: Waypoint
    index: int


class Steering(Protocol):
    """Drives the robot: asked every `COMMAND_NS` for the next command, until it is `done`."""

    @property
    def done(self) -> bool:
        """Whether the drive is over."""

    def command(self, pose: Floats) -> Command:
        """The next command for a robot at x, y, heading (3,)."""


class Motion:
    """What a robot's wheels can follow: its limits, all multiplied by the scenario's factor, and its speeds now."""

    def __init__(self, factor: float) -> None:
        self.most_mps, self.most_radps = MAX_SPEED_MPS * factor, MAX_TURN_RADPS * factor
        self.acceleration, self.turn_acceleration = _ACCELERATION_MPS2 * factor, _TURN_ACCELERATION_RADPS2 * factor
        self.speed_mps = self.turn_radps = 0.0

    def towards(self, speed_mps: float, turn_radps: float, *, standing: bool) -> Command:
        """Approach the wanted speeds as fast as the accelerations allow."""
        change = self.acceleration * COMMAND_NS / 1e9
        self.speed_mps += float(np.clip(speed_mps - self.speed_mps, -change, change))
        change = self.turn_acceleration * COMMAND_NS / 1e9
        self.turn_radps += float(np.clip(turn_radps - self.turn_radps, -change, change))
        return Command(self.speed_mps, self.turn_radps, standing)


class Driver:
    """Steers along a scenario's way; `done` once the last leg is over."""

    def __init__(self, trajectory: TrajectorySpec, start: Floats, speed_factor: float) -> None:
        self.legs = legs_of(trajectory, start)
        self.done = False
        self.leg: Leg | None = None
        self._lookahead_m = trajectory.lookahead_m
        self._motion = Motion(speed_factor)
        self._pose = start
        self._steps = self._drive()

    def command(self, pose: Floats) -> Command:
        """See `Steering`."""
        self._pose = pose
        speed, turn, standing = next(self._steps, (0.0, 0.0, False))
        return self._motion.towards(speed, turn, standing=standing)

    def _drive(self) -> Iterator[tuple[float, float, bool]]:
        """Wanted speeds and whether the robot stands at a stop, one after the other; ends with the last leg."""
        for leg in self.legs:
            self.leg = leg
            ahead = leg.way_xy[1] - leg.way_xy[0]
            if np.hypot(*ahead) > _ARRIVED_M:
                direction = np.arctan2(ahead[1], ahead[0])
                if abs(wrap(direction - self._pose[2])) > _TURN_FIRST_RAD:
                    yield from self._turn_to(direction)
                yield from self._follow(leg.way_xy)
            if leg.stop.heading_deg is not None:
                yield from self._turn_to(np.deg2rad(leg.stop.heading_deg))
            yield from self._come_to_rest()
            for _ in range(round(leg.stop.stop_s / (COMMAND_NS / 1e9))):
                yield 0.0, 0.0, True
        self.done = True

    def _come_to_rest(self) -> Iterator[tuple[float, float, bool]]:
        while self._motion.speed_mps or self._motion.turn_radps:
            yield 0.0, 0.0, False
        # The wheels follow a little later.
        for _ in range(round(0.1 / (COMMAND_NS / 1e9))):
            yield 0.0, 0.0, False

    def _turn_to(self, heading_rad: float) -> Iterator[tuple[float, float, bool]]:
        """Turn on the spot, slower towards the end."""
        while True:
            error = float(wrap(heading_rad - self._pose[2]))
            if abs(error) < _ARRIVED_RAD and abs(self._motion.turn_radps) < 10 * _LEAST_TURN_RADPS:
                return
            braking = np.sqrt(2 * _BRAKING * self._motion.turn_acceleration * abs(error))
            wanted = max(_LEAST_TURN_RADPS, min(self._motion.most_radps, braking, 8.0 * abs(error)))
            yield 0.0, float(np.copysign(wanted, error)), False

    def _follow(self, way_xy: Floats) -> Iterator[tuple[float, float, bool]]:
        """Pure pursuit (Coulter 1992) of a point on the way, as fast as curvature and the way left allow."""
        ends = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way_xy, axis=0).T))])
        passed = 0.0
        while True:
            passed = _project(way_xy, ends, self._pose[:2], passed, passed + 2 * self._lookahead_m)
            left = self._left(way_xy, ends, passed)
            if left < _ARRIVED_M:
                return
            aim = _point_at(way_xy, ends, passed + self._lookahead_m) - self._pose[:2]
            sideways = -np.sin(self._pose[2]) * aim[0] + np.cos(self._pose[2]) * aim[1]
            curvature = float(2 * sideways / (aim @ aim))
            braking = np.sqrt(2 * _BRAKING * self._motion.acceleration * left)
            bend = max(abs(curvature), 1e-9)
            cornering = min(0.8 * self._motion.most_radps / bend, np.sqrt(_SIDEWAYS_MPS2 / bend))
            speed = max(_LEAST_SPEED_MPS, min(self._motion.most_mps, braking, cornering, 8.0 * left))
            yield speed, speed * curvature, False

    def _left(self, way_xy: Floats, ends: Floats, passed: float) -> float:
        """Distance to go; on the last piece the one along it, which gets negative beyond the end."""
        if passed < ends[-2]:
            return float(ends[-1] - passed)
        along = way_xy[-1] - way_xy[-2]
        return float((way_xy[-1] - self._pose[:2]) @ along / np.hypot(*along))


def legs_of(trajectory: TrajectorySpec, start: Floats) -> list[Leg]:
    """The legs of all laps; the last waypoint always ends a leg."""
    legs = []
    way = [start[:2]]
    count = len(trajectory.waypoints)
    for step in range(count * trajectory.laps):
        point = trajectory.waypoints[step % count]
        ends = point.is_stop or step == count * trajectory.laps - 1
        if np.hypot(*(point.at - way[-1])) > _ARRIVED_M or (ends and len(way) == 1):
            way.append(np.array(point.at))
        if ends:
            legs.append(Leg(np.array(way), point, step % count))
            way = [np.array(point.at)]
    return legs


def expected_duration_s(trajectory: TrajectorySpec, start: Floats, speed_factor: float) -> float:
    """About how long the way takes, for a progress bar."""
    seconds, heading = 0.0, float(start[2])
    for leg in legs_of(trajectory, start):
        for here, there in pairwise(leg.way_xy):
            ahead = there - here
            seconds += float(np.hypot(*ahead)) / (MAX_SPEED_MPS * speed_factor)
            heading = float(np.arctan2(ahead[1], ahead[0])) if ahead.any() else heading
        if leg.stop.heading_deg is not None:
            seconds += 3.0 / speed_factor
        seconds += leg.stop.stop_s
    return seconds


def _project(way_xy: Floats, ends: Floats, point: Floats, low: float, high: float) -> float:
    """How far along the way the point nearest to `point` is, sought between two distances along it."""
    along = np.diff(way_xy, axis=0)
    lengths = np.diff(ends)
    place = ((point - way_xy[:-1]) * along).sum(axis=1) / lengths
    place = np.clip(place, np.clip(low - ends[:-1], 0, lengths), np.clip(high - ends[:-1], 0, lengths))
    away = way_xy[:-1] + along * (place / lengths)[:, None] - point
    reachable = (ends[:-1] <= high) & (ends[1:] >= low)
    distance = np.where(reachable, np.hypot(away[:, 0], away[:, 1]), np.inf)
    best = int(distance.argmin())
    return float(ends[best] + place[best])


def _point_at(way_xy: Floats, ends: Floats, distance: float) -> Floats:
    """The point of the way at a distance along it; beyond its end straight on."""
    i = min(int(np.searchsorted(ends, distance, side="right")) - 1, len(ends) - 2)
    share = (distance - ends[i]) / (ends[i + 1] - ends[i])
    point: Floats = way_xy[i] + share * (way_xy[i + 1] - way_xy[i])
    return point
