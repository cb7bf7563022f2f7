"""Boxes of objects lie as they did after a way through a message."""

import numpy as np
from mcap_landmarks.messages.boxes import Boxes
from mcap_landmarks.messages.codec import decode, encode
from mcap_landmarks.messages.scene import SceneObjects

YAWS_RAD = np.array([0.0, 1.2, -3.0])


def test_yaws_and_sizes_come_back() -> None:
    around = Boxes(np.arange(9.0).reshape(3, 3), np.full((3, 3), [4.2, 1.7, 1.5]), YAWS_RAD)
    classes = ((("car", 0.9),),) * 3
    scene = SceneObjects(
        1, "base_link", ("1", "2", "3"), classes, np.zeros((3, 2)), np.zeros((3, 2, 2)), np.full(3, 2.1), around
    )
    found = decode(SceneObjects, encode(scene)).boxes
    assert found is not None
    np.testing.assert_allclose(found.yaws_rad, YAWS_RAD, atol=1e-12)
    np.testing.assert_array_equal(found.sizes_m, around.sizes_m)
    np.testing.assert_array_equal(found.centres_m, around.centres_m)
