"""What each stage of a run will be made from: its configuration, its files, what it reads; known before it runs.

CONTRIBUTING.md follows a setting from the command line through `plan` to its stage.
"""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

from mcap_landmarks.channels import CAMERA_INFO, ODOMETRY, RESULTS
from mcap_landmarks.config import Settings, effective, load, load_files, named_files
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.inspection.camera_checks import refuse_cameras
from mcap_landmarks.inspection.time_offsets import OFFSET_ROLES
from mcap_landmarks.inspection.topic_roles import ROLES, Choice
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import RECORDING, StageRecord, code_hash, entry_text, file_hash, is_generated, text_hash
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.runs.bundles import Span
from mcap_landmarks.runs.recorded_log import RecordedLog
from mcap_landmarks.runs.segment_tasks import Segments
from mcap_landmarks.runs.thinning import Thinning
from mcap_landmarks.stage import Channel, Config, Reduction, Stage
from mcap_landmarks.stages import STAGES, find_stage


@dataclass(frozen=True, slots=True)
class Request:
    """What to do with one log: settings of all stages, files by resource name, how much of the log, and how.

    `use` names the stages that are wanted where several write the same channel. `force` runs every stage anew, whatever
    results there are. `overwrite` lets the output replace what is no earlier result. `config_file` is where settings
    were read, and is no more to be replaced than the other files. With `segments` workers run what can be cut.
    """

    recording: Location
    settings: Settings = field(default_factory=dict)
    files: Mapping[str, Location | None] = field(default_factory=dict)
    span: Span = field(default_factory=Span)
    thinning: Thinning = field(default_factory=Thinning)
    use: tuple[str, ...] = ()
    results_only: bool = False
    force: bool = False
    overwrite: bool = False
    config_file: Location | None = None
    segments: Segments | None = None

    def reads(self) -> list[Location]:
        """The files that are read, as far as they were named."""
        files = [*self.files.values(), *named_files(self.settings).values()]
        return [self.recording, *(file for file in [*files, self.config_file] if file is not None)]

    def options(self) -> dict[str, object]:
        """For the manifest: what was asked for."""
        span = self.span
        given: dict[str, object] = {
            **choice_options(span.choice, tuple({**ROLES, **OFFSET_ROLES})),
            "start_ns": span.start_ns,
            "end_ns": span.end_ns,
            "use": list(self.use) or None,
            "results_only": self.results_only or None,
            **self.thinning.options(),
        }
        return {key: value for key, value in given.items() if value is not None}


@dataclass(frozen=True, slots=True)
class Step:
    """One stage of a plan: its configuration, its files, and the record that its results will have."""

    stage: Stage
    config: Config
    files: Mapping[str, Location]
    record: StageRecord


def plan(request: Request, log: RecordedLog, names: Sequence[str]) -> list[Step]:
    """The stages of a run over one log, in their order, each with the key that its results will have.

    Raises:
        UsageError: a setting is wrong, or a file that a stage needs is not given.
        ToolkitError: a file cannot be read.
    """
    steps: list[Step] = []
    generated = is_generated(log.recording.metadata)
    for name in names:
        stage = find_stage(name)
        assert isinstance(stage, Stage)  # noqa: S101 - `needed_stages` gives no others
        earlier = None if request.force else _earlier(stage, log, generated)
        kept = () if earlier is None else stage.choices
        config, files = load_files(stage, request.settings, request.files, generated=generated, kept=kept)
        config = stage.settle(config) if stage.settle else config
        inputs, options = inputs_of_stage(stage, log, steps), _options(stage, request)
        read = {**files.paths, **frame_files(stage, request)}
        record = replace(record_of(stage, config, read, inputs, options), origins=files.origins)
        if earlier is not None:
            hashes = {name: value for name, value in earlier.resources.items() if name in kept}
            origins = {**earlier.origins, **record.origins}
            record = replace(record, resources={**hashes, **record.resources}, origins=origins)
        steps.append(Step(stage, config, files.paths, record))
    return steps


def check_cameras(request: Request, log: RecordedLog, names: Sequence[str]) -> None:
    """Refuse cameras that cannot be understood before images are looked at, if a stage of some needs both.

    Raises:
        UsageError: a setting of that stage is wrong.
        RecordingError: see `refuse_cameras`.
    """
    for name in names:
        stage = find_stage(name)
        if CAMERA_INFO in stage.reads:
            config = load(name, request.settings)
            if isinstance(config, FuseConfig) and config.method == "default":
                refuse_cameras(log.without_results(), log.choice, config.rectified)


def _earlier(stage: Stage, log: RecordedLog, generated: bool) -> StageRecord | None:
    """The record of results in a log whose chosen files are not those that would be chosen now.

    Nobody has to name the network again that made what a log holds.
    """
    layer = log.results.get(stage.name)
    if layer is None or layer.record is None or not stage.choices:
        return None
    for name, choose in stage.choices.items():
        with contextlib.suppress(ToolkitError):
            if file_hash(choose(None, generated).path) == layer.record.resources.get(name):
                return None
    return layer.record


def inputs_of_stage(stage: Stage | Reduction, log: RecordedLog, steps: Sequence[Step]) -> dict[str, str]:
    """What a stage reads of a log after some steps: the recording's fingerprint, and keys of results by stage.

    Results win over the recording's own messages, unless a topic is remapped to theirs.
    """
    writers = {entry.connection.topic: layer.record for layer in log.results.values() for entry in layer.channels}
    writers |= {channel.topic: step.record for step in steps for channel in step.stage.writes}
    records = [writers.get(channel.topic) for channel in stage.reads if is_result(channel, log.choice)]
    return {RECORDING: log.fingerprint} | {record.stage: record.key for record in records if record is not None}


def is_result(channel: Channel[Message], choice: Choice) -> bool:
    """Whether stages read a channel from results, where there are any."""
    return channel.topic.startswith(RESULTS) and channel.topic not in choice.remaps.values()


def frame_files(stage: Stage | Reduction, request: Request) -> dict[str, Location]:
    """The file that tells where frames are: odometry and ready-made objects are brought to the robot's by it."""
    extrinsics = request.files.get("extrinsics")
    return {"extrinsics": extrinsics} if extrinsics is not None and ODOMETRY in stage.reads else {}


def record_of(
    stage: Stage | Reduction,
    config: Config,
    files: Mapping[str, Location],
    inputs: Mapping[str, str],
    options: Mapping[str, object],
) -> StageRecord:
    """What a stage's results will be made from.

    Raises:
        ToolkitError: a file cannot be read.
    """
    hashes = {name: file_hash(path) for name, path in sorted(files.items())}
    return StageRecord(stage.name, _code(stage), effective(config), hashes, inputs, options)


def _code(stage: Stage | Reduction) -> str:
    """The hash of the toolkit's sources, and of what packages bring that takes part in a stage's results."""
    extensible = stage.extensible if isinstance(stage, Stage) else ()
    brought = [STAGES.code(stage.name), *(registry.code() for registry in extensible)]
    return text_hash(entry_text([code_hash(), brought])) if any(brought) else code_hash()


def _options(stage: Stage, request: Request) -> dict[str, object]:
    """What decides a stage's results beside its configuration and files."""
    thinning = request.thinning.options() if stage.thinned else {}
    odometry = (ODOMETRY,) if thinning and request.thinning.by_motion else ()
    return choice_options(request.span.choice, (*stage.reads, *odometry)) | thinning


def choice_options(choice: Choice, reads: Sequence[Channel[Message]]) -> dict[str, object]:
    """For the manifest: what was said about the topics that are read."""
    roles = {role.name for channel, role in ROLES.items() if channel in reads}
    given = {entry.name: getattr(choice, entry.name) for entry in fields(choice)}
    given["topics"] = {role: topic for role, topic in choice.topics.items() if role in roles}
    given["images"] = list(choice.images) if roles & {"image", "camera_info"} else []
    given["offsets_ns"] = _offsets(choice, reads)
    return {name: value for name, value in given.items() if value}


def _offsets(choice: Choice, reads: Sequence[Channel[Message]]) -> dict[str, int]:
    """What is added to the stamps of channels that are read, by role."""
    clocks = {OFFSET_ROLES[channel] for channel in reads if channel in OFFSET_ROLES}
    return {role: ns for role, ns in sorted(choice.offsets_ns.items()) if ns and role in clocks}
