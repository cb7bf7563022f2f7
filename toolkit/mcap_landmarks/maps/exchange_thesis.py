"""The thesis's texts: its landmark database (Appendix C) and its results (Appendix D), one Python list a line."""

import ast
import hashlib
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from mcap_landmarks.errors import MapError
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.maps.model import Group, LandmarkMap, Source

_NUMBER = re.compile(r"\s*\d+\s+(?=\[)")
_GROUP = "[['class', x, y], ..., ['robot', x, y, heading]]"
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
    for row, (line, values) in enumerate(_lists(text, name, _GROUP), start=1):
        *objects, robot = values if len(values) > 1 else ([], [])
        if not (_is_object(robot, 3) and robot[0] == "robot" and all(_is_object(item, 2) for item in objects)):
            raise _malformed(name, line, _GROUP)
        ids = [
            identities.setdefault((item[0], float(item[1]), float(item[2])), f"g{row}.{place}")
            for place, item in enumerate(objects, start=1)
        ]
        if len(set(ids)) != len(ids):
            raise MapError(f"{name}, line {line}: the same object twice; a group has each object once")
        groups.append(Group(tuple(ids), np.array(robot[1:], dtype=np.float64)))
    if not groups:
        raise MapError(f"{name}: holds no group; expected lines like {_GROUP}")
    source = Source("import", hashlib.sha256(text.encode()).hexdigest())
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
    classes, positions = [], []
    for line, values in _lists(text, name, _RESULT):
        if not (len(values) == 3 and _are_names(values[0]) and all(_are_numbers(pair, 2) for pair in values[1:])):
            raise _malformed(name, line, _RESULT)
        classes.append(tuple(values[0]))
        positions.append(values[1:])
    if not positions:
        raise MapError(f"{name}: holds no result; expected lines like {_RESULT}")
    pairs = np.array(positions, dtype=np.float64)
    return Results(tuple(classes), pairs[:, 0], pairs[:, 1])


def render_results(results: Results) -> str:
    """Results as an Appendix D text: numbered lines, four decimals."""
    rows = [
        [list(names), _rounded(reference), _rounded(estimate)]
        for names, reference, estimate in zip(results.classes, results.reference_xy, results.estimate_xy, strict=True)
    ]
    return _render(rows)


def _lists(text: str, name: str, expected: str) -> Iterator[tuple[int, list[Any]]]:
    for line, content in enumerate(text.splitlines(), start=1):
        if not content.strip():
            continue
        try:
            values = ast.literal_eval(_NUMBER.sub("", content, count=1).strip())
        except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError) as error:
            raise _malformed(name, line, expected) from error
        if not isinstance(values, list):
            raise _malformed(name, line, expected)
        yield line, values


def _malformed(name: str, line: int, expected: str) -> MapError:
    return MapError(f"{name}, line {line}: expected {expected}")


def _is_object(item: object, numbers: int) -> bool:
    return isinstance(item, list) and _are_names(item[:1]) and _are_numbers(item[1:], numbers)


def _are_names(items: object) -> bool:
    return isinstance(items, list) and bool(items) and all(isinstance(item, str) and item for item in items)


def _are_numbers(items: object, count: int) -> bool:
    return (
        isinstance(items, list)
        and len(items) == count
        and all(isinstance(item, int | float) and not isinstance(item, bool) and abs(item) <= 1e308 for item in items)
    )


def _rounded(values: Array) -> list[float]:
    return [round(value, 4) + 0.0 for value in values.tolist()]  # + 0.0 makes -0.0 plain


def _render(rows: list[list[Any]]) -> str:
    return "".join(f"{number} {row}\n" for number, row in enumerate(rows, start=1))
