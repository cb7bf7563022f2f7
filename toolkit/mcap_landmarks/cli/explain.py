"""Say why a bundle was localized or not, in words and as a picture."""

import math
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import say, say_json, table
from mcap_landmarks.cli.option_groups import reading_logs
from mcap_landmarks.locations import Location, location
from mcap_landmarks.moments import moment, time_ns
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks.evaluation.explain import Place, Situation
    from mcap_landmarks.report.explain_reading import SensorData


@reading_logs
def command(
    result: Annotated[
        Location, typer.Argument(metavar="RESULT", parser=location, help="A log with results, as localize writes it.")
    ],
    at: Annotated[str, typer.Option("--at", metavar="TIME", help="When: RFC 3339 or integer nanoseconds.")],
    output: Annotated[
        Location | None,
        typer.Option(
            "-o", "--output", parser=location, help="Draw it, too: image, scan or cloud, map (.png, .svg, .pdf)."
        ),
    ] = None,
    overwrite: options.Overwrite = False,
    json: options.Json = False,
) -> None:
    """Say what was detected, clustered and fused at TIME, which places of the map came into question, and which
    condition of a match held or failed, by how much.
    """
    from contextlib import ExitStack

    from mcap_landmarks.evaluation.explain import places_of
    from mcap_landmarks.report.explain_document import explanation
    from mcap_landmarks.report.explain_reading import read_situation
    from mcap_landmarks.report.plots import form_of
    from mcap_landmarks.runs.replacing import earlier_picture, output_to

    if output:
        form_of(output)
    with ExitStack() as stack:
        if output:
            earlier = earlier_picture("explain", [result])
            stack.enter_context(output_to(output, [result], earlier, overwrite=overwrite))
        situation, view = read_situation(result, time_ns(at, "--at") or 0)
        places = places_of(situation)
        if output:
            _draw(result, situation, places, view, output)
    if json:
        say_json("explain", explanation(situation, places, view))
    else:
        _print(situation, places, view)


def _draw(
    result: Location, situation: "Situation", places: "tuple[Place, ...]", view: "SensorData", output: Location
) -> None:
    from functools import partial

    from mcap_landmarks.atomic import atomic_file
    from mcap_landmarks.report.explain_picture import explanation_figure
    from mcap_landmarks.report.plots import form_of, save
    from mcap_landmarks.runs.replacing import picture_mark

    title = f"{result.name} at {moment(situation.stamp_ns)}: {_status(situation)}"
    with atomic_file(output) as stream:
        draw = partial(explanation_figure, situation, places, view, title)
        save(draw, stream, form_of(output), picture_mark("explain", [result]))


def _status(situation: "Situation") -> str:
    return "not matched yet" if situation.match is None else situation.match.status.name.lower()


def _print(situation: "Situation", places: "tuple[Place, ...]", view: "SensorData") -> None:
    from mcap_landmarks.localization.decision import told
    from mcap_landmarks.report.explain_words import sensed_lines

    match = situation.match
    before = match.bundles_joined - 1 if match is not None else 0
    joined = f", judged together with what {counted(before, 'bundle')} before it saw" if before > 0 else ""
    say(f"bundle at {moment(situation.stamp_ns)}: {_status(situation)}{joined}")
    for line in sensed_lines(situation, view):
        say(line)
    if situation.scene is not None and len(situation.scene):
        say()
        _print_objects(situation, places)
    if places:
        say()
        _print_places(places)
    say()
    if match is None:
        say("There is no match to explain; run localize on the log.")
    elif not match.conditions:
        say("The log does not tell the conditions of its matches; run localize on it again.")
    for condition in () if match is None else match.conditions:
        say(f"{'holds' if condition.held else 'FAILS'}  {condition.name}: {told(condition)}")


def _print_objects(situation: "Situation", places: "tuple[Place, ...]") -> None:
    from mcap_landmarks.report.explain_document import object_entries

    rows = []
    for entry in object_entries(situation, places):
        off = "-" if entry["residual_m"] is None else f"{entry['residual_m']:.3f} m"
        off += "" if entry["sigmas"] is None else f", {entry['sigmas']:.1f} sigma"
        rows.append(
            [
                entry["id"] or "-",
                f"{entry['class']} {entry['probability']:.2f}",
                f"{entry['range_m']:.2f} m",
                f"{entry['bearing_deg']:+.1f} deg",
                "unknown" if entry["sigma_m"] is None else f"{entry['sigma_m']:.3f} m",
                entry["landmark"] or "-",
                off,
            ]
        )
    table(["object", "class", "range", "bearing", "sigma", "landmark of the best", "off by"], rows)


def _print_places(places: "tuple[Place, ...]") -> None:
    from mcap_landmarks.report.explain_document import pose_figures

    rows = []
    for number, place in enumerate(places, 1):
        fit = ["-", "-", "-", "-"]
        if place.pose is not None:
            x, y, heading = pose_figures(place)
            fit = [
                f"{x:.2f} m, {y:.2f} m, " + ("-" if math.isnan(heading) else f"{heading:.1f} deg"),
                f"{place.chi2:.1f} / {place.dof}",
                f"{max(place.residual_m):.3f} m" if place.residual_m is not None else "-",
                "-" if math.isnan(place.sigma_m) else f"{place.sigma_m:.3f} m",
            ]
        share = f"{place.share:.4f}" if place.share == place.share else "-"
        rows.append([str(number), share, *fit, " ".join(place.landmark_ids)])
    table(["place", "share", "pose", "chi2 / dof", "worst", "sigma", "landmarks"], rows)
