"""The frames of a whole log: what its transforms and a file of extrinsics connect, and which one is the robot's own."""

import contextlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from mcap_landmarks.channels import TF_STATIC
from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.geometry.frames import REMEDY, FrameTree, is_rigid, plain, rigid
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.mounting import WORLDS, Edge
from mcap_landmarks.stage import Readable

_MOST_TRANSFORMS = 300
"""So many messages of transforms that may change are read: those of mountings come over and over."""
_FEW = 0.05
"""A frame of a smaller share of a topic's messages is not the sensor's: several sensors take turns."""
BROKEN_REMEDY = "mend what publishes it, or give --extrinsics FILE"
_STILL_M, _STILL = 1e-3, 1e-6
"""Transforms that differ by less than a millimetre, and in the quaternion by less than a milliradian, are the same."""
_ROBOT = re.compile(r"(^|[/_])(base|robot|body|chassis|vehicle|ego|rover|trunk|footprint)([/_]|\d|$)")
"""What drivers call the robot's own frame, beside REP 105's base_link."""


def is_robot(name: str) -> bool:
    """Whether a frame is by its name that of the robot itself, or has no name."""
    return not name or _ROBOT.search(plain(name)) is not None


@dataclass(frozen=True, slots=True, eq=False)
class LogFrames:
    """The frames of a log: `tree` connects them, `first` has the first transform of each.

    `parents` has the frames that transforms give several parents, with these, and `moving` those that move against
    their parents: the tree lacks them, since one transform does not tell where they are. `broken` are those whose
    transforms are none.
    """

    tree: FrameTree
    first: TFMessage | None = None
    parents: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    moving: frozenset[str] = frozenset()
    broken: frozenset[str] = frozenset()

    @property
    def circle(self) -> tuple[str, ...]:
        """Frames whose transforms go round, so that nothing tells where any of them is; empty where none do."""
        for name in self.tree.parents:
            seen = [name]
            while (above := self.tree.parents.get(seen[-1])) is not None and above[0] not in seen:
                seen.append(above[0])
            if above is not None and above[0] == name:
                return (*seen, name)
        return ()

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
            if plain(frame) in WORLDS or plain(frame) in self.moving:
                why, remedy = "which moves against the robot", "record them in a frame that is fixed to it"
            elif plain(frame) in self.broken:
                why, remedy = "whose transform has a quaternion of zeros or numbers that are not finite", BROKEN_REMEDY
            else:
                why, remedy = f"and no transforms lead from there to {plain(base)}", REMEDY
            raise RecordingError(f"{what} in the frame {plain(frame)}, {why}; {remedy}") from error

    def foreign(self, base: str, counts: Mapping[str, int]) -> frozenset[str]:
        """The frames of a topic's messages, with their counts, that are not its own.

        They are those of few messages, and that of a single one that nothing connects with the base, where most
        messages' frame is connected. A camera of many messages that nothing connects is no stray.
        """
        usual = max(counts, key=lambda name: counts[name], default="")
        least, is_known = _FEW * sum(counts.values()), self._leads(base, usual)
        return frozenset(
            name
            for name, count in counts.items()
            if name != usual and (count < least or (count == 1 and is_known and not self._leads(base, name)))
        )

    def _leads(self, base: str, frame: str) -> bool:
        if not frame:
            return False
        try:
            self.tree.lookup(base, frame)
        except RecordingError:
            return False
        return True


@dataclass(slots=True)
class GatheredFrames:
    """Transforms of a log, one by one: the first of each frame, its parents, and which frames move.

    A frame that /tf_static tells once does not move.
    """

    first: dict[str, Transform] = field(default_factory=dict)
    parents: dict[str, dict[str, None]] = field(default_factory=dict)
    moving: set[str] = field(default_factory=set)
    fixed: set[str] = field(default_factory=set)
    broken: set[str] = field(default_factory=set)

    def take(self, step: Transform, *, is_static: bool) -> None:
        """One more transform; one that is none is left to whoever needs it."""
        child = plain(step.child_frame_id)
        if not is_rigid(step.translation_m, step.rotation_xyzw):
            self.broken.add(child)
            return
        before = self.first.setdefault(child, step)
        self.parents.setdefault(child, {})[plain(step.frame_id)] = None
        if is_static:
            self.fixed.add(child)
        elif plain(step.frame_id) in WORLDS or not _alike(before, step):
            self.moving.add(child)

    def frames(self, own: Sequence[Edge] = ()) -> LogFrames:
        """The frames that the transforms connect; `own` win."""
        moving = frozenset(self.moving - self.fixed)
        edges = [
            (step.frame_id, name, rigid(step.translation_m, step.rotation_xyzw))
            for name, step in self.first.items()
            if name not in moving
        ]
        several = {child: tuple(names) for child, names in self.parents.items() if len(names) > 1}
        firsts = TFMessage(tuple(self.first.values())) if self.first else None
        broken = frozenset(self.broken - {*self.first})
        return LogFrames(FrameTree.of([*edges, *own]), firsts, several, moving, broken)


def frames_of(log: Readable, own: Sequence[Edge] = ()) -> LogFrames:
    """The frames of a log, whenever their transforms were logged; `own` are those of a file, which win."""
    found = GatheredFrames()
    connections = [entry.connection for entry in log.channels if entry.connection.read_as == TFMessage.ROS_TYPE]
    for connection in sorted(connections, key=lambda one: not is_static(one.topic)):
        raws = log.messages([connection])
        for raw in raws if is_static(connection.topic) else islice(raws, _MOST_TRANSFORMS):
            with contextlib.suppress(MessageError):
                for step in decode(TFMessage, raw.data).transforms:
                    found.take(step, is_static=is_static(connection.topic))
    return found.frames(own)


def told_circle(circle: Sequence[str]) -> str:
    """What is to be said of frames whose transforms go round, and what to do."""
    return f"transforms go round in a circle, {' from '.join(circle)}; stop whatever publishes one of them"


def is_static(topic: str) -> bool:
    """Whether a topic has transforms that never change."""
    return topic.endswith(TF_STATIC.topic)


def _alike(one: Transform, other: Transform) -> bool:
    """Whether two transforms of a frame are the same, but for its parent and for rounding."""
    if plain(one.frame_id) != plain(other.frame_id):
        return True
    turned = abs(float(one.rotation_xyzw @ other.rotation_xyzw))
    scale = float(np.linalg.norm(one.rotation_xyzw) * np.linalg.norm(other.rotation_xyzw))
    return bool(np.abs(one.translation_m - other.translation_m).max() < _STILL_M) and turned > (1 - _STILL) * scale
