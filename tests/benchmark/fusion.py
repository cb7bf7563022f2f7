"""Whether fusing a bundle takes longer the longer the way: a street that is driven along at 5 m/s.

python -m tests.benchmark.fusion [--json] [--quick]
"""

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mcap_landmarks.fusion.camera_view import SeenImage
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.fuser import Fuser
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.scan_objects import ScanObjects

from tests.benchmark.rows import Row, main
from tests.fusion.cylinders import SCANNED, Thing, boxes, camera_view, detected, scanned

SPEED_MPS, SCANS_HZ, SECONDS = 5.0, 10, 120
SPACING_M, ASIDE_M = 6.0, 3.0
SEEN_M, SHOWN_M = 12.0, 30.0
"""How far the LiDAR and the camera see."""
ROUNDS = 5


def measure(quick: bool) -> Iterator[Row]:
    """The one row."""
    quarters = np.array([_quarters() for _ in range(1 if quick else ROUNDS)])
    growth = float(np.median(quarters[:, 1] / quarters[:, 0]))
    first, last = 1e3 * np.median(quarters, axis=0)
    peers = {"first quarter ms": float(first), "last quarter ms": float(last)}
    yield Row("street_growth", growth, "x", at_most=1.3, cases=len(quarters) * SCANS_HZ * SECONDS // 4, peers=peers)


def _quarters() -> tuple[float, float]:
    """Seconds of the processor per bundle in the first quarter of the way and in the last one, by turns."""
    count = SCANS_HZ * SECONDS // 4
    early, late = Drive(), Drive()
    for _ in range(3 * count):
        late.step()
    both = np.array([(early.step(), late.step()) for _ in range(count)])
    first, last = both.mean(axis=0).tolist()
    return first, last


@dataclass(slots=True)
class _Moment:
    """What a robot on the street has at one scan."""

    objects: ScanObjects
    image: SeenImage
    odometry: Array


class Drive:
    """A robot that drives along a street of hydrants, persons and suitcases on both sides."""

    def __init__(self) -> None:
        self._fuser = Fuser(FuseConfig())
        self._scans = 0

    def step(self) -> float:
        """Fuse the next scan with the image beside it; returns the seconds of the processor that this takes."""
        moment = self._moment()
        self._scans += 1
        started = time.process_time()
        self._fuser.add(moment.objects, [moment.image], moment.odometry)
        return time.process_time() - started

    def _moment(self) -> _Moment:
        x, stamp_ns = SPEED_MPS * self._scans / SCANS_HZ, 10**9 + self._scans * 10**9 // SCANS_HZ
        first, last = np.floor((x - SHOWN_M) / SPACING_M), np.ceil((x + SHOWN_M) / SPACING_M)
        things = {
            f"{i} {side}": Thing(SCANNED[(i + side) % len(SCANNED)], SPACING_M * i - x, side * ASIDE_M)
            for i in range(int(first), int(last))
            for side in (-1, 1)
        }
        seen = {name: thing for name, thing in things.items() if np.hypot(thing.x, thing.y) < SEEN_M}
        shown = [thing for thing in things.values() if thing.x > ASIDE_M]
        return _Moment(
            scanned(list(seen.values()), stamp_ns, list(seen)),
            SeenImage(detected([thing.name for thing in shown], boxes(shown), stamp_ns), camera_view()),
            np.array([x, 0.0, 0.0]),
        )


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or ""))
