"""Ids that objects keep from scan to scan."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from mcap_landmarks.geometry.se2 import Array, transform_points


@dataclass(slots=True)
class _Track:
    name: str
    place_xy: Array
    seen_ns: int


class Tracks:
    """What was seen lately and where, in the odometry frame."""

    def __init__(self, gate_m: float, memory_s: float) -> None:
        self._gate_m, self._memory_ns = gate_m, int(memory_s * 1e9)
        self._tracks: list[_Track] = []
        self._count = 0

    def names(self, stamp_ns: int, odom_from_base: Array | None, places_xy: Array) -> tuple[str, ...]:
        """The ids of objects at places (N, 2) in the base frame: those of tracks nearby, else new ones.

        Without odometry nothing is known to be where it was, and every object is new.
        """
        self._tracks = [track for track in self._tracks if abs(stamp_ns - track.seen_ns) <= self._memory_ns]
        if odom_from_base is None:
            self.forget()
            return tuple(self._new() for _ in range(len(places_xy)))
        places = transform_points(odom_from_base, places_xy)
        matched = self._match(places)
        for i, place in enumerate(places):
            if i not in matched:
                matched[i] = _Track(self._new(), place, stamp_ns)
                self._tracks.append(matched[i])
            matched[i].place_xy, matched[i].seen_ns = place, stamp_ns
        return tuple(matched[i].name for i in range(len(places)))

    def forget(self) -> None:
        """Odometry begins anew: nothing is known to be where it was."""
        self._tracks = []

    def _match(self, places: Array) -> dict[int, _Track]:
        if not (len(places) and self._tracks):
            return {}
        away = places[:, None] - np.array([track.place_xy for track in self._tracks])
        cost = np.minimum((away**2).sum(axis=-1) / self._gate_m**2, 1.0)
        rows, columns = linear_sum_assignment(cost)
        return {int(i): self._tracks[j] for i, j in zip(rows, columns, strict=True) if cost[i, j] < 1.0}

    def _new(self) -> str:
        self._count += 1
        return str(self._count)


@dataclass(slots=True)
class PieceChange:
    """Whether odometry began anew since the last scan: what was seen before has no place any more."""

    _latest: int | None = None

    def at(self, piece: int | None) -> bool:
        """Whether a scan's piece of odometry, None without odometry, is another one than that before."""
        if piece is None:
            return False
        before, self._latest = self._latest, piece
        return before is not None and before != piece
