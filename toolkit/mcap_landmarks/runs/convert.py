"""Convert bags and data sets to MCAP: every message that the storage declares arrives, or its loss is told."""

import contextlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mcap_landmarks.config import Settings
from mcap_landmarks.errors import ToolkitError, UsageError
from mcap_landmarks.inspection.open_logs import OpenLog, open_logs
from mcap_landmarks.locations import Location, to_write
from mcap_landmarks.progress import Progress, Watch
from mcap_landmarks.recording.chunk_form import ChunkForm
from mcap_landmarks.runs.conversion import Converted, Job
from mcap_landmarks.runs.conversion_inputs import ConversionInputs
from mcap_landmarks.runs.input_hashes import HashOf, input_hashes
from mcap_landmarks.runs.outputs import make_folder, no_empty_folder, output_files
from mcap_landmarks.runs.replacing import IsEarlier, Replacing, check_apart, earlier_recording, output_to
from mcap_landmarks.runs.split_outputs import write_parts
from mcap_landmarks.runs.splitting import Split
from mcap_landmarks.runs.topic_selection import Selection


@dataclass(frozen=True, slots=True)
class OutputForm:
    """How outputs are written: in parts, with chunks of another form."""

    split: Split | None = None
    chunks: ChunkForm | None = None


_OTHER_FORMATS = frozenset({".bag", ".db3"})
_PLAIN = OutputForm()


@dataclass(slots=True)
class Conversion:
    """All outputs, and what kept others from being written."""

    outputs: list[Converted] = field(default_factory=list)
    failures: list[ToolkitError] = field(default_factory=list)


def convert(
    inputs: Sequence[Location],
    output: Location,
    selection: Selection,
    settings: Settings,
    watch: Watch,
    *,
    beside: Sequence[Location] = (),
    overwrite: bool = False,
    strict: bool = False,
    verb: str = "convert",
    form: OutputForm = _PLAIN,
) -> Conversion:
    """Convert the logs of some inputs: into the file `output`, merged by time, or one by one into that folder.

    A folder is meant where an input has several logs, or where several inputs meet an `output` without `.mcap`. What is
    there is replaced if it was converted from the same inputs, or if it is to be overwritten; what is read `beside` the
    inputs is not. With `strict` a log with a topic that cannot be carried is refused, instead of written without it.
    `verb` is what the outputs say they were made by.

    Raises:
        ToolkitError: nothing could be converted; nothing is left behind.
    """
    there = to_write(output)
    conversion = Conversion()
    _check_once(inputs)
    with contextlib.ExitStack() as stack:
        logs = [log for place in inputs for log in stack.enter_context(open_logs(place, settings))]
        stack.enter_context(no_empty_folder(there))
        plan = _plan(logs, there, form)
        check_apart(plan, [*inputs, *beside])
        if there.suffix in _OTHER_FORMATS and there in plan:
            raise UsageError(f"{there}: convert writes MCAP; name the output {there.stem}.mcap, or give a folder")
        hash_of = stack.enter_context(input_hashes(log.path for log in logs))
        for target, group in plan.items():
            try:
                job = Job(ConversionInputs(group, selection, strict=strict), hash_of, form.chunks, verb)
                replacing = Replacing(_earlier(verb, group, hash_of), overwrite)
                with watch(f"{verb} to {target.name}", sum(log.size_bytes for log in group)) as advance:
                    conversion.outputs += _written(job, target, form, replacing, advance)
            except ToolkitError as error:
                conversion.failures.append(error)
        if not conversion.outputs:
            raise conversion.failures[0]
    return conversion


def _check_once(inputs: Sequence[Location]) -> None:
    for place, count in Counter(inputs).items():
        if count > 1:
            raise UsageError(f"{place} is given {count} times; name each input once")


def _earlier(verb: str, logs: Sequence[OpenLog], hash_of: HashOf) -> IsEarlier:
    """See `earlier_recording`; it waits for the hashes only where there is a file."""

    def is_earlier(path: Path) -> bool:
        return earlier_recording(verb, [hash_of(log.path) for log in logs])(path)

    return is_earlier


def _written(job: Job, target: Path, form: OutputForm, replacing: Replacing, advance: Progress) -> list[Converted]:
    if form.split:
        return write_parts(job, target, form.split, replacing, advance)
    with output_to(target, (), replacing.is_earlier, overwrite=replacing.overwrite):
        return [job.run(target, advance)]


def _plan(logs: Sequence[OpenLog], output: Path, form: OutputForm) -> dict[Path, list[OpenLog]]:
    """Which logs go into which file."""
    several = len(logs) > len({log.path for log in logs})
    if form.split and output.suffix == ".mcap":
        raise UsageError(f"{output}: a split makes several files; give -o a folder, without .mcap")
    if output.suffix == ".mcap":
        if several:
            raise UsageError(f"{output}: the input holds {len(logs)} logs; give -o a folder, without .mcap")
        plan = {next(iter(output_files([output], output).values())): list(logs)}
    else:
        names = [Path(f"{log.name}.mcap") for log in logs]
        targets = _in_folder(names, output) if several or form.split else list(output_files(names, output).values())
        plan = {target: [log] for target, log in zip(targets, logs, strict=True)}
    return plan


def _in_folder(names: Sequence[Path], folder: Path) -> list[Path]:
    """One file per log of inputs that hold several."""
    make_folder(folder)
    targets = [folder / name for name in names]
    if len(set(targets)) < len(targets):
        raise UsageError(f"{folder}: two inputs would write {targets[-1].name}; convert them into two folders")
    return targets
