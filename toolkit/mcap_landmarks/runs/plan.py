"""Which stages a log needs, and what each will be made from: known before anything is read."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from mcap_landmarks.channels import CAMERA_IMAGE, ODOMETRY, RESULTS
from mcap_landmarks.config import Settings, effective, load_files
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.inspection.topic_roles import ROLES, Choice, choose, could_be
from mcap_landmarks.manifest import RECORDING, StageRecord, code_hash, file_hash, narrowed
from mcap_landmarks.recording.layered_log import LayeredLog, own_layer, result_layers
from mcap_landmarks.recording.reader import Recording
from mcap_landmarks.runs.bundles import Span
from mcap_landmarks.runs.thinning import Thinning
from mcap_landmarks.stage import Channel, Reduction, Stage
from mcap_landmarks.stages import find_stage, stage_names


@dataclass(frozen=True, slots=True)
class Request:
    """What to do with one log: settings of all stages, files by resource name, how much of the log, and how.

    `force` runs every stage anew, whatever results there are.
    """

    recording: Path
    settings: Settings = field(default_factory=dict)
    files: Mapping[str, Path | None] = field(default_factory=dict)
    span: Span = field(default_factory=Span)
    thinning: Thinning = field(default_factory=Thinning)
    results_only: bool = False
    force: bool = False

    def options(self) -> dict[str, object]:
        """For the manifest: what was asked for."""
        span = self.span
        given: dict[str, object] = {
            **choice_options(span.choice, tuple(ROLES)),
            "start_ns": span.start_ns,
            "end_ns": span.end_ns,
            "results_only": self.results_only or None,
            **self.thinning.options(),
        }
        return {key: value for key, value in given.items() if value is not None}


@dataclass(frozen=True, slots=True)
class Step:
    """One stage of a plan: its configuration, its files, and the record that its results will have."""

    stage: Stage
    config: Any
    files: Mapping[str, Path]
    record: StageRecord


class Log:
    """An open recording with its own messages apart from the results that stages left in it.

    Raises:
        UsageError: nothing of it lies in the time span.
    """

    def __init__(self, recording: Recording, span: Span) -> None:
        _check_span(recording, span)
        self.path = recording.path
        self.recording = recording
        self.own, self.results = own_layer(recording), result_layers(recording)
        self.fingerprint = narrowed(recording.fingerprint(), start_ns=span.start_ns, end_ns=span.end_ns)
        self.choice = span.choice

    def view(self) -> LayeredLog:
        """Its own messages."""
        return LayeredLog(self.path, [self.own])

    def has(self, channel: Channel[Any]) -> bool:
        """Whether the recording has messages of its own for a channel.

        Raises:
            UsageError: several topics could be meant.
        """
        view = self.view()
        counts = {entry.connection: entry.count for entry in view.channels}
        return sum(counts[connection] for connection in choose(view, channel, self.choice)) > 0


def _check_span(recording: Recording, span: Span) -> None:
    first, last = recording.start_ns, recording.end_ns
    if first is None or last is None:
        return
    if (span.start_ns or 0) > last or (span.end_ns is not None and span.end_ns <= first):
        raise UsageError(
            f"{recording.path}: no message lies between --start and --end; the log lasts from {first} to {last} ns"
        )


def missing_stages(stage: Stage | Reduction, log: Log) -> list[str]:
    """The stages that have to come before one, in order: those whose results the log does not have as its own.

    Results of ours in a log that lacks what they were made from are taken as they are.

    Raises:
        RecordingError: something that the stage needs is not there and cannot be made.
    """
    names: list[str] = []
    for channel in stage.reads:
        if not channel.topic.startswith(RESULTS) or log.has(channel):
            continue
        producer = _producer(channel)
        if producer.name in log.results and not log.own.channels:
            continue
        try:
            names += [name for name in _chain_to(producer, log) if name not in names]
        except _LackingError as error:
            if producer.name not in log.results:
                raise _LackingError(log, channel, error.source) from None
    return names


class _LackingError(RecordingError):
    """A log has neither a channel nor its source, which it could be made from."""

    def __init__(self, log: Log, channel: Channel[Any], source: Channel[Any]) -> None:
        remedy = (
            f"choose topics with --remap or {ROLES[source].option if source in ROLES else '--remap'}, or take a log "
            "that has one of them"
        )
        super().__init__(
            f"{log.path}: there is no {_name(channel)}, and no {_name(source)} to make it from; "
            f"{could_be(log.view(), source) or remedy}"
        )
        self.source = source


def _chain_to(producer: Stage, log: Log) -> list[str]:
    """The missing stages up to one and that one itself."""
    chain, primary = [*missing_stages(producer, log), producer.name], producer.reads[0]
    if not primary.topic.startswith(RESULTS) and not log.has(primary):
        raise _LackingError(log, primary, primary)
    return chain


def _name(channel: Channel[Any]) -> str:
    role = ROLES.get(channel)
    return f"{role.name} ({' or '.join(role.types)})" if role else channel.topic


def _producer(channel: Channel[Any]) -> Stage:
    for name in stage_names():
        stage = find_stage(name)
        if isinstance(stage, Stage) and channel in stage.writes:
            return stage
    raise UsageError(f"{channel.topic}: no stage writes it; read another topic as it with --remap")


def in_order(names: Iterable[str]) -> list[str]:
    """Stages by name, each after those whose results it reads.

    Raises:
        UsageError: there is no such stage, or it is not one that runs over a single log.
    """
    stages = {}
    for name in names:
        if name not in stage_names():
            raise UsageError(f"{name} is no stage; there are {', '.join(stage_names())}")
        stage = find_stage(name)
        if not isinstance(stage, Stage):
            raise UsageError(f"{name} makes one result of many logs; use the verb that it belongs to")
        stages[name] = stage
    ordered: list[str] = []
    while len(ordered) < len(stages):
        waiting = [stage for name, stage in stages.items() if name not in ordered]
        free = [stage for stage in waiting if not any(_reads(stage, other) for other in waiting if other is not stage)]
        ordered += sorted(stage.name for stage in free)
    return ordered


def _reads(stage: Stage, other: Stage) -> bool:
    return any(channel in other.writes for channel in stage.reads if channel.topic.startswith(RESULTS))


def plan(request: Request, log: Log, names: Sequence[str]) -> list[Step]:
    """The stages of a run over one log, in their order, each with the key that its results will have.

    Raises:
        UsageError: a setting is wrong, or a file that a stage needs is not given.
        ToolkitError: a file cannot be read.
    """
    steps: list[Step] = []
    for name in names:
        stage = find_stage(name)
        assert isinstance(stage, Stage)  # noqa: S101 - `in_order` and `missing_stages` give no others
        config, files = load_files(stage, request.settings, request.files)
        inputs = inputs_of_stage(stage, log, steps)
        steps.append(Step(stage, config, files, record_of(stage, config, files, inputs, _options(stage, request))))
    return steps


def inputs_of_stage(stage: Stage | Reduction, log: Log, steps: Sequence[Step]) -> dict[str, str]:
    """What a stage reads of a log after some steps: the recording's fingerprint, and keys of results by stage.

    Results win over the recording's own messages, unless a topic is remapped to theirs.
    """
    writers = {entry.connection.topic: layer.record for layer in log.results.values() for entry in layer.channels}
    writers |= {channel.topic: step.record for step in steps for channel in step.stage.writes}
    records = [writers.get(channel.topic) for channel in stage.reads if is_result(channel, log.choice)]
    return {RECORDING: log.fingerprint} | {record.stage: record.key for record in records if record is not None}


def is_result(channel: Channel[Any], choice: Choice) -> bool:
    """Whether stages read a channel from results, where there are any."""
    return channel.topic.startswith(RESULTS) and channel.topic not in choice.remaps.values()


def record_of(
    stage: Stage | Reduction,
    config: Any,
    files: Mapping[str, Path],
    inputs: Mapping[str, str],
    options: Mapping[str, object],
) -> StageRecord:
    """What a stage's results will be made from.

    Raises:
        ToolkitError: a file cannot be read.
    """
    hashes = {name: file_hash(path) for name, path in sorted(files.items())}
    return StageRecord(stage.name, code_hash(), effective(config), hashes, inputs, options)


def _options(stage: Stage, request: Request) -> dict[str, object]:
    """What decides a stage's results beside its configuration and files."""
    thinning = request.thinning.options() if stage.reads[0] == CAMERA_IMAGE else {}
    odometry = (ODOMETRY,) if thinning and request.thinning.by_motion else ()
    return choice_options(request.span.choice, (*stage.reads, *odometry)) | thinning


def choice_options(choice: Choice, reads: Sequence[Channel[Any]]) -> dict[str, object]:
    """For the manifest: what was said about the topics that are read."""
    roles = {role.name for channel, role in ROLES.items() if channel in reads}
    given = {entry.name: getattr(choice, entry.name) for entry in fields(choice)}
    given["topics"] = {role: topic for role, topic in choice.topics.items() if role in roles}
    return {name: value for name, value in given.items() if value}
