"""Copying bytes of ROS 1 to CDR gives what rosbags' conversion gives, for every type and every alignment."""

import numpy as np
import pytest
from mcap_landmarks.sources._ros1_copy import copier
from rosbags.interfaces import Nodetype

from tests.sources.bags import HUMBLE

TYPES = sorted(name for name, (_, fields) in HUMBLE.fielddefs.items() if fields)


def filled(name: str, rng: np.random.Generator) -> object:
    """A message of a type with any numbers, texts and lengths."""
    return HUMBLE.types[name](*(value(node, rng) for _, node in HUMBLE.fielddefs[name][1]))


def value(node: tuple[Nodetype, object], rng: np.random.Generator) -> object:
    sort, detail = node
    if sort == Nodetype.NAME:
        return filled(str(detail), rng)
    assert isinstance(detail, tuple)
    if sort == Nodetype.BASE:
        return "x" * int(rng.integers(0, 7)) if detail[0] == "string" else numbers(detail[0], 1, rng)[0].item()
    inner, size = detail
    count = size if sort == Nodetype.ARRAY else int(rng.integers(0, 4))
    if inner[0] == Nodetype.BASE and inner[1][0] != "string":
        return numbers(inner[1][0], count, rng)
    return [value(inner, rng) for _ in range(count)]


def numbers(name: str, count: int, rng: np.random.Generator) -> np.ndarray:
    dtype = np.dtype({"byte": "uint8", "char": "uint8"}.get(name, name))
    return rng.integers(0, 2, count).astype(dtype)


def test_it_gives_what_rosbags_gives() -> None:
    rng, copied = np.random.default_rng(0), 0
    for name in TYPES:
        copy = copier(HUMBLE.fielddefs, name)
        for _ in range(3 if copy else 0):
            data = bytes(HUMBLE.cdr_to_ros1(HUMBLE.serialize_cdr(filled(name, rng), name), name))
            assert copy is not None
            assert copy(data) == HUMBLE.ros1_to_cdr(data, name), name
            copied += 1
    assert copied > 3 * 140


@pytest.mark.parametrize("change", [lambda data: data[:-1], lambda data: data + b"\0", lambda data: data[:3]])
def test_what_does_not_fit_is_not_copied(change: object) -> None:
    name = "nav_msgs/msg/Odometry"
    message = filled(name, np.random.default_rng(0))
    data = bytes(HUMBLE.cdr_to_ros1(HUMBLE.serialize_cdr(message, name), name))
    copy = copier(HUMBLE.fielddefs, name)
    assert copy is not None
    assert callable(change)
    assert copy(change(data)) is None
