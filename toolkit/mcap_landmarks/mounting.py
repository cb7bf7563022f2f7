"""Where the sensors sit on the robot: from the log's transforms, or from a file of extrinsics."""

import json
import sys
import tomllib
from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from mcap_landmarks.channels import BASE_FRAME, MAP_FRAME, ODOM_FRAME, TF_STATIC
from mcap_landmarks.errors import UsageError
from mcap_landmarks.geometry.frames import FrameTree, plain, rigid
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.locations import Location, to_read
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.stage import Bundle

Edge = tuple[str, str, Array]

BASES = (BASE_FRAME, "base_link")
WORLDS = (MAP_FRAME, ODOM_FRAME, "odom_combined", "world", "earth")


class Mounting:
    """Transforms between the robot's frames, as a bundle's log and the file `extrinsics` tell them; the file wins."""

    def __init__(self, extrinsics: Location | None = None) -> None:
        """Read the file, if there is one.

        Raises:
            UsageError: see `read_extrinsics`.
        """
        self._own = read_extrinsics(extrinsics) if extrinsics else []
        self._seen: TFMessage | None = None
        self._tree = FrameTree.of(self._own)
        self._found: dict[tuple[str, str], Array] = {}

    def lookup(self, bundle: Bundle, dst: str, src: str) -> Array:
        """dst_from_src (4, 4) at a bundle's time.

        Raises:
            RecordingError: the frames are not connected; says what is missing and what to do.
        """
        self._update(bundle)
        if (dst, src) not in self._found:
            self._found[dst, src] = self._tree.lookup(dst, src)
        return self._found[dst, src]

    def base(self, bundle: Bundle, sensor: str) -> str:
        """The robot's base frame: `base_footprint`, `base_link`, or what else carries the sensor; itself if nothing."""
        self._update(bundle)
        return base_in(self._tree, sensor)

    def _update(self, bundle: Bundle) -> None:
        message = bundle.get(TF_STATIC)
        if message is None or message is self._seen:
            return
        edges = [
            (step.frame_id, step.child_frame_id, rigid(step.translation_m, step.rotation_xyzw))
            for step in message.transforms
        ]
        self._seen, self._tree, self._found = message, FrameTree.of([*edges, *self._own]), {}


def base_in(tree: FrameTree, sensor: str) -> str:
    """The robot's own frame: `base_footprint`, `base_link`, or what else carries a sensor; itself if nothing."""
    for name in BASES:
        if name in tree:
            return name
    names = [name for name, _ in tree.chain(sensor)]
    return next((name for name in reversed(names) if name not in WORLDS), plain(sensor))


def read_extrinsics(path: Location) -> list[Edge]:
    """Transforms of a TOML or JSON file: a list `transforms` of `parent`, `child`, `xyz` (m), `rpy` or `quaternion`.

    `rpy` are roll, pitch, yaw in rad about the parent's fixed axes, as in a URDF; `quaternion` is x, y, z, w. Without
    either the axes are parallel. For example, in TOML::

        [[transforms]]
        parent = "base_link"
        child = "laser"
        xyz = [0.1, 0.0, 0.2]
        rpy = [0.0, 0.0, 3.14159]

    Raises:
        UsageError: the file cannot be read, or an entry is not of this form.
    """
    try:
        text = to_read(path).read_text()
        content = json.loads(text) if path.suffix.lower() == ".json" else tomllib.loads(text)
    except (OSError, ValueError, RecursionError) as error:
        raise UsageError(f"{path}: extrinsics cannot be read: {error}; write TOML or JSON") from error
    entries = content.get("transforms") if isinstance(content, Mapping) else None
    if not isinstance(entries, list) or not entries:
        raise UsageError(f"{path}: there is no list transforms; write one [[transforms]] table per sensor")
    return [_edge(path, number, entry) for number, entry in enumerate(entries, 1)]


def _edge(path: Location, number: int, entry: object) -> Edge:
    where = f"{path}: transform {number}"
    known = {"parent", "child", "xyz", "rpy", "quaternion"}
    if not isinstance(entry, Mapping) or not {"parent", "child", "xyz"} <= {*entry} <= known:
        raise UsageError(f"{where}: give parent, child, xyz, and rpy or quaternion, and nothing else")
    if "rpy" in entry and "quaternion" in entry:
        raise UsageError(f"{where}: give rpy or quaternion, not both")
    xyz, rpy = _numbers(where, entry, "xyz", 3), _numbers(where, entry, "rpy", 3)
    quaternion = _numbers(where, entry, "quaternion", 4) if "quaternion" in entry else None
    if quaternion is not None and not quaternion.any():
        raise UsageError(f"{where}: the quaternion is zero; no rotation is [0, 0, 0, 1]")
    turned = Rotation.from_euler("xyz", rpy).as_quat() if quaternion is None else quaternion
    return str(entry["parent"]), str(entry["child"]), rigid(xyz, turned)


def _numbers(where: str, entry: Mapping[str, object], key: str, count: int) -> Array:
    values = entry.get(key, [0.0] * count)
    numbers = values if isinstance(values, list) and len(values) == count else [None]
    if not all(isinstance(value, int | float) and abs(value) <= sys.float_info.max for value in numbers):
        raise UsageError(f"{where}: {key} = {values!r}; give {count} numbers")
    return np.array(numbers, dtype=np.float64)
