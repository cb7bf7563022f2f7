"""The child frames that are read without decoding the rest are those of the decoded message."""

import numpy as np
from mcap_landmarks.messages.codec import decode, encode
from mcap_landmarks.messages.transforms import TFMessage, Transform, child_frames_in


def message(*frames: tuple[str, str]) -> bytes:
    return encode(TFMessage(tuple(Transform(7, *each, np.ones(3), np.array([0.0, 0, 0, 1])) for each in frames)))


def test_frames_of_all_lengths() -> None:
    for length in range(10):
        frames = [("map" + "x" * length, f"{i}é" + "y" * (length * i % 7)) for i in range(4)]
        assert child_frames_in(message(*frames)) == {child for _, child in frames}
    assert child_frames_in(message()) == set()


def test_what_is_read_of_spoilt_messages_is_what_decoding_gives() -> None:
    rng, told = np.random.default_rng(5), 0
    sound = message(("odom", "base_footprint"), ("base_footprint", "scan"))
    for _ in range(3000):
        data = bytearray(sound)
        for place in rng.integers(len(data), size=rng.integers(3)).tolist():
            data[place] = int(rng.choice([0, 1, 4, 0x80, int(rng.integers(256))]))
        spoilt = bytes(data[: rng.choice([len(data), len(data), int(rng.integers(len(data)))])]) + bytes(
            rng.choice([0, 3, 8])
        )
        if (found := child_frames_in(spoilt)) is not None:
            told += 1
            assert found == {transform.child_frame_id for transform in decode(TFMessage, spoilt).transforms}
    assert told > 500


def test_big_endian_is_left_to_decoding() -> None:
    assert child_frames_in(b"\0\0" + message(("odom", "base"))[2:]) is None
