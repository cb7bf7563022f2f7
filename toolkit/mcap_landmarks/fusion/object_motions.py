"""How fast all objects of scenes move, by their ids; and which of them objects of a new scan are."""

from collections.abc import Sequence

import numpy as np

from mcap_landmarks.classes import speed_mps
from mcap_landmarks.fusion.motion_gate import match
from mcap_landmarks.fusion.track_motion import TrackMotion, TrackPlace
from mcap_landmarks.geometry.se2 import Array, rotation, transform_points
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.velocities import SceneVelocities
from mcap_landmarks.stage import OdometryAt

_MEMORY_NS = 3 * 10**9
"""What was not seen for longer is another object."""
_LEAST_VARIANCE = 0.05**2
"""No object's place is known better than to 5 cm, in m^2, where its velocity is asked: people swing their legs."""


class ObjectMotions:
    """The motion of every object that was seen lately, in the odometry frame."""

    def __init__(self) -> None:
        self._motions: dict[str, TrackMotion] = {}
        self._classes: dict[str, str] = {}
        self._widened: dict[str, float] = {}
        self._count = 0

    def names(
        self, stamp_ns: int, odom_from_base: Array | None, seen: tuple[Array, Array], classes: Sequence[str]
    ) -> tuple[str, ...]:
        """The ids of objects that have none of their own: those of what they are, else new ones.

        `seen` are places (N, 2) and covariances (N, 2, 2) in the base frame. Without odometry nothing is known to be
        where it was, and every object is new.
        """
        if odom_from_base is None:
            return tuple(self._new() for _ in classes)
        self._forget(stamp_ns)
        known = list(self._motions)
        motions = [(self._motions[name], self._classes[name]) for name in known]
        found = match(motions, stamp_ns, _placed(*seen, odom_from_base), classes)
        return tuple(known[found[i]] if i in found else self._new() for i in range(len(classes)))

    def surprises(
        self, stamp_ns: int, odom_from_base: Array | None, seen: tuple[Array, Array], names: Sequence[str]
    ) -> Array:
        """How far objects (N,) are off where they should be by their tracks: squared, by both covariances, per degree.

        1, what is to be expected, for those that were not seen before, and the least for others. `seen` is as in
        `names`. Covariances that are so many times wider are not those by which `add` takes a scene's velocities: what
        drives would seem to be ever less sure of standing elsewhere.
        """
        factors = np.ones(len(names))
        if odom_from_base is None:
            return factors
        for i, (place, spread) in enumerate(zip(*_placed(*seen, odom_from_base), strict=True)):
            if names[i] in self._motions:
                there, unsure = self._motions[names[i]].expected(stamp_ns)
                off = place - there
                factors[i] = max(off @ np.linalg.solve(spread + unsure, off) / 2, 1.0)
        self._widened = dict(zip(names, factors.tolist(), strict=True))
        return factors

    def add(self, scene: SceneObjects, odometry: OdometryAt | None) -> SceneVelocities | None:
        """The velocities of a scene's objects, now that it was seen; None without odometry."""
        if odometry is None:
            self.forget()
            return None
        self._forget(scene.stamp_ns)
        widened = np.array([self._widened.pop(name, 1.0) for name in scene.ids])
        fitted = scene.covariances / widened[:, None, None]
        places, covariances = _placed(scene.positions_xy, fitted, odometry.odom_from_base)
        ranges = np.hypot(*scene.positions_xy.T)
        for i, name in enumerate(scene.ids):
            motion = self._motions.setdefault(name, TrackMotion())
            at = odometry.way_m, odometry.turned_rad, float(ranges[i])
            motion.note(TrackPlace(scene.stamp_ns, places[i], covariances[i], *at), speed_mps(scene.classes[i]))
            self._classes[name] = scene.classes[i]
        back = rotation(-odometry.odom_from_base[2])
        told = [(name, motion, motion.velocity) for name in scene.ids if (motion := self._motions[name]).velocity]
        return SceneVelocities(
            scene.stamp_ns,
            scene.frame_id,
            tuple(name for name, _, _ in told),
            np.array([back @ velocity.xy_mps for _, _, velocity in told if velocity]).reshape(-1, 2),
            np.array([back @ velocity.covariance @ back.T for _, _, velocity in told if velocity]).reshape(-1, 2, 2),
            np.array([motion.moving for _, motion, _ in told], dtype=np.float64),
        )

    def forget(self) -> None:
        """Odometry begins anew: nothing is known to be where it was."""
        self._motions.clear()
        self._classes.clear()

    def _forget(self, stamp_ns: int) -> None:
        gone = [name for name, one in self._motions.items() if abs(stamp_ns - one.last.stamp_ns) > _MEMORY_NS]
        for name in gone:
            del self._motions[name], self._classes[name]

    def _new(self) -> str:
        self._count += 1
        return str(self._count)


def _placed(positions_xy: Array, covariances: Array, odom_from_base: Array) -> tuple[Array, Array]:
    """Places (N, 2) and covariances (N, 2, 2) in the odometry frame."""
    turn = rotation(odom_from_base[2])
    spread = turn @ covariances @ turn.T + _LEAST_VARIANCE * np.eye(2)
    return transform_points(odom_from_base, positions_xy), spread
