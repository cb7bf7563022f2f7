"""One long log in segments: workers make the results of each, which are then joined to those of the whole.

A segment is a part of the log between two fixed log times. Its file lies among the unfinished parts of the output and
is taken again after an interruption. What is joined is to the last byte what one process makes of the whole log:
results are the same by bundle, their sequence numbers go on from segment to segment, and losses and counts add up.
"""

import contextlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.manifest import RUN, Manifest, StageRecord
from mcap_landmarks.progress import Progress, Watch
from mcap_landmarks.recording.reader import Recording, open_recording
from mcap_landmarks.recording.writer import RecordingWriter, create_recording
from mcap_landmarks.runs.bundles import Reading
from mcap_landmarks.runs.plan import Request, Step
from mcap_landmarks.runs.segment_jobs import SegmentJob
from mcap_landmarks.runs.segment_tasks import SegmentTask
from mcap_landmarks.runs.stage_input import StageInput
from mcap_landmarks.runs.stage_runner import record_with_outcome, run_stage, write_results
from mcap_landmarks.stage import Connection

ACCOUNT = "mcap-landmarks.segment"
"""Name of the metadata record that tells what a segment was made from, and what became of its messages."""
_KEY, _BUNDLES, _USELESS, _COUNTS, _DROPPED = "key", "bundles", "useless", "counts", "dropped"
_LOST, _DAMAGE = "lost", "damage"


def run_in_segments(step: Step, log: StageInput, request: Request, target: Path, progress: Progress) -> StageRecord:
    """`run_stage` with workers, as `request.segments` has it; raises the same."""
    tasks = _tasks(step, log, request, target)
    if len(tasks) < 2 or request.segments is None:
        return run_stage(step, log, request, target, progress)
    left = []
    for task in tasks:
        account = _account(task.target, step.record.key)
        if account is None:
            left.append(task)
        else:
            progress(account[_BUNDLES])
    for task in request.segments.run(left):
        account = _account(task.target, step.record.key)
        if account is None:
            raise RecordingError(f"{task.target}: a worker did not write it; run the command again")
        progress(account[_BUNDLES])
    record = _joined(step, log, [task.target for task in tasks], target)
    for task in tasks:
        task.target.unlink(missing_ok=True)
    return record


def _tasks(step: Step, log: StageInput, request: Request, target: Path) -> list[SegmentTask]:
    """The segments of a log."""
    times = log.times_ns()
    if times is None or request.segments is None:
        return []
    bounds = request.segments.bounds(*times)
    thinned: Sequence[Mapping[str, Any] | None] = [None] * len(bounds)
    if request.thinning.options() and len(bounds) > 1:
        thinned = log.thinned_before(request.thinning, [start_ns for start_ns, _ in bounds])
    tasks = []
    for (start_ns, end_ns), state in zip(bounds, thinned, strict=True):
        name = f"{target.stem}.{start_ns}-{end_ns}{target.suffix}"
        start, end = log.within(start_ns, end_ns)
        job = SegmentJob(request, step.stage.name, step.record.key, start, end, state)
        tasks.append(SegmentTask(request.recording, target.with_name(name), job.text()))
    return tasks


def write_segment(job: SegmentJob, step: Step, log: StageInput, target: Path, watch: Watch) -> None:
    """Make the results of one segment; `log` is that part of the log.

    Raises:
        ToolkitError: as `run_stage`.
    """
    stage = step.stage
    if stage.in_segments is None:
        raise UsageError(f"{stage.name} cannot be run in segments")
    alone = replace(step, config=stage.in_segments(step.config))
    with create_recording(target, is_passing=True) as writer, watch(stage.name, log.count, "bundles") as progress:
        asked = job.request.thinning
        bundles = log.bundles(progress, asked, job.thinned) if stage.thinned else log.bundles(progress)
        counts = write_results(alone, log, bundles, writer)
        writer.metadata[ACCOUNT] = {"account": json.dumps(_told(job.key, log, counts), sort_keys=True)}


def _told(key: str, log: StageInput, counts: Mapping[str, int]) -> dict[str, object]:
    """What became of a segment's messages; `_read` puts it together again."""
    reading = log.reading
    # The first loss of every topic is told in full, in this order; those after are counted.
    lost = [
        [topic, count, loss] for (topic, count), loss in zip(reading.unreadable.items(), reading.losses, strict=True)
    ]
    return {
        _KEY: key,
        _BUNDLES: reading.association.bundles,
        _USELESS: reading.useless,
        _COUNTS: dict(counts),
        _DROPPED: dict(reading.dropped),
        _LOST: lost,
        _DAMAGE: log.damage(),
    }


def _account(path: Path, key: str) -> dict[str, Any] | None:
    """What a segment's file tells, None if there is none of these results."""
    if not path.is_file():
        return None
    with contextlib.suppress(RecordingError, ValueError), open_recording(path) as part:
        account: dict[str, Any] = json.loads(part.metadata.get(ACCOUNT, {}).get("account", "{}"))
        if account.get(_KEY) == key and not part.losses:
            return account
    return None


def _joined(step: Step, log: StageInput, parts: Sequence[Path], target: Path) -> StageRecord:
    """Write the results of all segments, in their order, as those of the whole log.

    Results are small beside what they were made from, and their sequence numbers have to go on: messages are copied,
    which makes the chunks of one process, where whole chunks would keep those of many.
    """
    counts, damage = Counter[str](), dict[str, None]()
    with create_recording(target, is_passing=True) as writer:
        connections = dict[str, Connection]()
        for path in parts:
            with open_recording(path) as part:
                account = json.loads(part.metadata[ACCOUNT]["account"])
                _read(account, log.reading)
                counts.update(account[_COUNTS])
                damage.update(dict.fromkeys(account[_DAMAGE]))
                _copy(part, writer, connections)
        record = record_with_outcome(step, log, counts, [*damage])
        writer.metadata[RUN] = Manifest("part", fingerprint=record.key, stages=(record,)).entries()
    return record


def _copy(part: Recording, writer: RecordingWriter, connections: dict[str, Connection]) -> None:
    """Write a segment's messages behind those of the segments before."""
    for raw in part.messages():
        own = connections.setdefault(raw.connection.topic, raw.connection)
        writer.write(raw._replace(connection=own, sequence=writer.counts.get(own.topic, 0)))


def _read(account: Mapping[str, Any], reading: Reading) -> None:
    """Add what became of a segment's messages."""
    reading.association.bundles += account[_BUNDLES]
    reading.useless += account[_USELESS]
    reading.dropped.update(account[_DROPPED])
    for topic, count, loss in account[_LOST]:
        if topic not in reading.unreadable:
            reading.losses.append(loss)
        reading.unreadable[topic] += count
