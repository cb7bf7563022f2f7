"""Figures of poses, computed by hand, and what must hold for any trajectory."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap_landmarks.evaluation import pose_metrics
from mcap_landmarks.evaluation.metrics import Reference, RunResult, evaluate, score
from mcap_landmarks.evaluation.read import read_run
from mcap_landmarks.evaluation.trajectory import Trajectory, interpolated
from mcap_landmarks.geometry.se2 import compose

PAIRING = partial(interpolated, max_gap_ns=10**9)
APPENDIX_D = Path(__file__).parents[1] / "data" / "thesis_appendix_d.txt"
POSES = arrays(np.float64, st.tuples(st.integers(2, 30), st.just(3)), elements=st.floats(-3, 3))
PATHS = arrays(np.float64, st.tuples(st.integers(10, 30), st.just(3)), elements=st.floats(-3, 3))
"""Long enough to be aligned by their positions."""
MOTIONS = st.tuples(st.floats(-100, 100), st.floats(-100, 100), st.floats(-3.14, 3.14)).map(np.array)


def timed(poses: np.ndarray, covariances: np.ndarray | None = None) -> Trajectory:
    return Trajectory.of(np.arange(len(poses)) * 10**8, poses, covariances)


def figures(estimate: Trajectory, truth: Trajectory, *, aligned: bool = False) -> dict[str, Any]:
    return evaluate(RunResult(estimate, len(estimate)), Reference(truth), PAIRING, aligned=aligned)


def test_figures_by_hand() -> None:
    truth = np.array([[10.0, 5, 0], [20, 5, 0], [20, -10, 3.1], [0, 1, 0]])
    errors = np.array([[0.3, 0.4, 0], [0, 0.1, np.radians(21)], [-2, 0, 2 * np.pi], [0, 0, 0]])
    found = figures(timed(truth + errors), timed(truth))
    assert (found["bundles"], found["localized"], found["scored"], found["eligible"]) == (4, 4, 4, None)
    assert found["false"] == {"count": 2, "share": 0.5}
    position = found["position"]
    assert position["rmse_m"] == pytest.approx(np.sqrt((0.25 + 0.01 + 4 + 0) / 4))
    assert position["median_m"] == pytest.approx(0.3)
    assert position["max_m"] == pytest.approx(2)
    assert position["p95_m"] == pytest.approx(0.5 + 0.85 * 1.5)
    assert (position["within_0_2_m"], position["within_1_m"]) == (0.5, 0.75)
    x = found["axis"]["x"]
    assert x["median_abs_m"] == pytest.approx(0.15)
    assert x["mean_relative_percent"] == pytest.approx((3 + 0 + 10) / 3)  # the fourth truth is zero
    assert x["max_relative_percent"] == pytest.approx(10)
    assert x["under_5_percent"] == pytest.approx(2 / 3)
    assert found["heading"]["rmse_deg"] == pytest.approx(21 / 2)
    assert found["heading"]["median_deg"] == pytest.approx(0, abs=1e-9)
    assert (found["nees"], found["map"], found["alignment"], found["statuses"]) == (None, None, None, None)


def test_limits_of_false() -> None:
    errors = np.array([[1.0, 0, 0], [1.001, 0, 0], [0, 0, np.radians(-19.9)], [0, 0, np.radians(-20.1)]])
    assert pose_metrics.false_figures(errors) == {"count": 2, "share": 0.5}


def test_nees_by_hand() -> None:
    covariances = np.stack([np.diag([0.04, 0.09, 0.01])] * 3)
    covariances[2] = np.nan
    errors = np.array([[0.2, 0.3, 0.1], [0.4, 0, 0], [9, 9, 9]])
    assert pose_metrics.nees(errors, covariances) == pytest.approx((3 + 4) / 2 / 3)
    assert pose_metrics.nees(errors, np.zeros((3, 3, 3))) is None


def test_nees_of_honest_covariances_is_one() -> None:
    rng = np.random.default_rng(0)
    half = rng.normal(0, 0.1, (4000, 3, 3))
    covariances = half @ half.transpose(0, 2, 1) + 1e-4 * np.eye(3)
    errors = np.linalg.cholesky(covariances) @ rng.normal(0, 1, (4000, 3, 1))
    assert pose_metrics.nees(errors[..., 0], covariances) == pytest.approx(1, abs=0.04)


def test_rpe_by_hand() -> None:
    truth = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    estimate = np.array([[0.0, 0, 0], [1.3, 0, np.pi / 2], [1.3, 1.4, np.pi / 2]])
    assert pose_metrics.relative_pose_error(estimate, truth) == pytest.approx(np.sqrt((0.09 + 0.16) / 2))
    assert pose_metrics.relative_pose_error(estimate[:1], truth[:1]) is None


@given(POSES)
def test_a_perfect_estimate_has_no_error(poses: np.ndarray) -> None:
    found = figures(timed(poses, np.stack([np.eye(3)] * len(poses))), timed(poses))
    assert found["false"] == {"count": 0, "share": 0}
    for part in (found["position"]["max_m"], found["heading"]["rmse_deg"], found["nees"], found["rpe"]):
        assert part == pytest.approx(0, abs=1e-9)
    assert (found["position"]["within_0_2_m"], found["scored"]) == (1, len(poses))


@pytest.mark.slow
@settings(max_examples=50)
@given(PATHS, MOTIONS, st.integers(0, 100))
def test_alignment_makes_the_frame_of_the_estimate_irrelevant(poses: np.ndarray, motion: np.ndarray, seed: int) -> None:
    rng = np.random.default_rng(seed)
    poses = poses + np.column_stack([np.arange(len(poses)) * 5, np.zeros((len(poses), 2))])
    noisy = poses + rng.normal(0, 0.1, poses.shape)
    covariances = np.stack([np.diag([0.01, 0.04, 0.01])] * len(poses))
    turn = np.eye(3)
    turn[:2, :2] = [[np.cos(motion[2]), -np.sin(motion[2])], [np.sin(motion[2]), np.cos(motion[2])]]
    moved = timed(compose(motion, noisy), turn @ covariances @ turn.T)
    here, there = (
        figures(timed(noisy, covariances), timed(poses), aligned=True),
        figures(moved, timed(poses), aligned=True),
    )
    for name in ("position", "heading"):
        assert there[name] == pytest.approx(here[name], abs=1e-6)
    for name in ("nees", "rpe"):
        assert there[name] == pytest.approx(here[name], abs=1e-6)
    assert there["position"]["rmse_m"] <= figures(timed(noisy), timed(poses))["position"]["rmse_m"] + 1e-9


def test_the_alignment_is_told() -> None:
    poses = np.array([[0.0, 0, 0], [4, 0, 0], [4, 4, 1]])
    found = figures(timed(compose(np.array([2.0, 3, np.pi / 2]), poses)), timed(poses), aligned=True)
    assert found["alignment"].pop("rotation_from") == "positions"
    assert found["alignment"] == pytest.approx({"x_m": -3, "y_m": 2, "heading_deg": -90, "rotation_sigma_deg": 0})


def test_nothing_scored_gives_no_figures() -> None:
    late = Trajectory.of(np.array([10**12]), np.zeros((1, 3)))
    found = figures(late, timed(np.zeros((3, 3))), aligned=True)
    assert (found["localized"], found["scored"], found["false"]) == (1, 0, {"count": 0, "share": None})
    assert set(found["position"].values()) == {None} == set(found["axis"]["y"].values())
    assert (found["heading"]["rmse_deg"], found["nees"], found["rpe"]) == (None, None, None)
    assert not len(score(late, Reference(), PAIRING, aligned=False).rows)


def test_the_thesis_results_recomputed() -> None:
    """Thesis, Appendix D and section 5.1: the relative figures hold."""
    run, reference, losses = read_run(APPENDIX_D)
    found: dict[str, Any] = evaluate(run, reference, PAIRING)
    x, y = found["axis"]["x"], found["axis"]["y"]
    assert x["mean_relative_percent"] == pytest.approx(0.3432, abs=5e-5)
    assert y["mean_relative_percent"] == pytest.approx(0.4931, abs=5e-5)
    assert max(x["max_relative_percent"], y["max_relative_percent"]) == pytest.approx(4.58, abs=5e-3)
    assert (x["under_5_percent"], y["under_5_percent"], found["scored"]) == (1, 1, 20)
    assert found["position"]["rmse_m"] == pytest.approx(0.1059, abs=5e-5)
    assert (x["median_abs_m"], y["median_abs_m"]) == pytest.approx((0.0217, 0.0243), abs=5e-5)
    assert (found["heading"]["rmse_deg"], found["rpe"], losses) == (None, None, [])
