"""TUM trajectories."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.evaluation import tum
from mcap_landmarks.evaluation.trajectory import Trajectory


@given(arrays(np.float64, (5, 3), elements=st.floats(-3, 3)), st.integers(-(10**18), 10**18))
def test_a_trajectory_comes_back(poses: np.ndarray, start_ns: int) -> None:
    trajectory = Trajectory.of(start_ns + np.arange(5) * 33_333_333, poses)
    found = tum.parse(tum.render(trajectory), "t.tum")
    assert found.time_ns.tolist() == trajectory.time_ns.tolist()
    np.testing.assert_allclose(found.poses, poses, atol=1e-12)


def test_what_is_written() -> None:
    trajectory = Trajectory.of(np.array([-1, 1_500_000_002]), np.array([[1.5, -2, 0], [0, 0, np.pi]]))
    first, second = tum.render(trajectory).splitlines()
    assert first == "-0.000000001 1.5 -2.0 0.0 0.0 0.0 0.0 1.0"
    assert second.startswith("1.500000002 0.0 0.0 0.0 0.0 0.0 1.0 ")


def test_comments_commas_and_exponents_are_read() -> None:
    found = tum.parse("# time x y\n\n1.5e9,1,2,0,0,0,0,1\n1500000000.000000001 1 2 0 0 0 1 0\n", "t.tum")
    assert found.time_ns.tolist() == [15 * 10**17, 15 * 10**17 + 1]
    np.testing.assert_allclose(np.abs(found.poses[:, 2]), [0, np.pi])


@pytest.mark.parametrize(
    "line",
    ["1 2 3", "1 0 0 0 0 0 0 one", "x 0 0 0 0 0 0 1", "1 nan 0 0 0 0 0 1", "nan 0 0 0 0 0 0 1", "1e99 0 0 0 0 0 0 1"],
)
def test_other_lines_are_named(line: str) -> None:
    with pytest.raises(RecordingError, match=r"^t\.tum, line 2: .* is no pose; expected: time x y z qx qy qz qw"):
        tum.parse(f"1 0 0 0 0 0 0 1\n{line}\n", "t.tum")


def test_an_empty_trajectory_is_refused() -> None:
    with pytest.raises(RecordingError, match="holds no pose"):
        tum.parse("# nothing\n", "t.tum")
