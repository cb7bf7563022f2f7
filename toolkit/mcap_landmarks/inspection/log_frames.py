"""The frames of a whole log: what its transforms and a file of extrinsics connect, and which one is the robot's own."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from mcap_landmarks.channels import TF_STATIC
from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.geometry.frames import REMEDY, FrameTree, is_rigid, plain, rigid
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.mounting import Edge
from mcap_landmarks.stage import Connection, Readable

_MOST_TRANSFORMS = 300
"""So many messages of transforms that may change are read: those of mountings come over and over."""
_FEW = 0.05
"""A frame of a smaller share of a topic's messages is not the sensor's: several sensors take turns."""
_ROBOT = re.compile(r"(^|[/_])(base|robot|body|chassis|vehicle|ego|rover|trunk|footprint)([/_]|\d|$)")
"""What drivers call the robot's own frame, beside REP 105's base_link."""


def is_robot(name: str) -> bool:
    """Whether a frame is by its name that of the robot itself, or has no name."""
    return not name or _ROBOT.search(plain(name)) is not None


@dataclass(frozen=True, slots=True, eq=False)
class LogFrames:
    """The frames of a log: `tree` connects them, `first` has the first transform of each.

    `parents` has the frames that transforms give several parents, with these.
    """

    tree: FrameTree
    first: TFMessage | None = None
    parents: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def base_from(self, base: str, frame: str, what: str) -> Array:
        """base_from_frame (4, 4); no difference where the frame is by its name the robot's own, and not connected.

        Raises:
            RecordingError: nothing leads there; `what` says whose frame it is.
        """
        if plain(frame) in ("", plain(base)):
            return np.eye(4)
        try:
            return self.tree.lookup(base, frame)
        except RecordingError as error:
            if is_robot(frame) and "optical" not in frame:
                return np.eye(4)
            raise RecordingError(
                f"{what} in the frame {plain(frame)}, and no transforms lead from there to {plain(base)}; {REMEDY}"
            ) from error

    def foreign(self, base: str, counts: Mapping[str, int]) -> frozenset[str]:
        """The frames of a topic's messages, with their counts, that are not its own.

        They are those of few messages, and those that nothing connects with the base where most messages' frame is.
        """
        usual = max(counts, key=lambda name: counts[name], default="")
        least, is_known = _FEW * sum(counts.values()), self._leads(base, usual)
        return frozenset(
            name
            for name, count in counts.items()
            if name != usual and (count < least or (is_known and not self._leads(base, name)))
        )

    def _leads(self, base: str, frame: str) -> bool:
        if not frame:
            return False
        try:
            self.tree.lookup(base, frame)
        except RecordingError:
            return False
        return True


def frames_of(log: Readable, own: Sequence[Edge] = ()) -> LogFrames:
    """The frames of a log, whenever their transforms were logged; `own` are those of a file, which win."""
    return frames_from(_transforms(log), own)


def frames_from(steps: Iterable[Transform], own: Sequence[Edge] = ()) -> LogFrames:
    """The frames that transforms connect, by the first one of each; `own` win."""
    first: dict[str, Transform] = {}
    parents: dict[str, dict[str, None]] = {}
    for step in steps:
        if not is_rigid(step.translation_m, step.rotation_xyzw):
            continue  # what needs it says that it is missing
        first.setdefault(plain(step.child_frame_id), step)
        parents.setdefault(plain(step.child_frame_id), {})[plain(step.frame_id)] = None
    edges = [(step.frame_id, name, rigid(step.translation_m, step.rotation_xyzw)) for name, step in first.items()]
    several = {child: tuple(names) for child, names in parents.items() if len(names) > 1}
    return LogFrames(FrameTree.of([*edges, *own]), TFMessage(tuple(first.values())) if first else None, several)


def _transforms(log: Readable) -> Iterable[Transform]:
    connections = [entry.connection for entry in log.channels if entry.connection.message_type == TFMessage.ROS_TYPE]
    for connection in sorted(connections, key=_may_change):
        raws = log.messages([connection])
        for raw in islice(raws, _MOST_TRANSFORMS) if _may_change(connection) else raws:
            try:
                yield from decode(TFMessage, raw.data).transforms
            except MessageError:
                continue


def _may_change(connection: Connection) -> bool:
    return not connection.topic.endswith(TF_STATIC.topic)
