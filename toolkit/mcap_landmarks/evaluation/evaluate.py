"""A file with results held against the truth that it holds, or that lies in another."""

from dataclasses import dataclass
from functools import partial
from typing import Literal

from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.evaluation.metrics import Evaluation, Pairing, Reference, RunResult, evaluate
from mcap_landmarks.evaluation.read import read_reference, read_run
from mcap_landmarks.evaluation.trajectory import interpolated, nearest
from mcap_landmarks.locations import Location, size_of
from mcap_landmarks.progress import Watch, unwatched

Association = Literal["interpolate", "nearest"]
_NEAREST_NS = 10_000_000
"""As evo's `--t_max_diff`, whose default is this."""


@dataclass(frozen=True, slots=True, eq=False)
class EvaluatedRun:
    """The figures of a run, what they are of, and what could not be read."""

    figures: Evaluation
    run: RunResult
    truth: Reference
    pairing: Pairing
    losses: tuple[str, ...]


def pairing_by(association: Association, max_gap_s: float) -> Pairing:
    """How poses find their truth in time: interpolated over gaps up to the longest, or the nearest within 10 ms."""
    if association == "nearest":
        return partial(nearest, max_difference_ns=_NEAREST_NS)
    return partial(interpolated, max_gap_ns=round(max_gap_s * 1e9))


def evaluate_file(
    result: Location,
    reference: Location | None,
    pairing: Pairing,
    *,
    aligned: bool = False,
    watch: Watch = unwatched,
) -> EvaluatedRun:
    """How good the run and map in a file are; the truth is the file's own, or what that lacks the reference's.

    Raises:
        RecordingError: a file cannot be read, or holds no results.
        UsageError: there is no truth, or the poses cannot be `aligned`.
    """
    with watch(f"read {result.name}", size_of(result) or None) as progress:
        run, truth, losses = read_run(result, progress)
    if reference is not None:
        other, more = read_reference(reference)
        truth, losses = other.over(truth), losses + more
    _check(result, run, truth)
    try:
        figures = evaluate(run, truth, pairing, aligned=aligned)
    except UsageError as error:
        raise UsageError(f"{result}: {error}") from error
    return EvaluatedRun(figures, run, truth, pairing, tuple(losses))


def _check(result: Location, run: RunResult, truth: Reference) -> None:
    if not run.bundles and not len(run.trajectory) and run.landmarks is None:
        raise RecordingError(f"{result}: has no results to evaluate; run localize on it first")
    if truth.trajectory is None and truth.objects is None:
        raise UsageError(f"{result}: holds no truth; name a log or a TUM trajectory that has it with --reference")
    if not len(run.trajectory) and not run.bundles and truth.objects is None:
        raise UsageError(f"{result}: a map is measured against objects; name a log with them with --reference")
