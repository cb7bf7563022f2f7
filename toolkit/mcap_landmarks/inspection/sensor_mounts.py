"""How a sensor is mounted, as far as it matters for how it turns: seen from above, and whether upside down."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from mcap_landmarks.channels import TF_STATIC
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.geometry.frames import plain, planar
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.mounting import Mounting
from mcap_landmarks.stage import Bundle

_LEVEL = 0.9
"""A sensor whose z axis leans more (cosine) does not see the robot turn as such."""


@dataclass(frozen=True, slots=True, eq=False)
class Mount:
    """Where a sensor sits: base_from_sensor (3,) seen from above, and 1, or -1 where it hangs upside down."""

    base_from_sensor: Array
    upright: float


AT_THE_BASE = Mount(np.zeros(3), 1.0)


def mount_of(frame: str, transforms: Iterable[Transform], extrinsics: Location | None = None) -> Mount | None:
    """How a frame is mounted by transforms; at the base where they do not lead there, None where it is not level."""
    steps = {plain(step.child_frame_id): step for step in transforms}
    bundle = Bundle(0, 0, {TF_STATIC: TFMessage(tuple(steps.values()))})
    try:
        mounting = Mounting(extrinsics)
        base_from_sensor = mounting.lookup(bundle, mounting.base(bundle, frame), frame)
    except ToolkitError:
        return None if frame.endswith("optical_frame") else AT_THE_BASE
    up = float(base_from_sensor[2, 2])
    if abs(up) < _LEVEL or (frame.endswith("optical_frame") and not steps):
        return None
    return Mount(planar(base_from_sensor), 1.0 if up > 0 else -1.0)
