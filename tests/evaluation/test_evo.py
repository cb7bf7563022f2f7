"""Our figures against evo's, to 1e-6."""

import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from mcap_landmarks.evaluation.metrics import Reference, RunResult, evaluate
from mcap_landmarks.evaluation.read import read_reference, read_run
from mcap_landmarks.evaluation.trajectory import PosePairs, Trajectory, nearest
from mcap_landmarks.geometry.angles import quaternion_from_yaw
from mcap_landmarks.geometry.se2 import compose
from mcap_landmarks.resources import resource

EPOCH_NS = 1_288_971_842_000_000_000
WITHIN_NS = 10_000_000
BETWEEN_TRUTHS_NS = 20_000_000


class Figures(NamedTuple):
    pairs: int
    ape: float
    rpe: float
    heading_deg: float


def ours(estimate: Trajectory, reference: Trajectory, *, aligned: bool, within_ns: int = WITHIN_NS) -> Figures:
    def pairing(mine: Trajectory, theirs: Trajectory) -> PosePairs:
        return nearest(mine, theirs, within_ns)

    found = evaluate(RunResult(estimate, len(estimate)), Reference(reference), pairing, aligned=aligned)
    return Figures(found["scored"], found["position"]["rmse_m"], found["rpe"], found["heading"]["rmse_deg"])


def evos(estimate: Trajectory, reference: Trajectory, *, aligned: bool, within_ns: int = WITHIN_NS) -> Figures:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from evo.core import metrics, sync  # noqa: PLC0415 - evo warns when it is imported
        from evo.core.trajectory import PoseTrajectory3D  # noqa: PLC0415

    def to_evo(trajectory: Trajectory) -> PoseTrajectory3D:
        quaternion = quaternion_from_yaw(trajectory.poses[:, 2])
        positions = np.column_stack([trajectory.poses[:, :2], np.zeros(len(trajectory))])
        seconds = trajectory.time_ns // 10**9 + (trajectory.time_ns % 10**9) * 1e-9  # as evo reads a header's stamp
        return PoseTrajectory3D(positions, quaternion[:, [3, 0, 1, 2]], seconds)

    ref, est = sync.associate_trajectories(to_evo(reference), to_evo(estimate), max_diff=within_ns / 1e9)
    if aligned:
        est.align(ref)
    figures = []
    for metric in (
        metrics.APE(metrics.PoseRelation.translation_part),
        metrics.RPE(metrics.PoseRelation.translation_part),
        metrics.APE(metrics.PoseRelation.rotation_angle_deg),
    ):
        metric.process_data((ref, est))
        figures.append(metric.get_statistic(metrics.StatisticsType.rmse))
    return Figures(est.num_poses, *figures)


def wander(seed: int, count: int, step_ns: int, jitter_ns: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    moves = rng.normal([0.05, 0.0, 0.0], [0.02, 0.002, 0.05], (count, 3))
    poses = np.zeros((count, 3))
    for i in range(1, count):
        poses[i] = compose(poses[i - 1], moves[i])
    return Trajectory.of(EPOCH_NS + np.arange(count) * step_ns + rng.integers(0, jitter_ns, count), poses)


def disturbed(truth: Trajectory, seed: int, every: int, delay_ns: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    poses = compose(np.array([3.0, -7.0, 2.5]), truth.poses[::every]) + rng.normal(0, 0.05, truth.poses[::every].shape)
    delays = rng.integers(-delay_ns, delay_ns, len(poses))
    return Trajectory.of(truth.time_ns[::every] + delays, poses)


@pytest.mark.parametrize("aligned", [False, True])
@pytest.mark.parametrize(
    ("every", "delay_ns"), [(1, 3_000_000), (7, 3_000_000), (3, 15_000_000)], ids=["dense", "sparse", "late"]
)
def test_nearest_gives_evos_figures(every: int, delay_ns: int, aligned: bool) -> None:
    truth = wander(1, 600, 33_000_000, 4_000_000)
    estimate = disturbed(truth, 2, every, delay_ns)
    mine, theirs = ours(estimate, truth, aligned=aligned), evos(estimate, truth, aligned=aligned)
    assert mine.pairs > 50
    assert mine == pytest.approx(theirs, abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_what_lies_on_the_limit_is_decided_evos_way(seed: int) -> None:
    """Stamps of whole milliseconds, so that many are 10 ms apart or right between two others."""
    rng = np.random.default_rng(seed)
    poses = rng.normal(0, 1, (400, 3))
    reference = Trajectory.of(EPOCH_NS + np.sort(rng.choice(12_000, 400, replace=False)) * 10**6, poses)
    estimate = Trajectory.of(EPOCH_NS + np.sort(rng.choice(12_500, 300, replace=False)) * 10**6, poses[:300])
    assert ours(estimate, reference, aligned=False) == pytest.approx(evos(estimate, reference, aligned=False), abs=1e-6)


@pytest.mark.parametrize("aligned", [False, True])
def test_a_sparser_reference_is_paired_evos_way_too(aligned: bool) -> None:
    dense = wander(3, 600, 33_000_000, 4_000_000)
    sparse = disturbed(dense, 4, 5, 8_000_000)
    mine, theirs = ours(dense, sparse, aligned=aligned), evos(dense, sparse, aligned=aligned)
    assert mine.pairs > 50
    assert mine == pytest.approx(theirs, abs=1e-6)


@pytest.mark.parametrize("aligned", [False, True])
@pytest.mark.parametrize(("result", "truth"), [("localize", "demo_localize"), ("map", "demo_map")])
def test_figures_of_the_bundled_recordings_are_evos(result: str, truth: str, aligned: bool) -> None:
    golden = Path(__file__).parents[1] / "golden" / f"{result}.mcap"
    estimate = read_run(golden)[0].trajectory
    reference = read_reference(resource("recordings", f"{truth}.mcap"))[0].trajectory
    assert reference is not None
    mine, theirs = (
        figures(estimate, reference, aligned=aligned, within_ns=BETWEEN_TRUTHS_NS) for figures in (ours, evos)
    )
    assert mine.pairs == len(estimate) > 40
    assert mine == pytest.approx(theirs, abs=1e-6)
