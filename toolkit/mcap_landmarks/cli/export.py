"""Write a result for other tools: its trajectory, all of it for Rerun, or its boxes as a dataset of COCO."""

import json as json_text
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import PARTIAL, progress, say, say_json, warn
from mcap_landmarks.cli.option_groups import reading_logs
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, location, size_of
from mcap_landmarks.wording import counted

_RERUN, _COCO = "rerun", "coco"


@dataclass(frozen=True, slots=True)
class _Exported:
    """What was written, in a line and as values for --json, and what is to be said beside it."""

    line: str
    told: Mapping[str, object]
    notes: tuple[str, ...]
    losses: tuple[str, ...]


@reading_logs
def command(
    result: Annotated[Location, typer.Argument(metavar="RESULT", parser=location, help="A log with poses or boxes.")],
    output: options.Output,
    form: Annotated[str, typer.Option("--format", metavar="tum|kitti|csv|json|rerun|coco", help="How to write it.")],
    topic: Annotated[
        str | None,
        typer.Option(
            "--topic",
            help="PoseStamped, PoseWithCovarianceStamped, Odometry or transforms. Default: what localize "
            "found, else what map found, else the truth, else odometry, else the poses of others. For coco "
            "Detection2DArray: what detect found, else the truth.",
        ),
    ] = None,
    child: Annotated[
        str | None, typer.Option("--child", metavar="FRAME", help="Of transforms, those to this frame.")
    ] = None,
    images: Annotated[
        Location | None,
        typer.Option("--images", metavar="FOLDER", parser=location, help="For coco, where to write the images, too."),
    ] = None,
    overwrite: options.Overwrite = False,
    json: options.Json = False,
) -> None:
    """Write the poses of a topic of RESULT in the plane, everything for Rerun's viewer, or boxes as COCO has them."""
    from mcap_landmarks.runs.replacing import new_files

    chosen = form.lower()
    _check(chosen, topic, child, images)
    if chosen in {_RERUN, _COCO}:
        with new_files([output], [result], overwrite=overwrite):
            is_rerun = chosen == _RERUN
            done = _rerun(result, output) if is_rerun else _coco(result, output, topic, images, overwrite=overwrite)
    else:
        done = _trajectory(result, output, chosen, topic, child, overwrite=overwrite)
    if json:
        say_json("export", {"output": str(output), "format": chosen, **done.told, "losses": list(done.losses)})
    for note in done.notes:
        warn(f"note: {result}: {note}")
    if not json:
        say(f"{output}: {done.line}")
    for loss in done.losses:
        warn(f"warning: {result}: {loss}")
    if done.losses:
        raise typer.Exit(PARTIAL)


def _check(form: str, topic: str | None, child: str | None, images: Location | None) -> None:
    """Refuse what is no format, and options that it does not heed.

    Raises:
        UsageError: as it says.
    """
    from mcap_landmarks.evaluation.export import TrajectoryFormat

    forms = [*TrajectoryFormat, _RERUN, _COCO]
    if form not in forms:
        raise UsageError(f"--format {form}: choose {', '.join(forms)}")
    for option, value, heeding in (
        ("--topic", topic, [*TrajectoryFormat, _COCO]),
        ("--child", child, [*TrajectoryFormat]),
        ("--images", images, [_COCO]),
    ):
        if value is not None and form not in heeding:
            raise UsageError(f"{option} is not for --format {form}; leave it out, or use {', '.join(heeding)}")


def _trajectory(
    result: Location, output: Location, form: str, topic: str | None, child: str | None, *, overwrite: bool
) -> _Exported:
    from mcap_landmarks.atomic import atomic_file
    from mcap_landmarks.evaluation.export import TrajectoryFormat, render
    from mcap_landmarks.evaluation.pose_topics import read_poses
    from mcap_landmarks.runs.replacing import consists_of, output_to

    with progress(f"read {result.name}", size_of(result) or None) as advance:
        track = read_poses(result, topic, child, advance)
    text, notes = render(track, TrajectoryFormat(form))
    content = text.encode()
    with output_to(output, [result], consists_of(content), overwrite=overwrite), atomic_file(output) as stream:
        stream.write(content)
    if topic is None and track.others:
        others = ", ".join(track.others)
        notes = [*notes, f"{track.topic} is taken; --topic chooses another: {others}"]
    count = len(track.trajectory)
    line = f"{counted(count, 'pose')} of {track.topic} in frame {track.frame or '(none named)'}"
    told = {"topic": track.topic, "frame": track.frame, "poses": count}
    return _Exported(line, told, (*track.notes, *notes), tuple(track.losses))


def _rerun(result: Location, output: Location) -> _Exported:
    from importlib.util import find_spec

    from mcap_landmarks.atomic import atomic_path
    from mcap_landmarks.errors import ToolkitError

    if output.suffix.lower() != ".rrd":
        raise UsageError(f"{output}: Rerun opens files by their names; use .rrd")
    if find_spec("rerun") is None:
        raise ToolkitError("rerun-sdk, which writes .rrd, is not installed; pip install 'mcap-landmarks[rerun]'")
    from mcap_landmarks.report.rerun_log import write_rerun

    with atomic_path(output) as target, progress(f"read {result.name}", size_of(result) or None) as advance:
        made = write_rerun(result, target, advance)
    line = f"{counted(sum(made.rows.values()), 'row')} of {len(made.rows)} entities"
    return _Exported(line, {"entities": dict(made.rows)}, (), made.losses)


def _coco(
    result: Location, output: Location, topic: str | None, images: Location | None, *, overwrite: bool
) -> _Exported:
    from contextlib import ExitStack

    from mcap_landmarks.atomic import atomic_file
    from mcap_landmarks.report.coco_dataset import read_coco
    from mcap_landmarks.runs.replacing import output_to

    with ExitStack() as stack:
        if images is not None:
            kept = output_to(images, [result], lambda _path: False, overwrite=overwrite, is_folder=True)
            stack.enter_context(kept)
        with progress(f"read {result.name}", size_of(result) or None) as advance:
            found = read_coco(result, topic, images, advance)
        with atomic_file(output) as stream:
            stream.write((json_text.dumps(found.document, indent=1) + "\n").encode())
    counts = {name: len(entries) for name, entries in found.document.items()}
    line = f"{counts['annotations']} boxes of {found.topic} in {counted(counts['images'], 'image')}"
    told = {"topic": found.topic, **counts, "left_out": dict(found.left_out)}
    notes = tuple(f"{reason}: {count}, left out" for reason, count in found.left_out.items())
    return _Exported(line, told, notes, found.losses)
