"""One stage over what it sees of a log: its results as a recording of their own."""

from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

from mcap_landmarks.channels import ANNOTATIONS, CAMERA_IMAGE, ODOM_FRAME, ODOMETRY, TF, TF_STATIC
from mcap_landmarks.errors import MessageError, RecordingError, UsageError
from mcap_landmarks.inspection.topic_roles import beside_camera_info, choose, message_type
from mcap_landmarks.manifest import RUN, Manifest, Outcome, StageRecord
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.recording.layered_log import LayeredLog, Readable
from mcap_landmarks.recording.odometry_buffer import odometry_from
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.runs.bundles import Reading, Span, held_before, inputs_of, read_bundles
from mcap_landmarks.runs.plan import Step
from mcap_landmarks.runs.tallies import tally
from mcap_landmarks.runs.thinning import Thinning, thin
from mcap_landmarks.stage import Channel, Connection, Omission, Progress, RawMessage, Reduction, Stage, Stamped


def run_stage(
    step: Step, view: LayeredLog, span: Span, thinning: Thinning, target: Path, progress: Progress
) -> StageRecord:
    """Run a stage over a view; its results, with the record that is returned, become the recording `target`.

    Raises:
        ToolkitError: the view or a file cannot be used; nothing is left behind.
    """
    stage, reading, counts = step.stage, Reading(), Counter[str]()
    inputs = inputs_of(view, stage.reads, stage.reads[:1], span.choice)
    primary = next(connection for connection, channel in inputs.items() if channel == stage.reads[0])
    writes, notes = _writes(stage, view, inputs, step.config)
    with create_recording(target) as writer:
        raws = _raws(stage, view, inputs, span, thinning, reading, progress)
        bundles = read_bundles(raws, inputs, stage.reads, reading)
        for result in naming(view.path, stage.process(bundles, step.config, step.files)):
            if isinstance(result, Omission):
                _omit(result, primary, reading)
            elif result.channel in writes:
                counts.update(tally(result.message))
                writer.add(Stamped(writes[result.channel], result.log_time_ns, result.message), stage.name)
        reading.close(view.losses)
        record = step.record.with_outcome(outcome_of(reading, counts, notes))
        writer.metadata[RUN] = Manifest("part", fingerprint=record.key, stages=(record,)).entries()
    return record


def outcome_of(reading: Reading, counts: Counter[str] | None = None, notes: tuple[str, ...] = ()) -> Outcome:
    """What came of a reading, for the record."""
    unreadable = reading.unreadable.total()
    counted = dict(sorted((counts or Counter()).items()))
    return Outcome(reading.association.bundles, unreadable, counted, reading.notes(), tuple(reading.losses), notes)


def bundle_count(stage: Stage | Reduction, view: LayeredLog, span: Span) -> int:
    """About how many bundles a stage will have to work on."""
    inputs = inputs_of(view, stage.reads, stage.reads[:1], span.choice)
    return view.count(
        [entry for entry, channel in inputs.items() if channel == stage.reads[0]], span.start_ns, span.end_ns
    )


def counted(
    raws: Iterator[RawMessage], inputs: Mapping[Connection, Channel[Any]], primary: Channel[Any], progress: Progress
) -> Iterator[RawMessage]:
    """The messages as they are; `progress` is told of each one that makes a bundle."""
    for raw in raws:
        yield raw
        if inputs.get(raw.connection) == primary:
            progress(1)


def _raws(
    stage: Stage,
    view: LayeredLog,
    inputs: dict[Connection, Channel[Any]],
    span: Span,
    thinning: Thinning,
    reading: Reading,
    progress: Progress,
) -> Iterator[RawMessage]:
    """The messages that a stage reads, without the images that thinning leaves out."""
    thinned = stage.reads[0] == CAMERA_IMAGE and bool(thinning.options())
    odometry = choose(view, ODOMETRY, span.choice) if thinned and thinning.by_motion else ()
    if thinned and thinning.by_motion and not odometry:
        raise UsageError(f"{view.path}: --every needs odometry, and there is none; use --image-rate")
    wanted = {*inputs, *odometry}
    raws = counted(view.messages(wanted, span.start_ns, span.end_ns), inputs, stage.reads[0], progress)
    if thinned:
        images = [connection for connection, channel in inputs.items() if channel == CAMERA_IMAGE]
        raws = thin(raws, images, odometry, thinning, reading.dropped)
    return chain(held_before(view, inputs, span.start_ns), raws)


def naming(path: Path, results: Iterator[Stamped | Omission]) -> Iterator[Stamped | Omission]:
    """Results of a stage, which does not know where they come from; what it complains of gets the path of the log."""
    try:
        yield from results
    except (RecordingError, UsageError) as error:
        raise type(error)(f"{path}: {error}") from error


def _omit(omission: Omission, primary: Connection, reading: Reading) -> None:
    if omission.lost:
        reading.lose(primary.topic, omission.log_time_ns, omission.reason)
    else:
        reading.dropped[omission.reason] += 1


def _writes(
    stage: Stage, view: LayeredLog, inputs: Mapping[Connection, Channel[Any]], config: Any
) -> tuple[dict[Channel[Any], Channel[Any]], tuple[str, ...]]:
    """The stage's channels and those that they become here, and what is to be said about them.

    Annotations follow the camera's namespace; /tf is left out if the odometry frame has a parent already.
    """
    writes = {channel: channel for channel in stage.writes}
    if ANNOTATIONS in writes:
        primary = next(connection for connection, channel in inputs.items() if channel == stage.reads[0])
        writes[ANNOTATIONS] = beside_camera_info(view, ANNOTATIONS, primary)
    if TF in writes and getattr(config, "tf", "auto") == "auto":
        frame = _odometry_frame(view, inputs)
        if _has_parent(view, frame):
            del writes[TF]
            return writes, (f"{frame} has a parent frame already; no map -> {frame} transform is written",)
    return writes, ()


def _odometry_frame(view: Readable, inputs: Mapping[Connection, Channel[Any]]) -> str:
    """The frame that the odometry is in, as its first message says; /odom's usual one if no message does."""
    for raw in view.messages([connection for connection, channel in inputs.items() if channel == ODOMETRY]):
        try:
            odometry = odometry_from(decode(message_type(ODOMETRY, raw.connection), raw.data))
        except MessageError:
            continue  # reading the bundles counts it
        if odometry is not None:
            return odometry.frame_id.lstrip("/") or ODOM_FRAME
    return ODOM_FRAME


def _has_parent(view: Readable, frame: str) -> bool:
    topics = {TF.topic, TF_STATIC.topic}
    connections = [entry.connection for entry in view.channels if entry.connection.topic in topics]
    name = frame.encode() + b"\0"
    for raw in view.messages(connections):
        if name in bytes(raw.data):  # decode only what can have it as child
            message = decode(TF.message, raw.data)
            if any(transform.child_frame_id.lstrip("/") == frame for transform in message.transforms):
                return True
    return False
