"""What the verbs that run one stage over logs share: the runs themselves, notes, documents, exit codes."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from toolkit.cli.console import PARTIAL, progress, say_json, warn

if TYPE_CHECKING:
    from toolkit.runs.bundles import Span
    from toolkit.runs.pipeline import StageRun

Configured = tuple[Path | None, list[str] | None, str | None]
"""The options --config, --set and --method."""


def run_over(
    name: str,
    logs: Sequence[Path],
    output: Path,
    configured: Configured,
    files: Mapping[str, Path | None],
    span: "Span",
    results_only: bool,
) -> "list[StageRun]":
    """Run a stage over every log; `files` are the resources that options gave."""
    from toolkit.runs.config import gather, load_files
    from toolkit.runs.outputs import output_files
    from toolkit.runs.pipeline import Job, run_stage
    from toolkit.stage import Stage
    from toolkit.stages import find_stage

    stage = find_stage(name)
    assert isinstance(stage, Stage)  # noqa: S101 - a verb of a reduction does not come here
    config_file, settings, method = configured
    config, resources = load_files(stage, gather(config_file, settings or [], method), files)
    runs = []
    for log, target in output_files(logs, output).items():
        with progress(f"{name} {log.name}", log.stat().st_size if log.is_file() else None) as advance:
            runs.append(run_stage(stage, config, Job(log, target, resources, span, results_only), advance))
    return runs


def finish(
    verb: str,
    runs: "list[StageRun]",
    document: "Callable[[StageRun], dict[str, object]]",
    show: "Callable[[list[StageRun]], None]",
    json: bool,
) -> None:
    """Tell what happened, as one document or text; several logs are listed under `logs`.

    Raises:
        typer.Exit: source data was unreadable.
    """
    for run in runs:
        for note in run.notes:
            warn(f"note: {note}")
        for reason, count in run.reading.notes().items():
            warn(f"note: {run.output}: {count} {reason}")
        for loss in run.reading.losses:
            warn(f"warning: {run.output}: {loss}")
    if json:
        each = [
            {
                "output": str(run.output),
                **document(run),
                "stages": {verb: "ran"},
                "dropped": run.reading.notes(),
                "losses": run.reading.losses,
            }
            for run in runs
        ]
        say_json(verb, each[0] if len(each) == 1 else {"logs": each})
    else:
        show(runs)
    if any(run.reading.losses for run in runs):
        raise typer.Exit(PARTIAL)
