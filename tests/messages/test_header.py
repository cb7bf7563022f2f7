"""What is read of a message without decoding it."""

from dataclasses import replace

import pytest
from mcap_landmarks.errors import MessageError
from mcap_landmarks.messages.codec import encode
from mcap_landmarks.messages.header import count_in

from tests.evaluation.scenes import scene


@pytest.mark.parametrize("frame", ["", "a", "ab", "abc", "base_footprint"])
def test_the_count_of_what_follows_the_header(frame: str) -> None:
    """Wherever the frame's name ends, the count lies on the next four bytes."""
    for count in (0, 3):
        message = replace(scene(["person"] * count, [[1.0, 2]] * count, 7), frame_id=frame)
        assert count_in(encode(message)) == count
    with pytest.raises(MessageError):
        count_in(encode(message)[:18])
