"""The path of a robot that is localized again and again, sent so often that a viewer can draw it while it grows."""

from dataclasses import replace

import numpy as np

from mcap_landmarks.messages.poses import Path, PoseStamped

_GROWTH = 1.1
"""A path is sent when it has grown by a tenth, and at its end: a tenth at most is not yet drawn, and all paths of N
poses hold 12 N together; one for every pose would make N^2 / 2."""
_MOST = 2000
"""About as many poses as a screen has columns of pixels; of more every second one is left out, and so on."""
_LEVEL = np.array([0.0, 0.0, 0.0, 1.0])


class DrawnPath:
    """The poses so far; `add` and `rest` give the path when it is due.

    A pose without heading, whose quaternion is zero, gets that of heading zero: RViz draws no path with a zero one.
    """

    def __init__(self) -> None:
        self._poses: list[PoseStamped] = []
        self._latest: PoseStamped | None = None
        self._count, self._sent, self._stride = 0, 0, 1

    def add(self, pose: PoseStamped) -> Path | None:
        """Take the next pose; the path up to it, if it has grown enough since it was given last."""
        self._latest = pose if pose.orientation_xyzw.any() else replace(pose, orientation_xyzw=_LEVEL)
        if self._count % self._stride == 0:
            self._poses.append(self._latest)
        self._count += 1
        if len(self._poses) > _MOST:
            self._poses, self._stride = self._poses[::2], 2 * self._stride
        return self.rest() if self._count >= _GROWTH * self._sent else None

    def rest(self) -> Path | None:
        """The whole path, if it has grown since it was given last."""
        if self._latest is None or self._count == self._sent:
            return None
        self._sent = self._count
        ends = () if self._poses[-1] is self._latest else (self._latest,)
        return Path(self._latest.stamp_ns, self._latest.frame_id, (*self._poses, *ends))
