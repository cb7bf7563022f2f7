"""decode(encode(x)) = x for every message type, and damage is an error that names the type."""

import contextlib
import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_landmarks import channels
from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.codec import Message, decode, encode
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.typestore import definition
from mcap_landmarks.stage import Channel
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.msg import get_types_from_msg

from tests.messages.strategies import MESSAGES


def same(a: object, b: object) -> bool:
    """Equality that looks into arrays, tuples and dataclasses; NaN equals NaN."""
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(
            same(getattr(a, field.name), getattr(b, field.name)) for field in dataclasses.fields(a)
        )
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if isinstance(a, tuple):
        return isinstance(b, tuple) and len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    return a == b


@settings(max_examples=300, deadline=None)
@given(MESSAGES)
def test_decoding_undoes_encoding(message: Message) -> None:
    assert same(decode(type(message), encode(message)), message)


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(MESSAGES, st.data())
def test_cut_bytes_are_an_error_or_a_message(message: Message, data: st.DataObject) -> None:
    whole = encode(message)
    cut = whole[: data.draw(st.integers(0, len(whole) - 1))]
    with contextlib.suppress(MessageError):  # any other exception fails the test
        decode(type(message), cut)


def test_a_cut_odometry_is_refused() -> None:
    whole = encode(Odometry.planar(1, ("odom", "base"), (1.0, 2.0, 3.0), np.eye(3)))
    with pytest.raises(MessageError, match="nav_msgs/msg/Odometry"):
        decode(Odometry, whole[:60])


def _channels() -> list[Channel]:
    return [value for value in vars(channels).values() if isinstance(value, Channel)]


@pytest.mark.parametrize("channel", _channels(), ids=lambda channel: channel.topic)
def test_definitions_are_whole(channel: Channel) -> None:
    """A reader that knows nothing but the schema text of a channel knows the type."""
    ros_type = channel.message.ROS_TYPE
    types = get_types_from_msg(definition(ros_type), ros_type)
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    assert ros_type in store.types


def test_topics_are_told_once() -> None:
    topics = [channel.topic for channel in _channels()]
    assert len(topics) == len(set(topics))


def test_pose_of_odometry() -> None:
    message = Odometry.planar(5, ("odom", "base"), (1.0, -2.0, 3.0), np.diag([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(message.pose, [1.0, -2.0, 3.0])
    np.testing.assert_array_equal(message.planar_covariance, np.diag([1.0, 2.0, 3.0]))
    assert message.pose_covariance[5, 5] == 3.0
