"""Say what changed between two runs: two logs with results, two maps, two folders of logs, or two catalogues."""

from typing import TYPE_CHECKING

import typer

from mcap_landmarks.cli import diff_options, options
from mcap_landmarks.cli.console import DONE, USAGE, progress, say_json
from mcap_landmarks.cli.diff_drives import print_drives
from mcap_landmarks.cli.diff_options import SetOptions
from mcap_landmarks.cli.diff_sets import diff_folders
from mcap_landmarks.cli.diff_text import DIFFERENT, print_diff, warn_losses, warn_of
from mcap_landmarks.cli.option_groups import reading_logs
from mcap_landmarks.errors import ToolkitError, UsageError
from mcap_landmarks.locations import Location, check_there, size_of

if TYPE_CHECKING:
    from collections.abc import Sequence


@reading_logs
def command(
    baseline: diff_options.Baseline,
    candidate: diff_options.Candidate = None,
    tolerance: diff_options.Tolerance = None,
    fail_on: diff_options.FailOn = None,
    reference: diff_options.Truth = None,
    align: diff_options.Align = False,
    drives: diff_options.Drives = None,
    sets: SetOptions = SetOptions(),  # noqa: B008 - spread out into its options
    json: options.Json = False,
) -> None:
    """Say what changed from BASELINE to CANDIDATE. Exit code 0: the same, 1: different, 2: an error.

    Messages are paired by channel and time stamp, detections by overlap and class, objects and landmarks by position
    and class. What the manifests say was meant to differ does not count as a difference.

    Of two folders, or catalogues of a batch, logs are paired by what was recorded, then by name, and every metric gets
    a verdict over all pairs: same, better, worse, or inconclusive. Exit code 0: nothing that gates got worse, 1: it
    did, 2: an error, also where a log could not be compared. Two drives are compared by rates, distributions, classes,
    landmarks and errors.
    """
    for place in filter(None, (baseline, candidate, reference)):
        check_there(place)
    sets.check_places()
    before, after = _sides(baseline, candidate, sets)
    try:
        from mcap_landmarks.diff.set_logs import is_set

        if sets.blessed is not None or is_set(before) or is_set(after):
            if any((tolerance, align, drives is not None)):
                raise UsageError("--tolerance, --align and --drives are of two files; folders have --criteria")
            code = diff_folders(before, after, sets, fail_on or [], reference, json=json)
        else:
            sets.refuse_for_files()
            files = before, after, tolerance or [], fail_on or [], reference
            code = _diff_files(*files, aligned=align, json=json, drives=drives)
    except ToolkitError as error:
        raise UsageError(str(error)) from error  # 1 means different, so that every error is 2
    raise typer.Exit(code)


def _sides(baseline: Location, candidate: Location | None, sets: SetOptions) -> tuple[Location, Location]:
    if sets.blessed is None:
        if candidate is None:
            raise UsageError(f"{baseline}: compared with what? name BASELINE and CANDIDATE, or give --baseline DIR")
        return baseline, candidate
    if candidate is not None:
        raise UsageError(f"--baseline {sets.blessed} takes the place of {baseline}; name the candidate alone")
    return sets.blessed, baseline


def _are_drives(baseline: Location, candidate: Location, asked: bool | None) -> bool:
    from mcap_landmarks.diff.two_drives import are_two_drives
    from mcap_landmarks.evaluation.read import is_database
    from mcap_landmarks.recording.reader import open_recording

    if is_database(baseline) or is_database(candidate):
        if asked:
            raise UsageError("--drives is of two logs; maps are compared as they are")
        return False
    if asked is not None:
        return asked
    with open_recording(baseline) as mine, open_recording(candidate) as theirs:
        return are_two_drives(mine, theirs)


def _diff_drives(
    baseline: Location,
    candidate: Location,
    tolerances: "Sequence[str]",
    fail_on: "Sequence[str]",
    reference: Location | None,
    *,
    json: bool,
) -> int:
    from mcap_landmarks.diff.conditions import parse
    from mcap_landmarks.diff.drives import diff_drives

    if tolerances:
        raise UsageError("--tolerance is of messages that both have, and these are two drives; see --no-drives")
    conditions = [parse(text) for text in fail_on]
    with progress("compare", size_of(baseline) + size_of(candidate)) as advance:
        found = diff_drives(baseline, candidate, conditions, reference=reference, progress=advance)
    if json:
        say_json("diff_drives", found.document)
    else:
        print_drives(found.document)
    warn_losses(found.losses)
    if found.losses:
        return USAGE
    return DIFFERENT if found.fails else DONE


def _diff_files(
    baseline: Location,
    candidate: Location,
    tolerances: "Sequence[str]",
    fail_on: "Sequence[str]",
    reference: Location | None,
    *,
    aligned: bool,
    json: bool,
    drives: bool | None,
) -> int:
    from mcap_landmarks.diff.comparison import diff
    from mcap_landmarks.diff.conditions import parse

    if _are_drives(baseline, candidate, drives):
        return _diff_drives(baseline, candidate, tolerances, fail_on, reference, json=json)
    conditions = [parse(text) for text in fail_on]
    with progress("compare", size_of(baseline) + size_of(candidate)) as advance:
        found = diff(
            baseline, candidate, tolerances, conditions, reference=reference, aligned=aligned, progress=advance
        )
    if json:
        say_json("diff", found.document)
    else:
        print_diff(found.document)
    warn_of(found)
    if found.losses:
        return USAGE
    return DIFFERENT if found.fails else DONE
