"""Frames: transforms along the tree, and what is said where it has gaps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.geometry.frames import FrameTree, apply, inverse, planar, rigid
from scipy.spatial.transform import Rotation

NUMBER = st.floats(-5, 5)
TRANSFORM = st.builds(rigid, st.tuples(NUMBER, NUMBER, NUMBER), st.tuples(NUMBER, NUMBER, NUMBER, st.floats(0.1, 5)))


@given(TRANSFORM, TRANSFORM, TRANSFORM)
def test_ways_through_the_tree_agree(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> None:
    tree = FrameTree.of([("base", "mast", a), ("/mast", "/camera", b), ("base", "laser", c)])
    np.testing.assert_allclose(tree.lookup("base", "camera"), a @ b, atol=1e-9)
    np.testing.assert_allclose(tree.lookup("camera", "laser"), np.linalg.inv(a @ b) @ c, atol=1e-9)
    np.testing.assert_allclose(tree.lookup("laser", "laser"), np.eye(4))
    np.testing.assert_allclose(inverse(a) @ a, np.eye(4), atol=1e-9)


def test_points_go_with_their_frames() -> None:
    turned = rigid([1.0, 0.0, 0.5], Rotation.from_euler("z", 90, degrees=True).as_quat())
    np.testing.assert_allclose(apply(turned, [[1.0, 0.0, 0.0]]), [[1.0, 1.0, 0.5]], atol=1e-12)
    np.testing.assert_allclose(planar(turned), [1.0, 0.0, np.pi / 2])


def test_a_gap_is_named_with_its_remedy() -> None:
    tree = FrameTree.of([("base", "laser", np.eye(4)), ("mast", "camera", np.eye(4))])
    with pytest.raises(RecordingError, match=r"from camera to base: base and mast have no parent.*--extrinsics FILE"):
        tree.lookup("base", "/camera")
    assert "mast" in tree
    assert "/laser" in tree
    assert "sonar" not in tree


def test_a_frame_without_a_name_is_told_as_that() -> None:
    tree = FrameTree.of([("base", "laser", np.eye(4))])
    with pytest.raises(RecordingError, match=r"a message names no frame, where base is asked for.*--extrinsics FILE"):
        tree.lookup("base", "")


def test_a_circle_of_frames_ends() -> None:
    tree = FrameTree.of([("a", "b", np.eye(4)), ("b", "a", np.eye(4))])
    with pytest.raises(RecordingError, match="no transforms lead"):
        tree.lookup("base", "a")


@pytest.mark.parametrize("quaternion", [(0, 0, 0, 0), (np.nan, 0, 0, 1)])
def test_what_is_no_rotation_is_refused(quaternion: tuple[float, ...]) -> None:
    with pytest.raises(RecordingError, match="no rigid transform"):
        rigid([0, 0, 0], quaternion)
