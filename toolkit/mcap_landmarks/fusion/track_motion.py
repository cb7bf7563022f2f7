"""How one tracked object moves: its last places, what velocity that says, and whether it moves at all."""

import math
from typing import NamedTuple

import numpy as np

from mcap_landmarks.geometry.se2 import Array

_WINDOW_NS, _MOST = 2 * 10**9, 20
"""For how long, and how many, places are remembered: cars that brake have another velocity two seconds later."""
_LEAST_NS = 10**8
"""Over a shorter time no velocity is told."""
_LEAST_PLACES = 4
"""Fewer places in a line may be of several objects, each seen once: a row of parked cars, as one drives by. With more
it is sure that something moves."""
_LEAST_MPS = 0.3
"""Slower than this is as good as standing: the middle of an object wanders as more of it comes into view."""
MOVING, _STRAYING, _STRAYING_MPS = 0.3, 0.01, 1.0
"""How many things of classes that move by themselves do, and how many others, at what usual speed: what is carried, and
what the network takes for something else."""
_ODDS = 100.0
"""So much likelier must it be that something moves than that it stands, since every object is asked at every scan."""
_UNSURE = 0.99
"""Fewer places, or lesser odds, never make it surer than this that something moves."""
_TWO = 2
"""So few places say little of whether it moves at all: two objects may be taken for one."""
_UNKNOWN, _WANDERS = 0.5, 9.0
"""How probable it is that something moves that is in no line, but three standard deviations off its mean and more."""
_STRAIGHT = 0.9
"""Share of the variance of places that a constant velocity explains, if it is one: a place that jumps has 0.75."""

_POSITION_SHARE, _HEADING_RAD, _HEADING_SHARE = 0.02, 0.005, 0.05
"""How far odometry may be off over a second or two: a share of the way, a heading of 0.3 degrees after a metre that
grows with the root of the way, and a share of the turning. Wheels that slip on the thesis's turns are off by 2 to 4 %
of these."""


class TrackPlace(NamedTuple):
    """Where an object was: place_xy (2,) in the odometry frame with covariance (2, 2), how far from the robot, and how
    far that had driven and turned by then.
    """

    stamp_ns: int
    place_xy: Array
    covariance: Array
    way_m: float
    turned_rad: float
    range_m: float


class Velocity(NamedTuple):
    """A velocity (2,) in m/s in the odometry frame with its covariance (2, 2)."""

    xy_mps: Array
    covariance: Array


class TrackMotion:
    """The last places of one object, its velocity, and how probable it is that it moves: 1 once it surely did."""

    def __init__(self) -> None:
        self.moving = 0.0
        self.velocity: Velocity | None = None
        self._places: list[TrackPlace] = []

    @property
    def last(self) -> TrackPlace:
        """Where it was last."""
        return self._places[-1]

    def expected(self, stamp_ns: int) -> tuple[Array, Array]:
        """Where it should be at a time: place (2,) and covariance (2, 2).

        What stands should be where it was on the whole; that is no surer for many places, whose errors are alike.
        """
        if self.moving == 1.0 and self.velocity is not None:
            since_s = (stamp_ns - self.last.stamp_ns) / 1e9
            ahead = self.last.place_xy + since_s * self.velocity.xy_mps
            return ahead, self.last.covariance + since_s**2 * self.velocity.covariance
        covariances = np.array([one.covariance for one in self._places])
        weights = _weights(covariances)
        places = np.array([one.place_xy for one in self._places])
        return weights @ places, np.einsum("n,nij->ij", weights, covariances)

    def note(self, place: TrackPlace, speed_mps: float) -> None:
        """Another place, later than those before, of something of a class that is usually so fast."""
        since = place.stamp_ns - _WINDOW_NS
        self._places = [one for one in self._places[1 - _MOST :] if one.stamp_ns >= since] + [place]
        self._estimate(speed_mps)

    def _estimate(self, speed_mps: float) -> None:
        """Fit a constant velocity to the places.

        Their errors are taken for one that comes in slowly, as it does when another side of an object comes into view:
        many places say the velocity no better than two of them that lie as far apart in time.
        """
        self.velocity = None
        span_s = (self.last.stamp_ns - self._places[0].stamp_ns) / 1e9
        if span_s < _LEAST_NS / 1e9:
            return
        times = np.array([(one.stamp_ns - self.last.stamp_ns) / 1e9 for one in self._places])
        places = np.array([one.place_xy for one in self._places])
        covariances = np.array([one.covariance for one in self._places])
        line = _line(times, places, covariances)
        if not line.is_straight and len(places) > _LEAST_PLACES:
            # One place may be that of something else.
            rest = np.arange(len(places)) != int(np.argmax((line.off**2).sum(axis=1)))
            line = _line(times[rest], places[rest], covariances[rest])
        spread = 2 * line.covariance + self._drift() * np.eye(2)
        self.velocity = Velocity(line.velocity, spread / span_s**2)
        self._judge(self.velocity, speed_mps, line)

    def _judge(self, velocity: Velocity, speed_mps: float, line: "_Line") -> None:
        """Say how probable it is that the object moves.

        Of one that is here and there, in no line, nobody knows; two places may be of two objects.
        """
        odds = _odds(velocity, speed_mps) if np.hypot(*velocity.xy_mps) >= _LEAST_MPS else 0.0
        count = len(self._places)
        if self.moving == 1.0 or (line.is_straight and odds >= _ODDS and count >= _LEAST_PLACES):
            self.moving = 1.0
        elif line.is_straight:
            self.moving = min(odds / (1 + odds), _UNSURE if count > _TWO else MOVING)
        else:
            self.moving = _UNKNOWN if line.wander > _WANDERS else 0.0

    def _drift(self) -> float:
        """The variance in m^2 of what odometry makes an object seem to move, between the first place and the last."""
        first, last = self._places[0], self.last
        way, turned = last.way_m - first.way_m, last.turned_rad - first.turned_rad
        position = (_POSITION_SHARE * way) ** 2
        heading = _HEADING_RAD**2 * way + (_HEADING_SHARE * turned) ** 2
        return position + heading * last.range_m**2


class _Line(NamedTuple):
    """A constant velocity (2,) through places: how far these (N, 2) are off it, the mean of their covariances (2, 2),
    whether it explains them, and how far they are off one place, squared and by that covariance."""

    velocity: Array
    off: Array
    covariance: Array
    is_straight: bool
    wander: float


def _line(times_s: Array, places: Array, covariances: Array) -> _Line:
    """The line through places (N, 2) at times (N,), by least squares."""
    weights = _weights(covariances)
    since, away = times_s - weights @ times_s, places - weights @ places
    velocity = (weights * since) @ away / (weights @ since**2)
    off, mean = away - since[:, None] * velocity, np.einsum("n,nij->ij", weights, covariances)
    whole = float(weights @ (away**2).sum(axis=1))
    straight = float(weights @ (off**2).sum(axis=1)) <= (1 - _STRAIGHT) * whole
    return _Line(velocity, off, mean, straight, whole / float(np.trace(mean)))


def _weights(covariances: Array) -> Array:
    """How much places with covariances (N, 2, 2) count, (N,), in all 1."""
    weights: Array = 1 / np.trace(covariances, axis1=1, axis2=2)
    weights /= weights.sum()
    return weights


def _odds(velocity: Velocity, speed_mps: float) -> float:
    """How much likelier something of a measured velocity is to move, at its usual speed, than to stand."""
    usual, prior = (speed_mps, MOVING) if speed_mps else (_STRAYING_MPS, _STRAYING)
    whole = velocity.covariance + usual**2 * np.eye(2)
    stands, moves = (
        float(velocity.xy_mps @ np.linalg.solve(spread, velocity.xy_mps)) for spread in (velocity.covariance, whole)
    )
    ratio = math.sqrt(np.linalg.det(velocity.covariance) / np.linalg.det(whole))
    # Beyond the limit nobody asks how much likelier it is.
    return prior / (1 - prior) * ratio * math.exp(min((stands - moves) / 2, 100.0))
