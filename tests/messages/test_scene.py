"""Scene objects of detectors that say where things are in their boxes only."""

import numpy as np
from mcap_landmarks.messages.boxes import Boxes
from mcap_landmarks.messages.codec import decode, encode
from mcap_landmarks.messages.scene import SceneObjects


def test_the_box_tells_the_place_where_the_pose_was_left_as_it_was_made() -> None:
    boxes = Boxes(np.array([[3.0, 1.0, 0.5]]), np.ones((1, 3)), np.zeros(1))
    unset = SceneObjects(
        1, "base", ("a",), ((("tag", 1.0),),), np.zeros((1, 2)), np.zeros((1, 2, 2)), np.ones(1), boxes
    )
    found = decode(SceneObjects, encode(unset))
    np.testing.assert_allclose(found.positions_xy, [[3.0, 1.0]])
    assert not found.covariances.any()
