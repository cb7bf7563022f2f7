"""Convert bags and data sets to MCAP: every message that the storage declares arrives, or its loss is told."""

import contextlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mcap_landmarks.config import Settings
from mcap_landmarks.errors import ToolkitError, UsageError
from mcap_landmarks.inspection.open_logs import OpenLog, open_logs
from mcap_landmarks.locations import Location
from mcap_landmarks.progress import Progress, Watch
from mcap_landmarks.runs.conversion import Converted, Job
from mcap_landmarks.runs.conversion_inputs import ConversionInputs
from mcap_landmarks.runs.input_hashes import HashOf, input_hashes
from mcap_landmarks.runs.output_formats import OutputForm, OutputFormat, planned
from mcap_landmarks.runs.outputs import no_empty_folder
from mcap_landmarks.runs.replacing import IsEarlier, Replacing, check_apart, earlier_recording, new_files, output_to
from mcap_landmarks.runs.rosbag2_output import write_bag
from mcap_landmarks.runs.split_outputs import write_parts
from mcap_landmarks.runs.topic_selection import Selection

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
    """Convert the logs of some inputs: into the output that is named, merged by time, or one by one into that folder.

    A name with `.mcap` is that of a file, and every other one that of a folder with files; a ROS 2 bag is a folder, and
    where an input has several logs such bags lie in one. What is there is replaced if it was converted from the same
    inputs, or if it is to be overwritten; what is read `beside` the inputs is not. With `strict` a log with a topic
    that cannot be carried is refused, instead of written without it. `verb` is what the outputs say they were made by.

    Raises:
        ToolkitError: nothing could be converted; nothing is left behind.
    """
    conversion = Conversion()
    _check_once(inputs)
    with contextlib.ExitStack() as stack:
        logs = [log for place in inputs for log in stack.enter_context(open_logs(place, settings))]
        stack.enter_context(no_empty_folder(output))
        if isinstance(output, Path) and output.is_file():
            check_apart([output], [*inputs, *beside])
        plan = planned(logs, output, form)
        check_apart(plan, [*inputs, *beside])
        hash_of = stack.enter_context(input_hashes(log.path for log in logs))
        for target, group in plan.items():
            try:
                job = Job(ConversionInputs(group, selection, strict=strict, to=form.to), hash_of, form.chunks, verb)
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

    def is_earlier(path: Location) -> bool:
        return earlier_recording(verb, [hash_of(log.path) for log in logs])(path)

    return is_earlier


def _written(job: Job, target: Location, form: OutputForm, replacing: Replacing, advance: Progress) -> list[Converted]:
    if form.to is OutputFormat.ROSBAG2:
        return [write_bag(job, target, form.split, replacing, advance)]
    if form.to is OutputFormat.BAG:
        from mcap_landmarks.runs.ros1_bag import write_ros1_bag  # noqa: PLC0415 - few conversions write bags

        with new_files([target], (), overwrite=replacing.overwrite):
            return [write_ros1_bag(job, target, form.chunks, advance)]
    if form.split:
        return write_parts(job, target, form.split, replacing, advance)
    with output_to(target, (), replacing.is_earlier, overwrite=replacing.overwrite):
        return [job.run(target, advance)]
