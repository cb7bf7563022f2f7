"""How a sensor is mounted, as far as it matters for how it turns: seen from above, and whether upside down."""

from dataclasses import dataclass

import numpy as np

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.geometry.frames import plain, planar
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.inspection.log_frames import LogFrames
from mcap_landmarks.mounting import base_in

_LEVEL = 0.9
"""A sensor whose z axis leans more (cosine) does not see the robot turn as such."""


@dataclass(frozen=True, slots=True, eq=False)
class Mount:
    """Where a sensor sits: base_from_sensor (3,) seen from above, and 1, or -1 where it hangs upside down."""

    base_from_sensor: Array
    upright: float


AT_THE_BASE = Mount(np.zeros(3), 1.0)


def mount_of(frame: str, frames: LogFrames) -> Mount | None:
    """How a frame is mounted; at the base where no transforms lead there, None where it is not level."""
    base = base_in(frames.tree, frame)
    if frame.endswith("optical_frame") and base == plain(frame):
        return None
    try:
        base_from_sensor = frames.tree.lookup(base, frame)
    except RecordingError:
        return None if frame.endswith("optical_frame") else AT_THE_BASE
    up = float(base_from_sensor[2, 2])
    return Mount(planar(base_from_sensor), 1.0 if up > 0 else -1.0) if abs(up) >= _LEVEL else None
