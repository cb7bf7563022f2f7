"""One stage over what it reads of a log: its results as a recording of their own."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import RUN, Manifest, Outcome, StageRecord
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.writer import RecordingWriter, create_recording
from mcap_landmarks.runs.bundles import Reading
from mcap_landmarks.runs.original_stamps import as_stamped
from mcap_landmarks.runs.plan import Request, Step
from mcap_landmarks.runs.stage_input import StageInput
from mcap_landmarks.runs.tallies import tally
from mcap_landmarks.stage import Bundle, Channel, Config, LeftOut, Omission, Stage, Stamped


def run_stage(step: Step, log: StageInput, request: Request, target: Path, progress: Progress) -> StageRecord:
    """Run a stage over a log; its results, with the record that is returned, become the recording `target`.

    Raises:
        ToolkitError: the log or a file cannot be used; nothing is left behind.
    """
    stage = step.stage
    with create_recording(target, is_passing=True) as writer:
        bundles = log.bundles(progress, request.thinning) if stage.thinned else log.bundles(progress)
        counts = write_results(step, log, bundles, writer)
        record = record_with_outcome(step, log, counts)
        writer.metadata[RUN] = Manifest("part", fingerprint=record.key, stages=(record,)).entries()
    return record


def write_results(step: Step, log: StageInput, bundles: Iterable[Bundle], writer: RecordingWriter) -> Counter[str]:
    """Write what a stage makes of bundles; its results by kind."""
    stage, counts = step.stage, Counter[str]()
    writes, _ = _writes(stage, log, step.config)
    for result in naming(log.path, stage.process(bundles, step.config, step.files)):
        if isinstance(result, Omission):
            _omit(result, log)
            continue
        channel = writes.get((result.channel, result.frame_id)) or writes.get((result.channel, ""))
        if channel is not None:
            counts.update(tally(result.message))
            shift_ns = log.reading.shifts_ns.get(result.log_time_ns, 0)
            writer.add(Stamped(channel, result.log_time_ns, as_stamped(result.message, shift_ns)), stage.name)
    return counts


def record_with_outcome(
    step: Step, log: StageInput, counts: Counter[str], damage: Sequence[str] | None = None
) -> StageRecord:
    """The record of a stage when all of a log was read; `damage` is what others found of it who did that.

    Raises:
        RecordingError: no message could be read that a bundle is made of, or no bundle used.
    """
    _, notes = _writes(step.stage, log, step.config)
    log.close(damage)
    _check_read(log)
    return step.record.with_outcome(outcome_of(log.reading, counts, (*log.notes, *notes)))


def _check_read(log: StageInput) -> None:
    """Refuse a log of which no message could be read that a bundle is made of.

    Raises:
        RecordingError: as it says.
    """
    reading = log.reading
    if reading.losses and not reading.association.bundles:
        raise RecordingError(f"{log.path}: not one message of {log.primary.topic} could be read: {reading.losses[0]}")
    if reading.useless and reading.useless == reading.association.bundles:
        raise RecordingError(f"{log.path}: none of {reading.useless} images could be read: {reading.losses[0]}")


def outcome_of(reading: Reading, counts: Counter[str] | None = None, notes: tuple[str, ...] = ()) -> Outcome:
    """What came of a reading, for the record."""
    unreadable = reading.unreadable.total()
    counted = dict(sorted((counts or Counter()).items()))
    return Outcome(reading.association.bundles, unreadable, counted, reading.notes(), tuple(reading.losses), notes)


def naming(path: Location, results: Iterator[Stamped | Omission]) -> Iterator[Stamped | Omission]:
    """Results of a stage, which does not know where they come from; what it complains of gets the path of the log."""
    try:
        yield from results
    except (RecordingError, UsageError) as error:
        raise type(error)(f"{path}: {error}") from error


def _omit(omission: Omission, log: StageInput) -> None:
    if omission.lost:
        source = log.by_frame().get(omission.frame_id, log)
        log.reading.lose(source.primary.topic, omission.log_time_ns, omission.reason)
        log.reading.useless += 1
    else:
        log.reading.dropped[omission.reason] += 1


Places = dict[tuple[Channel[Message], str], Channel[Message]]


def _writes(stage: Stage, log: StageInput, config: Config) -> tuple[Places, tuple[str, ...]]:
    """The channels that the stage's channels become in this log, and why others are left out.

    Each is told with the frame that its messages are of, none where that does not matter.
    """
    writes, notes = Places(), dict[str, None]()
    for channel in stage.writes:
        views = (log.by_frame() if channel in stage.places else {}) or {"": log}
        topics = {
            frame: stage.places[channel](view, config) if channel in stage.places else channel.topic
            for frame, view in views.items()
        }
        for frame, topic in topics.items():
            if isinstance(topic, LeftOut):
                notes[topic.reason] = None
                continue
            # Topics of several cameras need not lie apart; below those of their images results do.
            is_alone = list(topics.values()).count(topic) == 1
            own = topic if is_alone else f"{views[frame].primary.topic}/{topic.rpartition('/')[2]}"
            writes[channel, frame] = Channel(own, channel.message)
    return writes, tuple(notes)
