"""What one log saw, gathered for a map: after the stages that it lacks, or as a worker left it among the parts."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.manifest import Outcome
from mcap_landmarks.mapping.observations import LogObservations
from mcap_landmarks.mapping.prepared_log import LogAlone
from mcap_landmarks.progress import Watch
from mcap_landmarks.runs.array_files import as_arrays, from_arrays, read_arrays, write_arrays
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
    """What became of a log, what it saw, and by log time how far its clock had been set back.

    `alone` is what the map's stage makes of that before other logs are known; nothing unless a worker left it.
    """

    log: MappedLog
    observations: LogObservations
    shifts_ns: Mapping[int, int]
    alone: tuple[LogAlone, ...] = ()


def observe(plan: MapPlan, log: LogPlan, reason: str, parts: Path, watch: Watch, *, is_kept: bool = False) -> Observed:
    """Run the stages that a log lacks, and gather what it saw.

    `is_kept` leaves that among the parts, too, with what takes longest of the map.

    Raises:
        RecordingError: it has no scene objects or no odometry, or none of its bundles has odometry.
    """
    with open_session(log.request, parts, plan.task.outputs.get(log.request.recording)) as session:
        runs = tuple(session.work(step, watch) for step in log.steps)
        name = Path(log.record.file_name).with_suffix(".npz").name
        found = None if log.request.force else _read(parts / name)
        if found is None:
            found = _collect(plan, log, session, watch)
            if is_kept:
                with watch("solve alone", None, "steps"):
                    found = found._replace(alone=STAGE.alone(found.observations, plan.config))
                _write(part_file(parts, log.record).with_name(name), found)
    notes, losses = told([*runs, StageRun(STAGE.name, "ran", reason, found.outcome)], [], [])
    outcome = replace(found.outcome, losses=losses, notes=notes)
    mapped = MappedLog(log.request.recording, log.fingerprint, runs, outcome)
    return Observed(mapped, found.observations, found.shifts_ns, found.alone)


class _Collected(NamedTuple):
    """Observations of one log, what came of reading it, how far its clock was set back, and what it tells alone."""

    observations: LogObservations
    outcome: Outcome
    shifts_ns: Mapping[int, int]
    alone: tuple[LogAlone, ...] = ()


def _collect(plan: MapPlan, log: LogPlan, session: Session, watch: Watch) -> _Collected:
    """Read the observations of a log."""
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
    return _Collected(replace(observations, fingerprint=log.fingerprint), outcome, source.reading.shifts_ns)


def _write(path: Path, found: _Collected) -> None:
    """Leave what was collected for who solves the map."""
    told = {
        "outcome": found.outcome.entry(),
        "shifts_ns": list(found.shifts_ns.items()),
        "alone": len(found.alone),
        **{name: getattr(found.observations, name) for name in _OTHERS},
    }
    arrays = {name: getattr(found.observations, name) for name in _ARRAYS}
    for i, one in enumerate(found.alone):
        arrays.update(as_arrays(f"alone.{i}", one))
    write_arrays(path, {"told": np.array(json.dumps(told)), **arrays})


def _read(path: Path) -> _Collected | None:
    """What `_write` left, None if there is nothing."""
    arrays = read_arrays(path)
    if arrays is None:
        return None
    told: dict[str, Any] = json.loads(str(arrays["told"]))
    outcome, shifts_ns, count = Outcome.of(told.pop("outcome")), dict(told.pop("shifts_ns")), told.pop("alone")
    told["classes"] = tuple(told["classes"])
    observations = LogObservations(**{**{name: arrays[name] for name in _ARRAYS}, **told})
    alone = tuple(from_arrays(f"alone.{i}", LogAlone, arrays) for i in range(count))
    return _Collected(observations, outcome, shifts_ns, alone)
