"""What the verbs do, to be called: run, map, localize, evaluate and diff."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import TypedDict, Unpack

from mcap_landmarks.api.arguments import AnyPath, Moment, maybe_place, moment_text, pairs, place, places, tell, texts
from mcap_landmarks.api.parameter_names import naming_parameters
from mcap_landmarks.api.pose_errors import EvaluationResult
from mcap_landmarks.atomic import check_target
from mcap_landmarks.diff.comparison import Diff
from mcap_landmarks.diff.comparison import diff as compare
from mcap_landmarks.diff.conditions import parse
from mcap_landmarks.diff.criteria import read_criteria
from mcap_landmarks.diff.drives import DriveDiff
from mcap_landmarks.diff.drives import diff_drives as compare_drives
from mcap_landmarks.diff.set_document import SetDocument
from mcap_landmarks.diff.set_logs import is_set
from mcap_landmarks.diff.sets import diff_sets
from mcap_landmarks.errors import UsageError
from mcap_landmarks.evaluation.evaluate import Association, evaluate_file, pairing_by
from mcap_landmarks.recording.reader import reading_from_front
from mcap_landmarks.runs.build_map import build_map_of
from mcap_landmarks.runs.config_text import toml_value
from mcap_landmarks.runs.map_results import MapRun
from mcap_landmarks.runs.pipeline import LogRun, run_logs
from mcap_landmarks.runs.run_options import RunOptions


class Options(TypedDict, total=False):
    """The options that `run`, `build_map` and `localize` share: those of the command line, by their names there.

    `settings` are keys such as `localize.max_sigma_m` with their values, `heights` is `--slice`.
    """

    config: AnyPath
    settings: Mapping[str, object]
    method: str
    start: Moment
    end: Moment
    remap: Mapping[str, str]
    time_offset: Mapping[str, float]
    odom: str
    image: str | Sequence[str]
    image_rate: float
    every: str
    scan: str | Sequence[str]
    scan_from: str
    heights: tuple[float, float]
    model: AnyPath
    names: AnyPath
    extrinsics: AnyPath
    use: str | Sequence[str]
    results_only: bool
    force: bool
    overwrite: bool
    lenient: bool


@naming_parameters()
def run(
    log: AnyPath,
    stages: str | Sequence[str],
    output: AnyPath,
    *,
    map_file: AnyPath | None = None,
    **options: Unpack[Options],
) -> LogRun:
    """Run exactly these stages over a log; write the log with the results of all stages, earlier ones included.

    What could not be read is told by a `LossWarning`, and listed in `losses`.

    Raises:
        ToolkitError: input or output cannot be used; of the output nothing is left behind.
    """
    return _run("run", log, texts(stages), output, map_file, options)


@naming_parameters()
def localize(
    log: AnyPath, map_file: AnyPath, output: AnyPath, *, fixed: bool = False, **options: Unpack[Options]
) -> LogRun:
    """Localize every bundle of a log in a landmark map; write the log with poses and matches.

    Where the log has no scene objects they are made first, from images and scans. `fixed` leaves out what may stand
    elsewhere another day. For the rest see `run`.
    """
    asked = _with(options, {"localize.fixed": True} if fixed else {})
    return _run("localize", log, ["localize"], output, map_file, asked, lacking=True)


@naming_parameters()
def build_map(
    logs: AnyPath | Sequence[AnyPath],
    map_file: AnyPath,
    *,
    output: AnyPath | None = None,
    prior: AnyPath | None = None,
    fixed: bool = False,
    **options: Unpack[Options],
) -> MapRun:
    """Build one landmark map of logs, its `landmark_map`, as a database; with `output` also write the logs' results.

    `prior` is a database to extend. For the rest see `localize`.
    """
    database, target = check_target(place(map_file, "map_file")), maybe_place(output, "output")
    asked = _with(options, {"build_map.fixed": True} if fixed else {})
    with _reading(asked):
        found = build_map_of(
            _options(asked, None).requests(places(logs, "logs")), database, target, maybe_place(prior, "prior")
        )
    for log in found.logs:
        left_out = [f"left out of the map: {log.excluded}"] if log.excluded else []
        tell(log.recording, [*log.outcome.losses, *left_out])
    return found


@naming_parameters()
def evaluate(
    result: AnyPath,
    *,
    reference: AnyPath | None = None,
    align: bool = False,
    association: Association = "interpolate",
    max_gap: float = 0.5,
    lenient: bool = False,
) -> EvaluationResult:
    """Measure a log with results, or a map, against the truth: its own, or that of `reference`.

    `align` moves the poses by the one SE(2) that fits them best. The truth is interpolated over gaps of up to `max_gap`
    seconds, or its nearest pose within 10 ms is taken.

    Raises:
        RecordingError: a file cannot be read, or holds no results.
        UsageError: there is no truth, or the poses cannot be aligned.
    """
    with reading_from_front() if lenient else nullcontext():
        found = evaluate_file(
            place(result, "result"),
            maybe_place(reference, "reference"),
            pairing_by(association, max_gap),
            aligned=align,
        )
    tell(place(result, "result"), found.losses)
    return EvaluationResult.of(found, aligned=align)


@naming_parameters()
def diff(
    baseline: AnyPath,
    candidate: AnyPath,
    *,
    tolerance: Mapping[str, str | float] | None = None,
    fail_on: str | Sequence[str] | None = None,
    reference: AnyPath | None = None,
    align: bool = False,
    lenient: bool = False,
) -> Diff:
    """What changed from one log with results, or map, to another; `document` is that of `diff --json`.

    `tolerance` has `CHANNEL.FIELD` with how far it may differ, such as 0.01 or "1%". `fails` says whether a condition
    of `fail_on` holds, or without any whether anything differs. `align` moves the candidate's map.

    Raises:
        ToolkitError: a file cannot be read, they cannot be compared, or a tolerance or condition is wrong.
    """
    conditions = [parse(text) for text in texts(fail_on)]
    sides, truth = (place(baseline, "baseline"), place(candidate, "candidate")), maybe_place(reference, "reference")
    for side in sides:
        if is_set(side):
            raise UsageError(f"{side} holds several logs; compare such with diff_folders")
    with reading_from_front() if lenient else nullcontext():
        found = compare(*sides, pairs(tolerance, "tolerance"), conditions, reference=truth, aligned=align)
    tell(place(candidate, "candidate"), found.losses)
    return found


@naming_parameters()
def diff_folders(
    baseline: AnyPath,
    candidate: AnyPath,
    *,
    criteria: AnyPath | None = None,
    fail_on: str | Sequence[str] | None = None,
    reference: AnyPath | None = None,
) -> SetDocument:
    """What changed between two folders or catalogues of results, a verdict for each metric: that of `diff --json`.

    Logs are paired by recording, else by name; either folder may hold what was blessed. `criteria` is a TOML file.

    Raises:
        ToolkitError: no log is in both, or a file cannot be read.
    """
    rules = None if criteria is None else read_criteria(place(criteria, "criteria"))
    conditions = [parse(text) for text in texts(fail_on)]
    return diff_sets(
        place(baseline, "baseline"),
        place(candidate, "candidate"),
        rules,
        conditions,
        reference=maybe_place(reference, "reference"),
    )


@naming_parameters()
def diff_drives(
    baseline: AnyPath,
    candidate: AnyPath,
    *,
    fail_on: str | Sequence[str] | None = None,
    reference: AnyPath | None = None,
) -> DriveDiff:
    """How the results of two drives differ, by rates, gaps, distributions, classes, landmarks and errors.

    Raises:
        ToolkitError: a file cannot be read, or a condition is wrong.
    """
    conditions = [parse(text) for text in texts(fail_on)]
    found = compare_drives(
        place(baseline, "baseline"),
        place(candidate, "candidate"),
        conditions,
        reference=maybe_place(reference, "reference"),
    )
    tell(place(candidate, "candidate"), found.losses)
    return found


def _run(
    verb: str,
    log: AnyPath,
    stages: Sequence[str],
    output: AnyPath,
    map_file: AnyPath | None,
    options: Options,
    *,
    lacking: bool = False,
) -> LogRun:
    if not stages:
        raise UsageError("no stage is named; name for example detect, cluster and fuse")
    with _reading(options):
        requests = _options(options, map_file).requests([place(log, "log")])
        (found,) = run_logs(requests, place(output, "output"), stages, verb, lacking=lacking)
    tell(found.recording, found.losses)
    return found


def _reading(options: Options) -> AbstractContextManager[None]:
    return reading_from_front() if options.get("lenient") else nullcontext()


def _with(options: Options, settings: Mapping[str, object]) -> Options:
    """The options with settings over theirs."""
    return {**options, "settings": {**options.get("settings", {}), **settings}}


def _options(given: Options, map_file: AnyPath | None) -> RunOptions:
    unknown = sorted(given.keys() - Options.__annotations__.keys())
    if unknown:
        raise TypeError(f"{unknown[0]} is no option; there are {', '.join(sorted(Options.__annotations__))}")
    own = {"model": given.get("model"), "names": given.get("names"), "extrinsics": given.get("extrinsics")}
    files = {name: maybe_place(path, name) for name, path in own.items()} | {"map": maybe_place(map_file, "map_file")}
    heights = given.get("heights")
    return RunOptions(
        maybe_place(given.get("config"), "config"),
        [f"{key}={toml_value(value)}" for key, value in given.get("settings", {}).items()],
        given.get("method"),
        moment_text(given.get("start"), "start"),
        moment_text(given.get("end"), "end"),
        pairs(given.get("remap"), "remap"),
        pairs(given.get("time_offset"), "time_offset"),
        given.get("odom"),
        texts(given.get("image")),
        given.get("image_rate"),
        given.get("every"),
        texts(given.get("scan")),
        given.get("scan_from"),
        None if heights is None else ":".join(map(str, heights)),
        files,
        texts(given.get("use")),
        results_only=given.get("results_only", False),
        force=given.get("force", False),
        overwrite=given.get("overwrite", False),
    )
