"""What one log saw, gathered for a map: after the stages that it lacks, or as a worker left it among the parts."""

import contextlib
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcap_landmarks.atomic import atomic_file
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.manifest import Outcome
from mcap_landmarks.mapping.observations import LogObservations
from mcap_landmarks.progress import Watch
from mcap_landmarks.runs.map_plan import LogPlan, MapPlan
from mcap_landmarks.runs.map_results import MappedLog
from mcap_landmarks.runs.pipeline import told
from mcap_landmarks.runs.session import Session, StageRun, open_session, part_file
from mcap_landmarks.runs.stage_input import StageInput
from mcap_landmarks.runs.stage_runner import outcome_of
from mcap_landmarks.stages.build_map import STAGE

_OTHERS = ("classes", "bundles", "fingerprint", "dropped")
_ARRAYS = tuple(field.name for field in fields(LogObservations) if field.name not in _OTHERS)


@dataclass(frozen=True, slots=True, eq=False)
class Observed:
    """What became of a log, what it saw, and by log time how far its clock had been set back."""

    log: MappedLog
    observations: LogObservations
    shifts_ns: Mapping[int, int]


def observe(plan: MapPlan, log: LogPlan, reason: str, parts: Path, watch: Watch, *, is_kept: bool = False) -> Observed:
    """Run the stages that a log lacks, and gather what it saw; `is_kept` leaves that among the parts, too.

    Raises:
        RecordingError: it has no scene objects or no odometry, or none of its bundles has odometry.
    """
    with open_session(log.request, parts, plan.task.outputs.get(log.request.recording)) as session:
        runs = tuple(session.work(step, watch) for step in log.steps)
        name = Path(log.record.file_name).with_suffix(".npz")
        found = None if log.request.force else _read(parts / name)
        if found is None:
            found = _collect(plan, log, session, watch)
            if is_kept:
                _write(part_file(parts, log.record).with_name(name.name), *found)
    observations, outcome, shifts_ns = found
    notes, losses = told([*runs, StageRun(STAGE.name, "ran", reason, outcome)], [], [])
    mapped = MappedLog(log.request.recording, log.fingerprint, runs, replace(outcome, losses=losses, notes=notes))
    return Observed(mapped, observations, shifts_ns)


_Collected = tuple[LogObservations, Outcome, Mapping[int, int]]


def _collect(plan: MapPlan, log: LogPlan, session: Session, watch: Watch) -> _Collected:
    """Observations of one log, what came of reading it, and how far its clock had been set back."""
    source = StageInput(STAGE, session.log_for(log.record), session.request.span, session.examiner)
    with watch(f"read {source.path.name}", source.count, "bundles") as progress:
        observations: LogObservations = STAGE.collect(source.bundles(progress), plan.config)
    source.close()
    source.reading.dropped.update(observations.dropped)
    if not len(observations.stamps_ns):
        raise RecordingError(
            f"{source.path}: none of {observations.bundles} bundles has odometry within 2 s; check that the clocks of "
            "odometry and scene objects agree"
        )
    outcome = outcome_of(source.reading, notes=source.notes)
    return replace(observations, fingerprint=log.fingerprint), outcome, source.reading.shifts_ns


def _write(path: Path, observations: LogObservations, outcome: Outcome, shifts_ns: Mapping[int, int]) -> None:
    """Leave observations for who solves the map."""
    told = {
        "outcome": outcome.entry(),
        "shifts_ns": list(shifts_ns.items()),
        **{name: getattr(observations, name) for name in _OTHERS},
    }
    arrays: dict[str, NDArray[Any]] = {name: getattr(observations, name) for name in _ARRAYS}
    with atomic_file(path) as stream:
        np.savez(stream, told=np.array(json.dumps(told)), **arrays)  # type: ignore[arg-type] # its stub has one bool


def _read(path: Path) -> _Collected | None:
    """What `_write` left, None if there is nothing."""
    if not path.is_file():
        return None
    broken = (OSError, ValueError, KeyError, zipfile.BadZipFile)
    with contextlib.suppress(*broken), path.open("rb") as stream, np.load(stream) as found:
        told = json.loads(str(found["told"]))
        outcome, shifts_ns = Outcome.of(told.pop("outcome")), dict(told.pop("shifts_ns"))
        told["classes"] = tuple(told["classes"])
        return LogObservations(**{name: found[name] for name in _ARRAYS}, **told), outcome, shifts_ns
    return None
