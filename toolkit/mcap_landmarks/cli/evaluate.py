"""Measure a run, a map or the thesis's results against the truth."""

from collections.abc import Callable
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import PARTIAL, progress, say, say_json, table, warn
from mcap_landmarks.cli.option_groups import reading_logs
from mcap_landmarks.locations import Location, location

if TYPE_CHECKING:
    from mcap_landmarks.evaluation.evaluate import EvaluatedRun
    from mcap_landmarks.evaluation.metrics import Evaluation
    from mcap_landmarks.evaluation.pose_metrics import Figures


class PoseAssociation(StrEnum):
    """How poses find their truth in time."""

    INTERPOLATE = "interpolate"
    NEAREST = "nearest"


@reading_logs
def command(
    result: Annotated[
        Location,
        typer.Argument(
            metavar="RESULT", parser=location, help="A log with results, a MAP.db, or results.txt as in Appendix D."
        ),
    ],
    align: Annotated[
        bool, typer.Option("--align", help="Move the poses by the one SE(2) that fits them best.")
    ] = False,
    association: Annotated[
        PoseAssociation, typer.Option("--association", help="Interpolate the truth, or take the nearest within 10 ms.")
    ] = PoseAssociation.INTERPOLATE,
    max_gap: Annotated[
        float, typer.Option("--max-gap", min=0, help="Longest gap of the truth to interpolate over, in seconds.")
    ] = 0.5,
    reference: Annotated[
        Location | None,
        typer.Option("--reference", parser=location, help="Where the truth is: a log, or a trajectory (.tum, .txt)."),
    ] = None,
    tum: Annotated[
        Location | None, typer.Option("--tum", parser=location, help="Write the estimated poses as a TUM trajectory.")
    ] = None,
    thesis: Annotated[
        Location | None,
        typer.Option("--thesis", parser=location, help="Write the scored positions as the thesis's Appendix D."),
    ] = None,
    overwrite: options.Overwrite = False,
    json: options.Json = False,
) -> None:
    """Measure poses and map of RESULT against the truth: metres, degrees, false ones, honesty of the covariance.

    The truth is RESULT's own /ground_truth channels, or those of --reference.
    """
    from mcap_landmarks.evaluation.evaluate import evaluate_file, pairing_by
    from mcap_landmarks.evaluation.metrics import frame_note
    from mcap_landmarks.runs.replacing import new_files

    with new_files([tum, thesis], [result, reference], overwrite=overwrite):
        found = evaluate_file(result, reference, pairing_by(association.value, max_gap), aligned=align, watch=progress)
        _export(found, tum, thesis)
    document = found.figures
    if document["localized"] and not document["scored"] and found.truth.trajectory is not None:
        warn(f"note: {result}: no pose has a truth near enough in time; see --max-gap and --association")
    if note := frame_note(document["position"], aligned=align):
        warn(f"note: {result}: {note}")
    if json:
        say_json("evaluate", document)
    else:
        _print(document)
    for loss in found.losses:
        warn(f"warning: {result}: {loss}")
    if found.losses:
        raise typer.Exit(PARTIAL)


def _export(found: "EvaluatedRun", tum: Location | None, thesis: Location | None) -> None:
    from mcap_landmarks.atomic import atomic_file
    from mcap_landmarks.evaluation.metrics import score
    from mcap_landmarks.evaluation.thesis_results import results_of
    from mcap_landmarks.evaluation.tum import render
    from mcap_landmarks.maps.exchange_thesis import render_results

    if tum:
        with atomic_file(tum) as stream:
            stream.write(render(found.run.trajectory).encode())
    if thesis:
        scored = score(found.run.trajectory, found.truth, found.pairing, aligned=False)
        with atomic_file(thesis) as stream:
            stream.write(render_results(results_of(found.run, scored)).encode())


def _print(document: "Evaluation") -> None:
    parts: list[Callable[[], None]] = []
    if document["bundles"] or document["localized"]:
        parts.append(partial(_print_counts, document))
    if document["scored"]:
        parts.append(partial(_print_poses, document))
    if document["map"]:
        parts.append(partial(_print_map, document["map"]))
    for i, part in enumerate(parts):
        if i:
            say()
        part()


def _print_counts(document: "Evaluation") -> None:
    bundles, eligible, localized = document["bundles"], document["eligible"], document["localized"]
    whole, name = (bundles, "bundles") if document["statuses"] is None else (eligible, "eligible")
    false = document["false"]
    rows = [
        ["bundles", str(bundles), ""],
        ["eligible", str(eligible if eligible is not None else "-"), ""],
        ["localized", str(localized), f"{_percent(localized / whole if whole else None)} of {name}"],
        ["scored", str(document["scored"]), ""],
        ["false: over 1 m or 20 degrees", str(false["count"]), f"{_percent(false['share'])} of scored"],
    ]
    rows.extend([f"status {name}", str(count), ""] for name, count in (document["statuses"] or {}).items())
    table(["bundles", "count", "share"], rows)


def _print_poses(document: "Evaluation") -> None:
    position, heading, fit = document["position"], document["heading"], document["alignment"]
    table(
        ["position", "RMSE", "median", "95 %", "max", "in 0.2 m", "in 1 m"],
        [
            [
                "after one SE(2) fit" if fit else "as it stands",
                *(_metres(position[key]) for key in ("rmse_m", "median_m", "p95_m", "max_m")),
                _percent(position["within_0_2_m"]),
                _percent(position["within_1_m"]),
            ]
        ],
    )
    say()
    rows = [
        [
            name,
            _metres(axis["median_abs_m"]),
            *(_number(axis[key], " %") for key in ("mean_relative_percent", "max_relative_percent")),
            _percent(axis["under_5_percent"]),
        ]
        for name, axis in document["axis"].items()
    ]
    table(["axis", "median", "mean of truth", "max of truth", "under 5 %"], rows)
    say()
    rows = [
        ["heading RMSE", _number(heading["rmse_deg"], " deg")],
        ["heading median", _number(heading["median_deg"], " deg")],
        ["NEES (1 is honest)", _number(document["nees"], "")],
        ["RPE from pose to pose", _metres(document["rpe"])],
    ]
    if fit:
        moved = f"{fit['x_m']:.3f} m, {fit['y_m']:.3f} m, {fit['heading_deg']:.3f} deg"
        sigma = fit["rotation_sigma_deg"]
        surely = "" if sigma is None else f", sigma {sigma:.3f} deg"
        rows += [["truth from estimate", moved], ["its rotation is from", f"{fit['rotation_from']}{surely}"]]
    table(["figure", "value"], rows)


def _print_map(figures: "Figures") -> None:
    counts = ["landmarks", "reference", "matched", "missing", "spurious"]
    errors = [_metres(figures["rmse_aligned_m"]), _metres(figures["rmse_m"])]
    table(
        ["map", *counts, "RMSE aligned", "RMSE"],
        [["against the truth's objects", *(str(figures[name]) for name in counts), *errors]],
    )


def _metres(value: float | None) -> str:
    return _number(value, " m")


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"


def _number(value: float | None, unit: str) -> str:
    return "-" if value is None else f"{value:.4f}{unit}"
