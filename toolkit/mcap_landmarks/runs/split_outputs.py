"""A log in parts, each a recording of its own: NAME_0.mcap, NAME_1.mcap and so on."""

import re
from pathlib import Path

from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, files_in, remove
from mcap_landmarks.progress import Progress
from mcap_landmarks.runs.conversion import Converted, Job, NoMessagesError
from mcap_landmarks.runs.replacing import Replacing, output_to
from mcap_landmarks.runs.splitting import Split, cuts, spans


def write_parts(
    job: Job, target: Location, split: Split | None, replacing: Replacing, advance: Progress
) -> list[Converted]:
    """Write the parts of what would be one output, or without a `split` the only one.

    Each begins with what holds then, as a cut does.

    Raises:
        NoMessagesError: there is no message.
        RecordingError, UsageError: an output cannot be written, or there are files from another split.
    """
    times = cuts(split, job.inputs.stretches(by_message=split.count is not None)) if split else []
    parts: list[Converted] = []
    for number, span in enumerate(spans(*job.inputs.selection.span, times)):
        path = target.with_name(f"{target.stem}_{len(parts)}{target.suffix}")
        is_last = number == len(times)
        try:
            with output_to(path, (), replacing.is_earlier, overwrite=replacing.overwrite):
                parts.append(job.write(path, span, advance, is_last=is_last))
        except NoMessagesError:  # where a chunk tells of more time than its messages
            if is_last and not parts:
                raise
            if is_last:
                job.account(parts[-1])
    _remove_rest(target, len(parts), replacing)
    return parts


def _remove_rest(target: Location, count: int, replacing: Replacing) -> None:
    """Remove what an earlier split into more parts left.

    Raises:
        UsageError: it is of something else.
    """
    name = re.compile(rf"{re.escape(target.stem)}_(\d+)\.mcap")
    for path in files_in(target.parent if isinstance(target, Path) else target.with_name("")):
        found = name.fullmatch(path.name)
        if found and int(found[1]) >= count and path == target.with_name(path.name):
            if not replacing.overwrite and not replacing.is_earlier(path):
                raise UsageError(f"{path} is no part of this log; split it into another folder, or give --overwrite")
            remove(path)
