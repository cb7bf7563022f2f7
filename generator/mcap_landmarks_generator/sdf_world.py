"""Models of a world in SDF (Gazebo's format, sdformat.org) and where they stand; nothing outside the file is read."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import parse
from mcap_landmarks.errors import ToolkitError
from numpy.typing import NDArray

Pose = NDArray[np.float64]
"""A rigid transform (4, 4)."""

_MOST_DEEP = 30
"""Models within models; those of Gazebo's collections are three deep."""
_SCOPE = "::"


@dataclass(frozen=True, slots=True, eq=False)
class SdfModel:
    """A model: its own name, the last part of its URI if it is included, and its transform world from model (4, 4).

    `solid` is the first of its collision shapes (box, cylinder, mesh, ...) with its size in m, as far as SDF gives one.
    `way_xy` are the points (N, 2) that an actor walks to, and `walks_s` how long that takes.
    `is_scattered` says that it is a population, whose members Gazebo scatters.
    """

    name: str
    uri: str
    world_from_model: Pose
    solid: str = ""
    size_m: tuple[float, ...] = ()
    way_xy: Pose = field(default_factory=lambda: np.zeros((0, 2)))
    walks_s: float = 0.0
    is_scattered: bool = False

    @property
    def heading_rad(self) -> float:
        """The direction of its x axis on the ground."""
        return float(np.arctan2(self.world_from_model[1, 0], self.world_from_model[0, 0]))


def read_world(path: Path) -> list[SdfModel]:
    """All models of a file's first world, outer ones before those within, in the order of the file.

    Raises:
        ToolkitError: it cannot be read, is no SDF world, declares entities, or a pose or frame in it makes no sense.
    """
    try:
        root = parse(path, forbid_dtd=True).getroot()
    except FileNotFoundError as error:
        raise ToolkitError(f"{path}: there is no such world; check the path") from error
    except DefusedXmlException as error:
        raise ToolkitError(
            f"{path}: it declares a document type or entities, which no world needs; remove them"
        ) from error
    except (OSError, ParseError, ValueError) as error:
        raise ToolkitError(f"{path}: not an SDF file: {error}") from error
    world = root.find("world") if root is not None and root.tag == "sdf" else None
    if world is None:
        raise ToolkitError(f"{path}: there is no world in it; give a file with <sdf><world>")
    try:
        return list(_models_in(_Scope(world, np.eye(4)), _saved_poses(world), 0))
    except _SdfError as error:
        raise ToolkitError(f"{path}: {error}") from error
    except RecursionError as error:
        raise ToolkitError(
            f"{path}: its frames hang on each other in too long a chain; place them in the world"
        ) from error


class _SdfError(ValueError):
    """What is wrong with a world, in words."""


class _Scope:
    """The frames of a world or model: its own, those of its models, links and `frame` elements, by name."""

    def __init__(self, element: Element, world_from_scope: Pose) -> None:
        self.element, self.world_from_scope = element, world_from_scope
        self._elements: dict[str, Element] = {}
        for child in element:
            if child.tag in {"model", "include", "frame", "link", "actor"}:
                self._elements.setdefault(_name(child), child)

    def world_from(self, name: str, asking: tuple[str, ...] = ()) -> Pose:
        """The frame of a name, as `relative_to` and `attached_to` have it; `a::b` is one of a model's own frames."""
        outer, scope, inner = name.partition(_SCOPE)
        if name in {"", "world", "__model__"} and (name != "world" or self.element.tag == "world"):
            return self.world_from_scope
        if outer not in self._elements:
            raise _SdfError(f"there is no frame {name!r} in {_name(self.element) or 'the world'}")
        if outer in asking:
            raise _SdfError(f"the frame {outer!r} is placed relative to itself")
        element = self._elements[outer]
        world_from_outer = self.pose_of(element, (*asking, outer))
        return _Scope(element, world_from_outer).world_from(inner) if scope else world_from_outer

    def pose_of(self, element: Element, asking: tuple[str, ...] = ()) -> Pose:
        """World from the frame of an element of this scope."""
        pose = element.find("pose")
        asked = "" if pose is None else pose.get("relative_to") or pose.get("frame") or ""
        world_from_pose = self.world_from(asked or element.get("attached_to") or "", asking) @ _transform(pose)
        placed_by = element.get("placement_frame")
        if not placed_by:
            return world_from_pose
        return world_from_pose @ np.linalg.inv(_Scope(element, np.eye(4)).world_from(placed_by))


def _models_in(scope: _Scope, saved: Mapping[str, Pose], depth: int) -> Iterator[SdfModel]:
    if depth > _MOST_DEEP:
        raise _SdfError(f"models lie within each other more than {_MOST_DEEP} deep")
    for element in scope.element:
        if element.tag == "actor":
            yield _actor(element, scope.pose_of(element))
        if element.tag == "population":
            yield SdfModel(element.get("name") or "population", "", scope.pose_of(element), is_scattered=True)
        if element.tag not in {"model", "include"}:
            continue
        name = _name(element)
        world_from_model = saved.get(name)
        if world_from_model is None:
            world_from_model = scope.pose_of(element)
        solid, size_m = _solid(element)
        if element.tag == "include" or element.find("link") is not None:
            yield SdfModel(name, _uri(element), world_from_model, solid, size_m)
        yield from _models_in(_Scope(element, world_from_model), {}, depth + 1)


def _saved_poses(world: Element) -> dict[str, Pose]:
    """Where Gazebo Classic saved models: it puts them there, whatever their own poses say."""
    return {
        _name(model): _transform(model.find("pose"))
        for model in world.findall("state/model")
        if model.find("pose") is not None
    }


def _actor(element: Element, world_from_actor: Pose) -> SdfModel:
    """One who walks along the first trajectory of a script."""
    waypoints = element.findall("script/trajectory[1]/waypoint")
    ways = [world_from_actor @ _transform(one.find("pose")) for one in waypoints]
    seconds = _numbers(element.findtext("script/trajectory[1]/waypoint[last()]/time") or "0", "time")[0]
    start = ways[0] if ways else world_from_actor
    points = [start[:2, 3]]
    points += [way[:2, 3] for way, last in zip(ways[1:], ways, strict=False) if (way[:2, 3] != last[:2, 3]).any()]
    return SdfModel(
        _name(element), "person", start, "mesh", way_xy=np.array(points[1:]).reshape(-1, 2), walks_s=seconds
    )


def _solid(element: Element) -> tuple[str, tuple[float, ...]]:
    """The first collision shape of a model and its size: of a box its sides, of a cylinder radius and length."""
    for shape in element.findall("link/collision/geometry/*"):
        texts = [shape.findtext(key) for key in ("size", "radius", "length")]
        numbers = [number for text in texts if text for number in _numbers(text, shape.tag)]
        return shape.tag, tuple(numbers)
    return "", ()


def _name(element: Element) -> str:
    """Its name; an included model without one has that of its URI."""
    return (element.findtext("name") if element.tag == "include" else element.get("name")) or _uri(element)


def _uri(element: Element) -> str:
    """The last part of an included model's URI that names it: of `https://host/owner/models/Fire hydrant/2` too."""
    parts = [part for part in (element.findtext("uri") or "").strip().split("/") if part and not part.isdecimal()]
    return parts[-1].removesuffix(".sdf") if parts else ""


def _transform(pose: Element | None) -> Pose:
    """A pose: x, y, z in m and roll, pitch, yaw in rad (or degrees), or a quaternion x, y, z, w."""
    text = (pose.text or "").strip() if pose is not None else ""
    numbers = _numbers(text, "pose") if text else [0.0] * 6
    is_quaternion = pose is not None and pose.get("rotation_format") == "quat_xyzw"
    if len(numbers) != (7 if is_quaternion else 6):
        raise _SdfError(f"a pose has {len(numbers)} numbers: {text[:60]!r}")
    transform = np.eye(4)
    transform[:3, 3] = numbers[:3]
    if is_quaternion:
        transform[:3, :3] = _from_quaternion(np.array(numbers[3:]))
    else:
        is_degrees = pose is not None and pose.get("degrees") in {"true", "1"}
        transform[:3, :3] = _from_angles(*np.deg2rad(numbers[3:]) if is_degrees else numbers[3:])
    return transform


def _from_angles(roll: float, pitch: float, yaw: float) -> Pose:
    """Turns about the fixed axes x, y and z, in this order."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    turn: Pose = about_z @ about_y @ about_x
    return turn


def _from_quaternion(xyzw: Pose) -> Pose:
    length = np.linalg.norm(xyzw)
    if not length:
        raise _SdfError("a quaternion of a pose is zero")
    x, y, z, w = xyzw / length
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn: Pose = np.eye(3) + 2 * w * cross + 2 * cross @ cross
    return turn


def _numbers(text: str, what: str) -> list[float]:
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError as error:
        raise _SdfError(f"a {what} is not made of numbers: {text[:60]!r}") from error
    if not numbers or not np.isfinite(numbers).all():
        raise _SdfError(f"a {what} is not made of finite numbers: {text[:60]!r}")
    return numbers
