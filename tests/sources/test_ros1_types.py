"""ROS 1 types in ROS 2: humble's where they fit, their own where not, nothing lost in either."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_landmarks.errors import MessageError
from mcap_landmarks.sources._ros1_types import converted
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from tests.sources.bags import HUMBLE, ROS1

LINE = "=" * 80 + "\n"


def definition(name: str) -> str:
    return ROS1.generate_msgdef(name, ros_version=1)[0]


def default(store: Typestore, name: str) -> object:
    """A message of zeros and empty texts."""
    values = []
    for _, (kind, content) in store.fielddefs[name][1]:
        if kind == 1:
            values.append("" if content[0] == "string" else 0)
        elif kind == 2:
            values.append(default(store, content))
        else:
            (inner_kind, inner), size = content
            size = size if kind == 3 else 0
            numbers = inner_kind == 1 and inner[0] != "string"
            one = "" if inner_kind == 1 else default(store, inner)
            values.append(np.zeros(size, dtype=np.dtype(inner[0])) if numbers else [one] * size)
    return store.types[name](*values)


@pytest.mark.parametrize(
    ("ros1", "ros2"),
    [
        ("sensor_msgs/CameraInfo", "sensor_msgs/msg/CameraInfo"),
        ("nav_msgs/Odometry", "nav_msgs/msg/Odometry"),
        ("sensor_msgs/PointCloud2", "sensor_msgs/msg/PointCloud2"),
        ("visualization_msgs/MarkerArray", "visualization_msgs/msg/MarkerArray"),
        ("diagnostic_msgs/DiagnosticArray", "diagnostic_msgs/msg/DiagnosticArray"),
        ("std_msgs/Empty", "std_msgs/msg/Empty"),
    ],
)
def test_standard_types_become_humbles(ros1: str, ros2: str) -> None:
    type_ = converted(ros1, definition(ros2))
    assert type_.message_type == ros2
    fields = get_types_from_msg(type_.definition, ros2)[ros2][1]
    humble = [field for field in HUMBLE.fielddefs[ros2][1] if field[0] != "structure_needs_at_least_one_member"]
    assert fields == humble
    data = type_.convert(bytes(ROS1.serialize_ros1(default(ROS1, ros2), ros2)))
    assert HUMBLE.deserialize_cdr(data, ros2) is not None


def test_new_fields_of_humble_are_zero_and_all_others_stay() -> None:
    name = "visualization_msgs/msg/Marker"
    type_ = converted("visualization_msgs/Marker", definition(name))
    marker = default(ROS1, name)
    marker.ns, marker.id, marker.text = "legs", 3, "left"
    marker.points = [ROS1.types["geometry_msgs/msg/Point"](x=1.0, y=2.0, z=3.0)]
    marker.header.seq, marker.header.frame_id = 9, "map"
    new = HUMBLE.deserialize_cdr(type_.convert(bytes(ROS1.serialize_ros1(marker, name))), name)
    assert (new.ns, new.id, new.text, new.header.frame_id) == ("legs", 3, "left", "map")
    assert (new.points[0].x, new.points[0].z) == (1.0, 3.0)
    assert new.texture_resource == ""
    assert len(new.mesh_file.data) == 0


def test_tf_becomes_tf2() -> None:
    transform = definition("geometry_msgs/msg/TransformStamped")
    text = f"geometry_msgs/TransformStamped[] transforms\n{LINE}MSG: geometry_msgs/TransformStamped\n{transform}"
    assert converted("tf/tfMessage", text).message_type == "tf2_msgs/msg/TFMessage"


def test_a_type_that_lost_fields_keeps_its_own_definition() -> None:
    name = "rosgraph_msgs/msg/Log"
    type_ = converted("rosgraph_msgs/Log", definition(name))
    assert type_.message_type == name
    assert "string[] topics" in type_.definition
    log = default(ROS1, name)
    log.topics, log.msg, log.level = ["/a", "/b"], "words", 4
    store = store_of(name, type_.definition)
    new = store.deserialize_cdr(type_.convert(bytes(ROS1.serialize_ros1(log, name))), name)
    assert (new.topics, new.msg, new.level) == (["/a", "/b"], "words", 4)
    assert not hasattr(new.header, "seq")


def test_standard_types_inside_others_become_humbles_too() -> None:
    marker = definition("visualization_msgs/msg/Marker")
    text = (
        f"uint8 ONE=1\nvisualization_msgs/Marker[] marks\nchar letter\n{LINE}MSG: visualization_msgs/Marker\n{marker}"
    )
    type_ = converted("my_msgs/Marks", text)
    assert type_.message_type == "my_msgs/msg/Marks"
    fields = get_types_from_msg(type_.definition, type_.message_type)
    assert fields["visualization_msgs/msg/Marker"][1] == HUMBLE.fielddefs["visualization_msgs/msg/Marker"][1]
    source = get_typestore(Stores.EMPTY)
    source.register(get_types_from_msg(text, "my_msgs/msg/Marks"))
    one = default(source, "visualization_msgs/msg/Marker")
    one.ns = "here"
    marks = source.types["my_msgs/msg/Marks"](marks=[one, one], letter=65)
    target = get_typestore(Stores.EMPTY)
    target.register(fields)
    new = target.deserialize_cdr(
        type_.convert(bytes(source.serialize_ros1(marks, "my_msgs/msg/Marks"))), "my_msgs/msg/Marks"
    )
    assert [mark.ns for mark in new.marks] == ["here", "here"]
    assert new.letter == 65


MIXED, MIXED_TEXT = "my_msgs/msg/Mixed", "bool flag\nstring[] words\nfloat32[] numbers\nint64 whole\ntime stamp\n"


def store_of(name: str, text: str) -> Typestore:
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, name))
    return store


@pytest.fixture(scope="module")
def mixed() -> tuple[Typestore, Typestore]:
    """A type of our own in ROS 1, and as its conversion defines it."""
    return store_of(MIXED, MIXED_TEXT), store_of(MIXED, converted("my_msgs/Mixed", MIXED_TEXT).definition)


@given(
    words=st.lists(st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=5), max_size=4),
    numbers=st.lists(st.floats(width=32, allow_nan=False), max_size=5),
    whole=st.integers(-(2**63), 2**63 - 1),
    flag=st.booleans(),
)
def test_values_survive(
    mixed: tuple[Typestore, Typestore], words: list[str], numbers: list[float], whole: int, flag: bool
) -> None:
    source, target = mixed
    stamp = source.types["builtin_interfaces/msg/Time"](sec=5, nanosec=6)
    message = source.types[MIXED](flag, words, np.array(numbers, dtype=np.float32), whole, stamp)
    data = converted("my_msgs/Mixed", MIXED_TEXT).convert(bytes(source.serialize_ros1(message, MIXED)))
    new = target.deserialize_cdr(data, MIXED)
    assert (new.flag, new.words, new.whole, new.stamp.sec) == (flag, words, whole, 5)
    assert np.array_equal(new.numbers, message.numbers)


def test_an_empty_type_has_the_byte_that_ros2_gives_it() -> None:
    assert bytes(converted("my_msgs/Nothing", "").convert(b"")) == b"\x00\x01\x00\x00\x00"


@pytest.mark.parametrize("text", ["Missing field\n", "not a definition at all {}\n"])
def test_what_cannot_be_understood_is_refused(text: str) -> None:
    with pytest.raises(MessageError, match="definition of my_msgs/Bad"):
        converted("my_msgs/Bad", text)
