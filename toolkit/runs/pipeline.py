"""One stage over one recording: its results as new channels beside the input's messages."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from toolkit.channels import ODOM_FRAME, SCENE_OBJECTS, TF, TF_STATIC
from toolkit.errors import UsageError
from toolkit.manifest import RUN, Manifest, file_hash
from toolkit.messages.codec import decode
from toolkit.messages.match import LandmarkMatch
from toolkit.recording.blocks import Progress
from toolkit.recording.reader import Recording, open_recording
from toolkit.recording.writer import RecordingWriter, create_recording
from toolkit.runs.bundles import Reading, Span, inputs_of, read_bundles
from toolkit.runs.config import effective
from toolkit.stage import Connection, RawMessage, Stage


@dataclass(slots=True)
class StageRun:
    """What a stage did: where the output is, bundles by status, and what became of the input."""

    output: Path
    reading: Reading
    statuses: Counter[str] = field(default_factory=Counter)
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
        inputs = inputs_of(recording, stage.reads, (SCENE_OBJECTS,), job.span.choice)
        writes = _writes(stage, recording, config, run)
        replaced = {connection for topic in writes - {TF.topic} for connection in recording.connections(topic)}
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
            raws = _copy(recording, writer, job, inputs, replaced, progress)
            bundles = read_bundles(raws, inputs, SCENE_OBJECTS, reading)
            for stamped in stage.process(bundles, config, job.resources):
                if stamped.channel.topic not in writes:
                    continue
                if isinstance(stamped.message, LandmarkMatch):
                    run.statuses[stamped.message.status.name.lower()] += 1
                writer.add(stamped, group=stage.name)
            if not job.results_only:
                for attachment in recording.attachments():
                    writer.attach(attachment)
            reading.losses.extend(recording.losses)
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


def _writes(stage: Stage, recording: Recording, config: Any, run: StageRun) -> set[str]:
    """Topics that the stage may write: without /tf if the odometry frame has a parent already."""
    topics = {channel.topic for channel in stage.writes}
    if TF.topic in topics and getattr(config, "tf", "auto") == "auto" and _odom_has_parent(recording):
        topics.remove(TF.topic)
        run.notes.append(
            f"{recording.path}: {ODOM_FRAME} has a parent frame already; no map -> odom transform is written"
        )
    return topics


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
