"""What a landmark map of several logs will be made from: the stages that each log lacks, what the map reads of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from mcap_landmarks.config import load
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import StageRecord
from mcap_landmarks.runs.bundles import inputs_of
from mcap_landmarks.runs.clock_refusal import refuse_clocks
from mcap_landmarks.runs.needed_stages import missing_stages
from mcap_landmarks.runs.plan import (
    Request,
    Step,
    check_cameras,
    choice_options,
    frame_files,
    inputs_of_stage,
    is_result,
    plan,
    record_of,
)
from mcap_landmarks.runs.session import open_session
from mcap_landmarks.stage import Config
from mcap_landmarks.stages.build_map import STAGE


@dataclass(frozen=True, slots=True)
class MapTask:
    """The logs of a map (their settings are the first one's), the database, each log's output, a map to extend.

    `parts` is where workers left what logs give to it, which stays; without one it is a folder of its own.
    """

    requests: tuple[Request, ...]
    database: Location
    outputs: Mapping[Location, Location] = field(default_factory=dict)
    prior: Location | None = None
    parts: Path | None = None

    @property
    def files(self) -> dict[str, Location]:
        """The files that the map is made with."""
        return {"prior": self.prior} if self.prior is not None else {}

    def reads(self) -> list[Location]:
        """The files that are read, as far as they were named."""
        return [*self.files.values(), *(place for request in self.requests for place in request.reads())]


@dataclass(frozen=True, slots=True)
class LogPlan:
    """One log on its way: its place among the logs, its steps up to the scene objects, what the map will read of it.

    The places follow the fingerprints, so that the map is the same in whatever order the logs are named.
    """

    place: str
    request: Request
    fingerprint: str
    steps: tuple[Step, ...]
    record: StageRecord


@dataclass(frozen=True, slots=True)
class MapPlan:
    """A map on its way: how it is built, of which logs, and the record that it will have."""

    task: MapTask
    config: Config
    logs: tuple[LogPlan, ...]
    record: StageRecord

    def share(self, log: LogPlan) -> StageRecord:
        """The record of one log's results of the map."""
        return replace(log.record, inputs={**log.record.inputs, log.place: self.record.key})


def plan_map(task: MapTask, parts: Path) -> MapPlan:
    """The plan of a map; `parts` is where an unfinished run may have left results.

    Raises:
        RecordingError: a log cannot be read, has nothing to make a map of, or clocks that would spoil one.
        UsageError: a recording is named twice, or a setting or file is wrong.
    """
    config = load(STAGE.name, task.requests[0].settings)
    planned = [_plan_log(config, request, task, parts) for request in task.requests]
    _check_each_once(planned)
    planned.sort(key=lambda log: log.fingerprint)
    logs = tuple(replace(log, place=f"log {number}") for number, log in enumerate(planned, 1))
    inputs = {log.place: log.record.key for log in logs}
    return MapPlan(task, config, logs, record_of(STAGE, config, task.files, inputs, {}))


def _plan_log(config: Config, request: Request, task: MapTask, parts: Path) -> LogPlan:
    with open_session(request, parts, None) as session:
        log, choice = session.log, session.request.span.choice
        sensed = [channel for channel in STAGE.required if not is_result(channel, choice)]
        inputs_of(log.without_results(), sensed, sensed, choice)  # before hours are spent on the other stages
        names = missing_stages(STAGE, log, request.use)
        check_cameras(session.request, log, names)
        steps = tuple(plan(session.request, log, names))
        refuse_clocks(session, steps)
        inputs, options = inputs_of_stage(STAGE, log, steps), choice_options(choice, STAGE.reads)
        record = record_of(STAGE, config, {**task.files, **frame_files(STAGE, request)}, inputs, options)
        return LogPlan("", session.request, log.recording.fingerprint(), steps, record)


def _check_each_once(logs: Sequence[LogPlan]) -> None:
    """Refuse a recording that is named twice, also as an output of ours: what it saw would count double."""
    known: dict[str, Location] = {}
    for log in logs:
        path = log.request.recording
        if log.fingerprint in known:
            raise UsageError(f"{path} is the same recording as {known[log.fingerprint]}; name it once")
        known[log.fingerprint] = path
