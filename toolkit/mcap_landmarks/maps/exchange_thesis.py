"""The thesis's texts: its landmark database (Appendix C) and its results (Appendix D), one Python list a line."""

import ast
import hashlib
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from mcap_landmarks.errors import MapError
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.maps.model import Group, LandmarkMap, MapSource

T = TypeVar("T")

_NUMBER = re.compile(r"\s*\d+\s+(?=\[)")
_GROUP = "[['class', x, y], ..., ['robot', x, y, heading]]"
_LARGEST = 1e308
"""Larger numbers are no coordinates, and infinity or not a number is none either."""
_RESULT = "[['class', ...], [reference x, y], [estimated x, y]]"


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """N positions computed by localization: the classes of the objects seen, truth (N, 2) and estimate (N, 2) in m."""

    classes: tuple[tuple[str, ...], ...]
    reference_xy: Array
    estimate_xy: Array


def parse_map(text: str, name: str) -> LandmarkMap:
    """The map of an Appendix C text: one group a line, objects left to right, then the robot that saw them.

    Landmarks are called `g<line>.<place>`; the same class at the same coordinates in two groups is one landmark.

    Raises:
        MapError: with the name of the file, the line, and what was expected there.
    """
    identities: dict[tuple[str, float, float], str] = {}
    groups = []
    for row, (line, (objects, pose)) in enumerate(_lines(text, name, _GROUP, _read_group), start=1):
        ids = [identities.setdefault(item, f"g{row}.{place}") for place, item in enumerate(objects, start=1)]
        if len(set(ids)) != len(ids):
            raise MapError(f"{name}, line {line}: the same object twice; a group has each object once")
        groups.append(Group(tuple(ids), np.array(pose)))
    if not groups:
        raise MapError(f"{name}: holds no group; expected lines like {_GROUP}")
    source = MapSource("import", hashlib.sha256(text.encode()).hexdigest())
    seen = Counter(identity for group in groups for identity in group.landmark_ids)
    n = len(identities)
    return LandmarkMap(
        tuple(identities.values()),
        tuple(key[0] for key in identities),
        np.array([key[1:] for key in identities], dtype=np.float64),
        np.zeros((n, 2, 2)),
        np.zeros(n),
        np.array([seen[identity] for identity in identities.values()], dtype=np.int64),
        np.zeros(n, dtype=np.bool_),
        tuple(groups),
        (source,),
    )


def render_map(landmark_map: LandmarkMap) -> str:
    """The groups of a map as an Appendix C text: numbered lines, four decimals. Landmarks in no group are left out.

    Raises:
        MapError: the map has no groups.
    """
    if not landmark_map.groups:
        raise MapError("the map has no groups, which this text consists of; export it as CSV or JSON")
    objects = {
        identity: [name, *_rounded(position)]
        for identity, name, position in zip(
            landmark_map.ids, landmark_map.classes, landmark_map.positions_xy, strict=True
        )
    }
    rows = [
        [*(objects[identity] for identity in group.landmark_ids), ["robot", *_rounded(group.map_from_base)]]
        for group in landmark_map.groups
    ]
    return _render(rows)


def parse_results(text: str, name: str) -> Results:
    """The results of an Appendix D text.

    Raises:
        MapError: with the name of the file, the line, and what was expected there.
    """
    results = [result for _, result in _lines(text, name, _RESULT, _read_result)]
    if not results:
        raise MapError(f"{name}: holds no result; expected lines like {_RESULT}")
    classes, reference, estimate = zip(*results, strict=True)
    return Results(classes, np.array(reference), np.array(estimate))


def render_results(results: Results) -> str:
    """Results as an Appendix D text: numbered lines, four decimals."""
    rows = [
        [list(names), _rounded(reference), _rounded(estimate)]
        for names, reference, estimate in zip(results.classes, results.reference_xy, results.estimate_xy, strict=True)
    ]
    return _render(rows)


def _lines(text: str, name: str, expected: str, read: Callable[[object], T]) -> Iterator[tuple[int, T]]:
    """Number and content of each line that is not empty, as `read` takes it: it raises ValueError for other forms."""
    for line, content in enumerate(text.splitlines(), start=1):
        if not content.strip():
            continue
        try:
            found = read(ast.literal_eval(_NUMBER.sub("", content, count=1).strip()))
        except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError) as error:
            raise MapError(f"{name}, line {line}: expected {expected}") from error
        yield line, found


def _read_group(values: object) -> tuple[list[tuple[str, float, float]], list[float]]:
    """The objects of a group, and the robot's pose."""
    *items, last = _list(values)
    robot, pose = _read_item(last, 3)
    if robot != "robot" or not items:
        raise ValueError("a group is objects and a robot")
    objects = [_read_item(item, 2) for item in items]
    return [(class_name, x, y) for class_name, (x, y) in objects], pose


def _read_result(values: object) -> tuple[tuple[str, ...], list[float], list[float]]:
    """Classes, true position and computed position."""
    classes, reference, estimate = _list(values)
    names = tuple(_name(item) for item in _list(classes))
    if not names:
        raise ValueError("a result is of objects")
    return names, _numbers(_list(reference), 2), _numbers(_list(estimate), 2)


def _read_item(values: object, count: int) -> tuple[str, list[float]]:
    """Name and numbers of `['name', number, ...]`."""
    first, *numbers = _list(values)
    return _name(first), _numbers(numbers, count)


def _list(values: object) -> list[object]:
    if not isinstance(values, list):
        raise TypeError("not a list")
    return values


def _name(value: object) -> str:
    if not isinstance(value, str) or not value:
        raise ValueError("not a name")
    return value


def _numbers(values: list[object], count: int) -> list[float]:
    found = [value for value in values if isinstance(value, int | float) and not isinstance(value, bool)]
    numbers = [float(value) for value in found if abs(value) <= _LARGEST]
    if not len(numbers) == len(values) == count:
        raise ValueError(f"not {count} numbers")
    return numbers


def _rounded(values: Array) -> list[float]:
    return [round(value, 4) + 0.0 for value in values.tolist()]  # + 0.0 makes -0.0 plain


def _render(rows: Sequence[object]) -> str:
    return "".join(f"{number} {row}\n" for number, row in enumerate(rows, start=1))
