"""Write a result for other tools: its trajectory, all of it for Rerun, or its boxes as a dataset of COCO."""

import json as json_text
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import PARTIAL, progress, say, say_json, warn
from mcap_landmarks.cli.option_groups import reading_logs
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, address, files_in, is_there, location, size_of
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
    chosen = form.lower()
    _check(chosen, topic, child, images)
    if chosen == _RERUN:
        done = _rerun(result, output, overwrite=overwrite)
    elif chosen == _COCO:
        done = _coco(result, output, topic, images, overwrite=overwrite)
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


def _rerun(result: Location, output: Location, *, overwrite: bool) -> _Exported:
    from importlib.util import find_spec

    from mcap_landmarks.atomic import atomic_path
    from mcap_landmarks.errors import ToolkitError

    if output.suffix.lower() != ".rrd":
        raise UsageError(f"{output}: Rerun opens files by their names; use .rrd")
    if find_spec("rerun") is None:
        raise ToolkitError("rerun-sdk, which writes .rrd, is not installed; pip install 'mcap-landmarks[rerun]'")
    from mcap_landmarks.recording.reader import open_recording
    from mcap_landmarks.report.rerun_log import write_rerun
    from mcap_landmarks.runs.replacing import carries, output_to

    with open_recording(result) as recording:
        of_log = carries(recording.fingerprint())  # which is the id of what Rerun shows
    with (
        output_to(output, [result], of_log, overwrite=overwrite),
        atomic_path(output) as target,
        progress(f"read {result.name}", size_of(result) or None) as advance,
    ):
        made = write_rerun(result, target, advance)
    line = f"{counted(sum(made.rows.values()), 'row')} of {len(made.rows)} entities"
    return _Exported(line, {"entities": dict(made.rows)}, (), made.losses)


def _coco(
    result: Location, output: Location, topic: str | None, images: Location | None, *, overwrite: bool
) -> _Exported:
    from contextlib import ExitStack

    from mcap_landmarks.atomic import atomic_file, atomic_folder
    from mcap_landmarks.report.coco_dataset import images_of, read_coco
    from mcap_landmarks.runs.replacing import carries, output_to, picture_mark

    mark = picture_mark("export", [result])
    is_earlier = carries(mark)
    with ExitStack() as stack:
        stack.enter_context(output_to(output, [result], is_earlier, overwrite=overwrite))
        if images is not None:
            _check_beside(output, images)
            named = images_of(output) if is_there(output) and is_earlier(output) else frozenset()
            stack.enter_context(output_to(images, [result], _only(named), overwrite=overwrite, is_folder=True))
        # Both appear at the end, one right after the other: who stops before has neither.
        stream = stack.enter_context(atomic_file(output))
        place = stack.enter_context(atomic_folder(images)) if images is not None else None
        with progress(f"read {result.name}", size_of(result) or None) as advance:
            found = read_coco(result, topic, place, advance, mark)
        stream.write((json_text.dumps(found.document, indent=1) + "\n").encode())
    counts = dict(found.counts)
    line = f"{counts['annotations']} boxes of {found.topic} in {counted(counts['images'], 'image')}"
    told = {"topic": found.topic, **counts, "left_out": dict(found.left_out)}
    notes = tuple(f"{reason}: {count}, left out" for reason, count in found.left_out.items())
    return _Exported(line, told, notes, found.losses)


def _check_beside(output: Location, images: Location) -> None:
    if f"{address(output)}/".startswith(f"{address(images)}/"):
        raise UsageError(f"{output} lies in {images}, which is replaced as a whole; name a file beside that folder")


def _only(names: Collection[str]) -> Callable[[Location], bool]:
    """Says of a folder whether it has none but files of these names."""
    return lambda folder: {place.name for place in files_in(folder)} <= set(names)
