"""Columns hold what rosbags decodes, for every message type and for schemas that nobody here knows."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.codec import Message, encode
from mcap_landmarks.messages.columns import Kind, Table
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.messages.layout import layout_of
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.messages.typestore import definition, typestore

from tests.messages.strategies import MESSAGES

ODD = """# nothing that we know
int8 small
odd/Part[2] pair
builtin_interfaces/Time when
string[] names
float32[3] three
bool[] flags
uint16[<=4] few
================================================================================
MSG: odd/Part
string name
float64 value
uint8[] bytes
"""


def flat(value: object) -> list[object]:
    """What a row of a column holds of a value."""
    if hasattr(value, "nanosec"):
        return [value.sec * 10**9 + value.nanosec]
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value) if not field.name.startswith("__")]
        return [item for name in names for item in flat(getattr(value, name))]
    if isinstance(value, np.ndarray):
        return list(value.tolist())
    return [value.encode() if isinstance(value, str) else value]


def at(value: object, path: str) -> Any:  # noqa: ANN401 - a field of any kind
    for name in path.split(".") if path else []:
        value = getattr(value, name)
    return value


def same(found: np.ndarray, expected: list[Any]) -> bool:
    return len(found) == len(expected) and all(
        a == b or (a != a and b != b)  # noqa: PLR0124 - NaN
        for a, b in zip(found.tolist(), expected, strict=True)
    )


def check(table: Table, objects: list[Any]) -> None:
    assert table.rows == len(objects)
    for path, column in table.columns.items():
        start = 0
        for i, value in enumerate(at(item, path) for item in objects):
            if column.counts is None:
                assert same(column.values[i], flat(value)), path
                continue
            assert column.counts[i] == len(value)
            for element in value:
                assert same(column.values[start], flat(element)), path
                start += 1
    for path, (counts, child) in table.children.items():
        lists = [at(item, path) for item in objects]
        assert counts.tolist() == [len(found) for found in lists]
        check(child, [element for found in lists for element in found])


@pytest.mark.slow
@settings(max_examples=150)
@given(st.lists(MESSAGES, min_size=1, max_size=4))
def test_columns_are_what_rosbags_decodes(messages: list[Message]) -> None:
    for ros_type in {message.ROS_TYPE for message in messages}:
        data = [encode(message) for message in messages if ros_type == message.ROS_TYPE]
        table = layout_of(ros_type, definition(ros_type)).table(data)
        check(table, [typestore().deserialize_cdr(one, ros_type) for one in data])


@pytest.mark.slow
@settings(max_examples=100)
@given(MESSAGES, st.data())
def test_cut_bytes_are_an_error_or_a_message(message: Message, data: st.DataObject) -> None:
    whole, layout = encode(message), layout_of(message.ROS_TYPE, definition(message.ROS_TYPE))
    cut = data.draw(st.integers(0, len(whole) - 1))
    try:
        assert layout.table([whole, whole[:cut]]).rows == 2
    except MessageError:  # any other exception fails the test
        assert layout.table([whole]).rows == 1


def test_a_foreign_schema() -> None:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: PLC0415

    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register({k: v for k, v in get_types_from_msg(ODD, "odd/msg/Odd").items() if k.startswith("odd/")})
    part, time = store.types["odd/msg/Part"], store.types["builtin_interfaces/msg/Time"]
    parts = [part("", 1.5, np.zeros(0, np.uint8)), part("two", -2.0, np.array([1, 2], np.uint8))]
    odd = store.types["odd/msg/Odd"](
        -3, parts, time(5, 6), ["a", ""], np.ones(3, np.float32), np.array([True, False]), np.array([7], np.uint16)
    )
    text = ODD + "=" * 80 + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    layout = layout_of("odd/msg/Odd", text)
    check(layout.table([bytes(store.serialize_cdr(odd, "odd/msg/Odd"))] * 2), [odd, odd])
    assert not layout.stamped


def test_what_layouts_say_of_themselves() -> None:
    pose = layout_of(PoseStamped.ROS_TYPE, definition(PoseStamped.ROS_TYPE))
    assert (pose.stamped, pose.has_payload) == (True, False)
    assert layout_of(CompressedImage.ROS_TYPE, definition(CompressedImage.ROS_TYPE)).has_payload
    kinds = {path: column.kind for path, column in pose.table([]).columns.items()}
    assert (kinds["header.stamp"], kinds["pose.orientation"]) == (Kind.TIME, Kind.QUATERNION)


@pytest.mark.parametrize("text", ["wstring name", "unknown/Type thing", "no message at all"])
def test_a_schema_that_cannot_be_understood(text: str) -> None:
    with pytest.raises(MessageError, match="a/msg/B: its schema cannot be understood"):
        layout_of("a/msg/B", text)


def test_big_endian_is_refused() -> None:
    data = encode(PoseStamped.planar(1, "map", [1, 2, 3]))
    with pytest.raises(MessageError, match="little endian"):
        layout_of(PoseStamped.ROS_TYPE, definition(PoseStamped.ROS_TYPE)).table([b"\0\0" + data[2:]])
