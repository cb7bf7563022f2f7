"""Localize logs in a landmark map."""

import math
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import PARTIAL, progress, say, say_json, table, warn
from mcap_landmarks.cli.option_groups import ImageOptions, LogOptions, ScanOptions, SegmentOptions, reading_logs
from mcap_landmarks.cli.stage_runs import Given, finish, run_over
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, location
from mcap_landmarks.moments import moment, time_ns
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks.runs.bundles import Reading
    from mcap_landmarks.runs.localize_at import Answer
    from mcap_landmarks.runs.pipeline import LogRun


@reading_logs
def command(
    logs: Annotated[list[Location], typer.Argument(metavar="LOG...", parser=location, help="Recordings (MCAP).")],
    map_file: options.MapFile,
    images: ImageOptions,
    scans: ScanOptions,
    given: LogOptions,
    segments: SegmentOptions,
    output: options.MaybeOutput = None,
    at: Annotated[
        str | None,
        typer.Option("--at", help="Answer for this moment only, and write nothing: RFC 3339 or nanoseconds."),
    ] = None,
    use: options.Use = None,
    extrinsics: options.Extrinsics = None,
    fixed: options.Fixed = False,
) -> None:
    """Localize every bundle of LOG... in a landmark map; write the input with pose and match.

    Where a log has no scene objects, they are made first, from images and scans.
    """
    files = {"map": map_file, "extrinsics": extrinsics}
    asked = Given(given, images, scans, files, use, ["localize.fixed=true"] * fixed, segments)
    asked_ns = time_ns(at, "--at")
    if asked_ns is not None:
        if output is not None or len(logs) > 1:
            raise UsageError("--at prints one answer for one log: leave -o out, and name a single log")
        _at(logs[0], asked_ns, asked, given.json)
        return
    if output is None:
        raise UsageError("localize needs -o FILE to write to, or --at TIME for one answer")
    runs = run_over("localize", ["localize"], logs, output, asked, lacking=True)
    finish("localize", runs, _document, _print, given.json)


def _document(run: "LogRun") -> dict[str, object]:
    return {"bundles": run.outcome.bundles, "statuses": _statuses(run)}


def _statuses(run: "LogRun") -> dict[str, int]:
    from mcap_landmarks.messages.match import Status

    return {status.name.lower(): run.outcome.counts.get(status.name.lower(), 0) for status in Status}


def _print(runs: "list[LogRun]") -> None:
    names = list(_statuses(runs[0]))
    rows = []
    for run in runs:
        counts = _statuses(run)
        rows.append([str(run.output), str(run.outcome.bundles), *(str(counts[name]) for name in names)])
    table(["output", "bundles", *names], rows)
    for run in runs:
        localized = _statuses(run)["localized"]
        share = localized / max(run.outcome.bundles, 1)
        say(f"{run.output}: {counted(localized, 'bundle')} localized ({100 * share:.1f} %)")


def _at(log: Location, asked_ns: int, given: Given, json: bool) -> None:
    from mcap_landmarks.runs.localize_at import localize_at

    answer, reading = localize_at(given.requests([log])[0], asked_ns, progress)
    for loss in reading.losses:
        warn(f"warning: {log}: {loss}")
    if json:
        say_json("localize", _moment_document(log, asked_ns, answer, reading))
    else:
        _print_moment(log, asked_ns, answer)
    if reading.losses:
        raise typer.Exit(PARTIAL)


def _moment_document(log: Location, asked_ns: int, answer: "Answer", reading: "Reading") -> dict[str, object]:
    match, pose, covariance = answer.match, answer.pose, answer.covariance
    sigma_m, heading_sigma_rad = _sigmas(answer)
    return {
        "log": str(log),
        "asked_ns": asked_ns,
        "stamp_ns": answer.stamp_ns,
        "status": match.status.name.lower(),
        "position_m": None if pose is None else pose[:2].tolist(),
        "heading_rad": None if pose is None or covariance is None else float(pose[2]),
        "sigma_m": sigma_m,
        "heading_sigma_rad": heading_sigma_rad,
        "covariance": None if covariance is None else covariance.tolist(),
        "landmarks": dict(zip(match.object_ids, match.landmark_ids, strict=True)),
        "candidates": dict(zip(match.candidate_ids, match.candidate_scores.tolist(), strict=True)),
        "expected_accidental": match.expected_accidental,
        "chi2": match.chi2,
        "dof": match.dof,
        "bundles_joined": match.bundles_joined,
        "dropped": reading.notes(),
        "losses": reading.losses,
    }


def _sigmas(answer: "Answer") -> tuple[float | None, float | None]:
    """Largest standard deviation of the position in any direction, and that of the heading."""
    from mcap_landmarks.estimation.pose import position_sigma

    if answer.covariance is None:
        return None, None
    return float(position_sigma(answer.covariance)), math.sqrt(answer.covariance[2, 2])


def _print_moment(log: Location, asked_ns: int, answer: "Answer") -> None:
    match, pose = answer.match, answer.pose
    late_s = (answer.stamp_ns - asked_ns) / 1e9
    say(f"{log} at {moment(answer.stamp_ns)} ({late_s:+.3f} s): {match.status.name.lower()}")
    if pose is not None:
        say(f"position {pose[0]:.3f}, {pose[1]:.3f} m")
    sigma_m, heading_sigma_rad = _sigmas(answer)
    if pose is not None and sigma_m is not None and heading_sigma_rad is not None:
        say(f"heading {math.degrees(pose[2]):.2f} deg")
        say(f"sigma {sigma_m:.3f} m, {math.degrees(heading_sigma_rad):.2f} deg")
    say(
        f"{counted(match.bundles_joined, 'bundle')} joined, {match.expected_accidental:.2g} accidental matches expected"
    )
    for name, score in zip(match.candidate_ids, match.candidate_scores.tolist(), strict=True):
        say(f"candidate {name}: {score:.3g}")
