"""Triangles that reach behind the camera: what is in front of it stays, attributes and all."""

import numpy as np
from mcap_landmarks_generator.clipping import in_front

NEAR_M = 0.5


def areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Areas (M,) of triangles, signed by the turn of x and y."""
    first, second, third = (vertices[faces[:, i], :2] for i in range(3))
    one, other = second - first, third - first
    return (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]) / 2


def cut(vertices: list[tuple[float, float, float]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One triangle whose attributes are its vertices' places."""
    points = np.array(vertices, np.float32)
    kept, attributes, faces = in_front(points, points.copy(), np.array([[0, 1, 2]], np.int32), NEAR_M)
    np.testing.assert_allclose(attributes[faces], kept[faces], atol=1e-6)
    return kept, attributes, faces


def test_what_is_in_front_or_behind_stays_or_goes_as_a_whole() -> None:
    _, _, faces = cut([(0, 0, -1), (1, 0, -2), (0, 1, -3)])
    assert faces.tolist() == [[0, 1, 2]]
    _, _, faces = cut([(0, 0, 1), (1, 0, 0), (0, 1, -0.4)])
    assert len(faces) == 0


def test_a_triangle_with_one_corner_in_front_keeps_its_tip() -> None:
    """Whichever corner it is: the tip is cut in the middle of its edges, and turns the same way."""
    corners = [(0.0, 0.0, -1.5), (2.0, 0.0, 0.5), (0.0, 2.0, 0.5)]
    for turn in range(3):
        kept, _, faces = cut(corners[turn:] + corners[:turn])
        assert areas(kept, faces).tolist() == [0.5]
        assert kept[faces].reshape(-1, 3)[:, 2].max() == -NEAR_M


def test_a_triangle_with_one_corner_behind_loses_its_tip() -> None:
    corners = [(0.0, 0.0, 0.5), (2.0, 0.0, -1.5), (0.0, 2.0, -1.5)]
    for turn in range(3):
        kept, _, faces = cut(corners[turn:] + corners[:turn])
        assert len(faces) == 2
        assert (areas(kept, faces) > 0).all()
        assert areas(kept, faces).sum() == 1.5
        assert kept[faces].reshape(-1, 3)[:, 2].max() == -NEAR_M
