"""One stage over one recording: its results as new channels beside the input's messages."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

from toolkit.channels import ANNOTATIONS, ODOM_FRAME, TF, TF_STATIC
from toolkit.errors import UsageError
from toolkit.manifest import RUN, Manifest, file_hash
from toolkit.messages.codec import decode
from toolkit.recording.blocks import Progress
from toolkit.recording.reader import Recording, open_recording
from toolkit.recording.writer import RecordingWriter, create_recording
from toolkit.runs.bundles import Reading, Span, held_before, inputs_of, read_bundles
from toolkit.runs.config import effective
from toolkit.runs.inputs import beside_camera_info
from toolkit.runs.tallies import tally
from toolkit.stage import Channel, Connection, Omission, RawMessage, Stage, Stamped


@dataclass(slots=True)
class StageRun:
    """What a stage did: where the output is, what its results count, and what became of the input."""

    output: Path
    reading: Reading
    counts: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Job:
    """One recording to run a stage over: where to, with which files, and how much of it."""

    recording: Path
    output: Path
    resources: Mapping[str, Path] = field(default_factory=dict)
    span: Span = field(default_factory=Span)
    results_only: bool = False


def run_stage(stage: Stage, config: Any, job: Job, progress: Progress | None = None) -> StageRun:
    """Run a stage over a recording; the output holds the input's messages, raw, unless only results are asked for.

    Raises:
        ToolkitError: input or output cannot be used; nothing is left behind.
    """
    if job.output.resolve() == job.recording.resolve():
        raise UsageError(f"{job.output} is the input itself; write to another file")
    reading = Reading()
    run = StageRun(job.output, reading)
    with open_recording(job.recording) as recording:
        inputs = inputs_of(recording, stage.reads, stage.reads[:1], job.span.choice)
        primary = next(connection for connection, channel in inputs.items() if channel == stage.reads[0])
        writes = _writes(stage, recording, primary, config, run)
        topics = {channel.topic for channel in writes.values()} - {TF.topic}
        replaced = {connection for topic in topics for connection in recording.connections(topic)}
        manifest = Manifest(
            verb=stage.name,
            config={stage.name: effective(config)},
            inputs=(recording.fingerprint(),),
            resources={name: file_hash(path) for name, path in sorted(job.resources.items())},
            options=_options(job),
            fingerprint=recording.fingerprint(),
        )
        metadata = {**recording.metadata, RUN: manifest.entries()}
        with create_recording(job.output, metadata) as writer:
            held = held_before(recording, inputs, job.span.start_ns)
            raws = chain(held, _copy(recording, writer, job, inputs, replaced, progress))
            bundles = read_bundles(raws, inputs, stage.reads, reading)
            for result in stage.process(bundles, config, job.resources):
                if isinstance(result, Omission):
                    _omit(result, primary, reading)
                elif result.channel in writes:
                    run.counts.update(tally(result.message))
                    channel = writes[result.channel]
                    writer.add(Stamped(channel, result.log_time_ns, result.message), group=stage.name)
            if not job.results_only:
                for attachment in recording.attachments():
                    writer.attach(attachment)
            reading.close(recording.losses)
    return run


def _copy(
    recording: Recording,
    writer: RecordingWriter,
    job: Job,
    inputs: Iterable[Connection],
    replaced: Iterable[Connection],
    progress: Progress | None,
) -> Iterator[RawMessage]:
    """The recording's messages, each written to the output on its way unless results replace it."""
    gone = set(replaced)
    kept = [entry.connection for entry in recording.channels if entry.connection not in gone]
    if job.results_only:
        kept = [connection for connection in kept if connection in set(inputs)]
    else:
        for connection in kept:
            writer.declare(connection)
    for raw in recording.messages(kept, job.span.start_ns, job.span.end_ns, progress):
        if not job.results_only:
            writer.write(raw)
        yield raw


def _omit(omission: Omission, primary: Connection, reading: Reading) -> None:
    if omission.lost:
        reading.lose(primary.topic, omission.log_time_ns, omission.reason)
    else:
        reading.dropped[omission.reason] += 1


def _writes(
    stage: Stage, recording: Recording, primary: Connection, config: Any, run: StageRun
) -> dict[Channel[Any], Channel[Any]]:
    """The stage's channels and those that they become here.

    Annotations follow the camera's namespace; /tf is left out if the odometry frame has a parent already.
    """
    writes = {channel: channel for channel in stage.writes}
    if ANNOTATIONS in writes:
        writes[ANNOTATIONS] = beside_camera_info(recording, ANNOTATIONS, primary)
    if TF in writes and getattr(config, "tf", "auto") == "auto" and _odom_has_parent(recording):
        del writes[TF]
        run.notes.append(
            f"{recording.path}: {ODOM_FRAME} has a parent frame already; no map -> odom transform is written"
        )
    return writes


def _odom_has_parent(recording: Recording) -> bool:
    connections = [connection for channel in (TF, TF_STATIC) for connection in recording.connections(channel.topic)]
    name = ODOM_FRAME.encode() + b"\0"
    for raw in recording.messages(connections):
        if name in bytes(raw.data):  # decode only what can have it as child
            message = decode(TF.message, raw.data)
            if any(transform.child_frame_id.lstrip("/") == ODOM_FRAME for transform in message.transforms):
                return True
    return False


def _options(job: Job) -> dict[str, object]:
    span = job.span
    given: dict[str, object] = {
        "topics": dict(span.choice.topics),
        "remaps": dict(span.choice.remaps),
        "start_ns": span.start_ns,
        "end_ns": span.end_ns,
        "results_only": job.results_only or None,
    }
    return {key: value for key, value in given.items() if value}
