"""Say why a bundle was localized or not, in words and as a picture."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, TypedDict

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import say, say_json, table
from mcap_landmarks.cli.option_groups import reading_logs
from mcap_landmarks.locations import Location, location
from mcap_landmarks.moments import moment, time_ns
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks.evaluation.explain import Place, Situation
    from mcap_landmarks.messages.detections import Detections
    from mcap_landmarks.messages.match import LandmarkMatch
    from mcap_landmarks.report.box_outcomes import LostBox
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
        say_json("explain", _document(situation, places, view))
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
    rows = []
    for entry in _objects(situation, places):
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


_ObjectEntry = TypedDict(
    "_ObjectEntry",
    {
        "id": str,
        "class": str,
        "probability": float,
        "x_m": float,
        "y_m": float,
        "yaw_deg": float | None,
        "size_m": list[float] | None,
        "range_m": float,
        "bearing_deg": float,
        "sigma_m": float | None,
        "landmark": str | None,
        "residual_m": float | None,
        "sigmas": float | None,
    },
)


def _objects(situation: "Situation", places: "tuple[Place, ...]") -> list[_ObjectEntry]:
    import numpy as np

    scene = situation.scene
    if scene is None:
        return []
    paired: dict[int, tuple[str, float, float | None]] = {}
    for place in places[:1]:
        if place.residual_m is not None:
            sigmas = [None] * len(place.rows) if place.sigmas is None else place.sigmas.tolist()
            off = zip(place.landmark_ids, place.residual_m.tolist(), sigmas, strict=True)
            paired = dict(zip(place.rows.tolist(), off, strict=True))
    found: list[_ObjectEntry] = []
    for i, name in enumerate(scene.ids):
        x, y = scene.positions_xy[i].tolist()
        spread = float(np.sqrt(np.linalg.eigvalsh(scene.covariances[i])[-1])) if scene.covariances[i].any() else None
        label, probability = scene.hypotheses[i][0] if scene.hypotheses[i] else ("", 0.0)
        landmark, residual_m, sigmas = paired.get(i, (None, None, None))
        found.append(
            {
                "id": name,
                "class": label,
                "probability": probability,
                "x_m": x,
                "y_m": y,
                "yaw_deg": None if scene.boxes is None else float(np.degrees(scene.boxes.yaws_rad[i])),
                "size_m": None if scene.boxes is None else scene.boxes.sizes_m[i].tolist(),
                "range_m": float(np.hypot(x, y)),
                "bearing_deg": float(np.degrees(np.arctan2(y, x))),
                "sigma_m": spread,
                "landmark": landmark,
                "residual_m": residual_m,
                "sigmas": sigmas,
            }
        )
    return found


def _print_places(places: "tuple[Place, ...]") -> None:
    rows = []
    for number, place in enumerate(places, 1):
        fit = ["-", "-", "-", "-"]
        if place.pose is not None:
            x, y, heading = _pose(place)
            fit = [
                f"{x:.2f} m, {y:.2f} m, " + ("-" if math.isnan(heading) else f"{heading:.1f} deg"),
                f"{place.chi2:.1f} / {place.dof}",
                f"{max(place.residual_m):.3f} m" if place.residual_m is not None else "-",
                "-" if math.isnan(place.sigma_m) else f"{place.sigma_m:.3f} m",
            ]
        share = f"{place.share:.4f}" if place.share == place.share else "-"
        rows.append([str(number), share, *fit, " ".join(place.landmark_ids)])
    table(["place", "share", "pose", "chi2 / dof", "worst", "sigma", "landmarks"], rows)


def _pose(place: "Place") -> tuple[float, float, float]:
    import numpy as np

    assert place.pose is not None  # noqa: S101 - callers looked
    x, y, heading = place.pose.tolist()
    return x, y, float(np.degrees(heading))


def _document(situation: "Situation", places: "tuple[Place, ...]", view: "SensorData") -> dict[str, object]:
    match = situation.match
    return {
        "stamp_ns": situation.stamp_ns,
        "status": None if match is None else match.status.name.lower(),
        "bundles_joined": None if match is None else match.bundles_joined,
        "detections": _detections(situation.detections) if situation.detections else None,
        "clusters": None if situation.scan_objects is None else len(situation.scan_objects),
        "lost": None if view.lost is None else _lost(view.lost),
        "objects": None if situation.scene is None else _objects(situation, places),
        "places": [
            {
                "landmarks": list(place.landmark_ids),
                "share": place.share,
                "pose": None if place.pose is None else dict(zip(_POSE, _pose(place), strict=True)),
                "chi2": place.chi2,
                "dof": place.dof,
                "sigma_m": place.sigma_m,
            }
            for place in places
        ],
        "conditions": None if match is None or not match.conditions else _conditions(match),
    }


def _detections(images: "Sequence[Detections]") -> list[dict[str, object]]:
    return [
        {"class": hypotheses[0][0], "confidence": hypotheses[0][1], "xyxy": box, "camera": found.frame_id}
        for found in images
        for hypotheses, box in zip(found.hypotheses, found.boxes_xyxy.tolist(), strict=True)
        if hypotheses
    ]


def _lost(boxes: "tuple[LostBox, ...]") -> list[dict[str, object]]:
    return [
        {
            "class": one.name,
            "confidence": one.score,
            "xyxy": one.box_xyxy.tolist(),
            "camera": one.camera,
            "reason": one.reason,
        }
        for one in boxes
    ]


def _conditions(match: "LandmarkMatch") -> list[dict[str, object]]:
    from mcap_landmarks.localization.decision import told

    return [
        {"name": one.name, "value": one.value, "limit": one.limit, "holds": one.held, "words": told(one)}
        for one in match.conditions
    ]


_POSE = ("x_m", "y_m", "heading_deg")
