"""Rigid transforms of space as (4, 4) matrices, and the tree of frames that sensors are mounted in."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.geometry.se2 import Array

REMEDY = "record /tf_static, or give --extrinsics FILE"


def rigid(translation_m: ArrayLike, rotation_xyzw: ArrayLike) -> Array:
    """(4, 4) of a translation (3,) and a quaternion (4,), which need not be normalised.

    Raises:
        RecordingError: the quaternion is zero, or a number is not finite.
    """
    translation, quaternion = np.asarray(translation_m, dtype=np.float64), np.asarray(rotation_xyzw, dtype=np.float64)
    if not is_rigid(translation, quaternion):
        raise RecordingError(f"{translation.tolist()}, {quaternion.tolist()} is no rigid transform; {REMEDY}")
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - takes a fifth of a second, and most verbs need none

    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = Rotation.from_quat(quaternion).as_matrix(), translation
    return matrix


def is_rigid(translation_m: ArrayLike, rotation_xyzw: ArrayLike) -> bool:
    """Whether a translation (3,) and a quaternion (4,) make a transform: finite, and the quaternion is not zero."""
    return bool(np.isfinite([*np.asarray(translation_m), *np.asarray(rotation_xyzw)]).all() and np.any(rotation_xyzw))


def inverse(dst_from_src: Array) -> Array:
    """src_from_dst (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = dst_from_src[:3, :3].T
    matrix[:3, 3] = -dst_from_src[:3, :3].T @ dst_from_src[:3, 3]
    return matrix


def apply(dst_from_src: Array, points: ArrayLike) -> Array:
    """Points (..., 3) of frame src in frame dst."""
    moved: Array = np.asarray(points, dtype=np.float64) @ dst_from_src[:3, :3].T + dst_from_src[:3, 3]
    return moved


def planar(dst_from_src: Array) -> Array:
    """x, y, heading (3,) of a transform (4, 4) seen from above; the heading is that of src's x axis."""
    return np.array([dst_from_src[0, 3], dst_from_src[1, 3], np.arctan2(dst_from_src[1, 0], dst_from_src[0, 0])])


def plain(name: str) -> str:
    """A frame's name without the leading slash that ROS 1 gave it."""
    return name.lstrip("/")


@dataclass(frozen=True, slots=True, eq=False)
class FrameTree:
    """Frames by name, each with its parent's name and parent_from_child (4, 4); names have no leading slash."""

    parents: Mapping[str, tuple[str, Array]]

    @classmethod
    def of(cls, edges: Iterable[tuple[str, str, Array]]) -> "FrameTree":
        """The tree of (parent, child, parent_from_child); of several with one child the last counts."""
        return cls({plain(child): (plain(parent), matrix) for parent, child, matrix in edges})

    def __contains__(self, name: str) -> bool:
        return plain(name) in self.parents or any(parent == plain(name) for parent, _ in self.parents.values())

    def chain(self, name: str) -> list[tuple[str, Array]]:
        """A frame and its ancestors up to the root, each with ancestor_from_frame (4, 4)."""
        steps = [(plain(name), np.eye(4))]
        while steps[-1][0] in self.parents and len(steps) <= len(self.parents):
            parent, parent_from_child = self.parents[steps[-1][0]]
            steps.append((parent, parent_from_child @ steps[-1][1]))
        return steps

    def lookup(self, dst: str, src: str) -> Array:
        """dst_from_src (4, 4) along the tree.

        Raises:
            RecordingError: the frames are not connected; says where the way ends.
        """
        ups, downs = self.chain(src), dict(self.chain(dst))
        for name, ancestor_from_src in ups:
            if name in downs:
                return inverse(downs[name]) @ ancestor_from_src
        if not (plain(src) and plain(dst)):
            raise RecordingError(f"a message names no frame, where {plain(src) or plain(dst)} is asked for; {REMEDY}")
        ends = sorted({ups[-1][0], self.chain(dst)[-1][0]})
        raise RecordingError(
            f"no transforms lead from {plain(src)} to {plain(dst)}: {' and '.join(ends)} have no parent; {REMEDY}"
        )
