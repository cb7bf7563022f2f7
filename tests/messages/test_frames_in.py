"""The frames of a transform are read without decoding it, and only where that is sure."""

import pytest
from mcap_landmarks.messages.codec import decode, encode
from mcap_landmarks.messages.transforms import TFMessage, Transform, frames_in

NAMES = [("map", "odom"), ("odom", "base_footprint"), ("a", "b"), ("/robot1/odom", "/robot1/base"), ("weg", "größe")]


def one(frames: tuple[str, str]) -> Transform:
    return Transform.planar(123, frames, (1.0, 2.0, 3.0))


@pytest.mark.parametrize("names", NAMES)
def test_the_names_are_those_of_the_message(names: tuple[str, str]) -> None:
    data = encode(TFMessage((one(names),)))
    assert frames_in(data) == names
    assert decode(TFMessage, data).transforms[0].child_frame_id == names[1]


def test_nothing_is_said_of_other_messages() -> None:
    data = encode(TFMessage((one(NAMES[0]),)))
    assert frames_in(encode(TFMessage(()))) is None
    assert frames_in(encode(TFMessage((one(NAMES[0]), one(NAMES[1]))))) is None
    assert frames_in(b"\0\0" + data[2:]) is None  # big endian
    assert all(frames_in(data[:size]) is None for size in range(33))
