"""What the verbs that run stages over logs share: the runs themselves, notes, documents, exit codes."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import typer

from mcap_landmarks.cli.console import PARTIAL, progress, say_json, warn
from mcap_landmarks.cli.option_groups import ImageOptions, LogOptions, ScanOptions, SegmentOptions
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location
from mcap_landmarks.wording import tallied

if TYPE_CHECKING:
    from mcap_landmarks.runs.pipeline import LogRun
    from mcap_landmarks.runs.plan import Request
    from mcap_landmarks.runs.segment_tasks import Segments
    from mcap_landmarks.runs.session import StageRun


@dataclass(frozen=True, slots=True)
class Given:
    """What the options of a verb say about all its logs; `files` are those beside the model, by resource name.

    `use` names the stages to use where several could make what a log lacks, `settings` are those that the verb's own
    options stand for.
    """

    options: LogOptions
    images: ImageOptions = field(default_factory=ImageOptions)
    scans: ScanOptions = field(default_factory=ScanOptions)
    files: Mapping[str, Location | None] = field(default_factory=dict)
    use: Sequence[str] | None = None
    settings: Sequence[str] = ()
    segments: SegmentOptions = field(default_factory=SegmentOptions)

    def requests(self, logs: Sequence[Location]) -> "list[Request]":
        """What to do with each log.

        Raises:
            UsageError: an option cannot be read, or a setting is wrong.
        """
        from mcap_landmarks.runs.run_options import RunOptions

        given, images, scans = self.options, self.images, self.scans
        segments = _segments(self.segments)
        requests = RunOptions(
            given.config_file,
            [*(given.settings or []), *self.settings],
            given.method,
            given.start,
            given.end,
            given.remap or (),
            given.time_offset or (),
            given.odom,
            images.image or (),
            images.image_rate,
            images.every,
            scans.scan or (),
            scans.scan_from,
            scans.heights,
            {"model": images.model, **self.files},
            self.use or (),
            results_only=given.results_only,
            force=given.force,
            overwrite=given.overwrite,
        ).requests(logs)
        return [replace(request, segments=segments) for request in requests]


def _segments(given: SegmentOptions) -> "Segments | None":
    """Who makes segments, if any are wanted.

    Raises:
        UsageError: the options make no sense.
    """
    if given.segments is None:
        if given.workers is not None:
            raise UsageError("--workers takes --segments SECONDS, which says where a log is cut")
        return None
    from mcap_landmarks.cli.main import run
    from mcap_landmarks.fleet.local_workers import LocalWorkers
    from mcap_landmarks.fleet.segment_workers import segments_over

    count = given.workers or len(os.sched_getaffinity(0))
    return segments_over(LocalWorkers(count, run), given.segments)


def run_over(
    verb: str, names: Sequence[str], logs: Sequence[Location], output: Location, given: Given, *, lacking: bool = False
) -> "list[LogRun]":
    """Run stages over every log; `lacking` puts those before them that a log still lacks."""
    from mcap_landmarks.runs.pipeline import run_logs

    return run_logs(given.requests(logs), output, names, verb, progress, lacking=lacking)


def finish(
    verb: str,
    runs: "list[LogRun]",
    document: "Callable[[LogRun], dict[str, object]]",
    show: "Callable[[list[LogRun]], None]",
    json: bool,
) -> None:
    """Tell what happened, as one document or text; several logs are listed under `logs`.

    Raises:
        typer.Exit: source data was unreadable.
    """
    for run in runs:
        tell(run.output, run.stages, run.notes, run.losses)
    if json:
        each = [
            {"output": str(run.output), **document(run), **told(run.stages), "losses": list(run.losses)} for run in runs
        ]
        say_json(verb, each[0] if len(each) == 1 else {"logs": each})
    else:
        show(runs)
    if any(run.losses for run in runs):
        raise typer.Exit(PARTIAL)


def tell(path: Location, stages: "Sequence[StageRun]", notes: Sequence[str], losses: Sequence[str]) -> None:
    """What every stage did and why, what was left out and what was lost, on stderr."""
    for run in stages:
        warn(f"{path}: {run.stage} {run.state}: {run.reason}")
    for note in notes:
        warn(f"note: {path}: {note}")
    for reason, count in dropped(stages).items():
        warn(f"note: {path}: {tallied(count, reason)}")
    for loss in losses:
        warn(f"warning: {path}: {loss}")


def told(stages: "Sequence[StageRun]") -> dict[str, object]:
    """The part of a document that says what every stage did, and what was left out."""
    return {
        "stages": {run.stage: run.state for run in stages},
        "reasons": {run.stage: run.reason for run in stages},
        "seconds": {run.stage: round(run.seconds, 3) for run in stages if run.seconds is not None},
        "dropped": dropped(stages),
    }


def dropped(stages: "Sequence[StageRun]") -> dict[str, int]:
    """What stages left out by rule, in words, with its count; what an earlier stage than the last did names it."""
    found: dict[str, int] = {}
    for run in stages:
        of_stage = "" if run is stages[-1] else f" ({run.stage})"
        found.update({f"{reason}{of_stage}": count for reason, count in run.outcome.dropped.items()})
    return found
