"""Make the detector that the package carries: render pictures, train YOLOv5n on them, judge it, export it."""

import hashlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import typer
from numpy.typing import NDArray

from mcap_landmarks_generator.assets import catalog
from mcap_landmarks_generator.assets.catalog import COCO_ID
from mcap_landmarks_generator.training import export as onnx_export
from mcap_landmarks_generator.training import exported, fitting, worlds
from mcap_landmarks_generator.training.examples import Examples, Phase
from mcap_landmarks_generator.training.judging import detect
from mcap_landmarks_generator.training.network import Network
from mcap_landmarks_generator.training.pictures import Picture, PictureSet, make, painted, render
from mcap_landmarks_generator.training.scoring import Found, Scored, joined, score
from mcap_landmarks_generator.training.worlds import THESIS_CLASSES, Kind, scene

app = typer.Typer(
    help=__doc__
    + """

The bundled model, from nothing: `pictures DIR`, `fit DIR RUN`, `judge RUN`, `export RUN MODEL.onnx --confidence
CLASS=SCORE` for each class, and `python -m tests.benchmark.detector` for the figures of its card.

`pictures` takes half an hour on two cores and 6 GB, `fit` about two hours there (`--device cuda`: minutes); both go on
where they were stopped. `fit --from MODEL.onnx` goes on with what an exported network has learned: a fifth of the steps
and a third of the learning rate do then. `--no-half` is faster on a CPU without AMX. Where something else uses the
cores, OMP_WAIT_POLICY=PASSIVE GOMP_SPINCOUNT=0 keeps `fit` from waiting busily.
""",
    no_args_is_help=True,
    add_completion=False,
)

_JUDGED_SEED = 7_000
_PHASES = ("4000x32x320x320", "1600x12x480x640")

Device = Annotated[str, typer.Option(help="Where to compute: cpu or cuda.")]
Run = Annotated[Path, typer.Argument(metavar="RUN", help="Folder of the training's checkpoints.")]


@app.command()
def pictures(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder for the set; an unfinished one goes on.")],
    scenes: Annotated[int, typer.Option(help="Worlds to render; each gives eight pictures (0.9 MB each).")] = 480,
    empty: Annotated[int, typer.Option(help="Worlds of nothing but distractors beside them.")] = 100,
    painted_eights: Annotated[
        int, typer.Option("--painted", help="Eights of painted pictures of streets, woods and noise.")
    ] = 125,
    seed: Annotated[int, typer.Option(help="Seed of everything random.")] = 1,
    workers: Annotated[int, typer.Option(help="Processes that render.")] = 2,
) -> None:
    """Render the pictures to train on."""
    recipes = [(worlds.TRAINING, scenes), (worlds.judged("empty", catalog.TRAIN_SEEDS), empty)]
    for done in make(folder, recipes, seed, workers, painted_eights):
        typer.echo(f"{done} of {scenes + empty + painted_eights} scenes", err=True)


@app.command()
def fit(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Pictures.")],
    run: Run,
    phases: Annotated[list[str], typer.Option("--phase", help="Steps x batch x height x width, in order.")] = _PHASES,  # type: ignore[assignment]
    seed: Annotated[int, typer.Option(help="Seed of everything random.")] = 0,
    before: Annotated[Path | None, typer.Option("--from", help="Exported network that has learned before.")] = None,
    learning_rate: Annotated[float, typer.Option(help="Highest step of AdamW.")] = 3e-3,
    half: Annotated[bool, typer.Option(help="Sums in bfloat16; slower on a CPU without AMX.")] = True,
    device: Device = "cpu",
    threads: Annotated[int, typer.Option(help="Threads on the CPU; 0: one per core.")] = 0,
) -> None:
    """Train; a run that was stopped goes on from its last checkpoint."""
    if threads:
        torch.set_num_threads(threads)
    run.mkdir(parents=True, exist_ok=True)
    recipe = fitting.Recipe(tuple(Phase.parse(phase) for phase in phases), seed, learning_rate, half=half)
    data = PictureSet(folder)
    examples = Examples(data, recipe.phases, seed)
    last, about = run / fitting.LAST, {"sha256": data.digest, "pictures": len(data), "from": ""}
    learned = None
    if before is not None:
        learned = exported.read(before)
        exported.calibrate(learned, examples)
        about["from"] = hashlib.sha256(before.read_bytes()).hexdigest()
    training = fitting.start(recipe, torch.device(device), last if last.exists() else None, learned)
    (run / "pictures.json").write_text(json.dumps(about) + "\n")
    for at in fitting.fit(training, recipe, examples, run):
        typer.echo(
            f"{at.step}/{at.steps} {training.seconds:.0f} s {at.per_second:.1f} images/s "
            f"box {at.box:.3f} object {at.object:.4f} class {at.classes:.4f}",
            err=True,
        )


@app.command()
def judge(
    run: Run,
    count: Annotated[int, typer.Option(help="Pictures of each kind of world.")] = 240,
    device: Device = "cpu",
) -> None:
    """Judge the averaged network on worlds kept for development, by score threshold and distance."""
    trained = fitting.trained(run / fitting.LAST, torch.device(device))
    thesis, twelve = _scored(trained.network, "thesis", count), _scored(trained.network, "twelve", count)
    empty = detect(trained.network, [picture.image for picture in _developed("empty", count)])
    nothing = detect(trained.network, [painted(_JUDGED_SEED, index).image for index in range(count)])
    typer.echo(f"step {trained.step}")
    _tell_precisions("thesis", thesis, THESIS_CLASSES)
    _tell_precisions("twelve", twelve, tuple(COCO_ID))
    _tell_thresholds(thesis, np.array([one.scores.max(initial=0.0) for one in empty]))
    for name, coco_id in COCO_ID.items():
        _tell_class(name, twelve[coco_id], *(_scores_of(coco_id, found) for found in (empty, nothing)))


def _scored(network: Network, kind: Kind, count: int) -> dict[int, Scored]:
    """What became of the detections in worlds of one kind, by COCO id."""
    shown = list(_developed(kind, count))
    found = detect(network, [picture.image for picture in shown])
    labels = [picture.labels for picture in shown]
    return {coco_id: score(found, labels, coco_id) for coco_id in COCO_ID.values()}


def _tell_precisions(kind: Kind, scored: dict[int, Scored], classes: Sequence[str]) -> None:
    values = {name: scored[COCO_ID[name]].average_precision() for name in classes}
    each = " ".join(f"{name} {value:.3f}" for name, value in values.items())
    typer.echo(f"{kind}: mAP50 {np.mean(list(values.values())):.4f} ({each})")


def _tell_thresholds(scored: dict[int, Scored], best: NDArray[np.float64]) -> None:
    """Recall by distance, precision, and images (N,) of nothing whose best score is above each threshold."""
    thesis = joined([scored[COCO_ID[name]] for name in THESIS_CLASSES])
    everything = joined(list(scored.values()))
    for threshold in np.arange(0.2, 0.75, 0.05):
        recalls = " ".join(f"{thesis.recall(threshold, a, b):.3f}" for a, b in ((2, 8), (8, 12), (12, 15)))
        precision, false = everything.precision(threshold), np.mean(best > threshold)
        typer.echo(f"at {threshold:.2f}: recall {recalls} precision {precision:.4f} false images {false:.4f}")


def _scores_of(coco_id: int, found: Sequence[Found]) -> NDArray[np.float64]:
    """The best score (N,) of one class in each of N images."""
    return np.array([one.scores[one.classes == coco_id].max(initial=0.0) for one in found])


def _tell_class(name: str, twelve: Scored, empty: NDArray[np.float64], nothing: NDArray[np.float64]) -> None:
    """Recall in worlds of all classes, and how many images of empty worlds and painted ones show the class."""
    for threshold in np.arange(0.3, 0.9, 0.05):
        false = f"false images {np.mean(empty > threshold):.4f} painted {np.mean(nothing > threshold):.4f}"
        typer.echo(f"{name} at {threshold:.2f}: recall {twelve.recall(threshold):.3f} {false}")


def _developed(kind: Kind, count: int) -> Iterator[Picture]:
    """So many pictures of worlds of one kind: looks of the training's range, from the robot's own camera."""
    recipe = worlds.judged(kind, catalog.TRAIN_SEEDS)
    for index in range(-(-count // 8)):
        yield from render(scene(recipe, _JUDGED_SEED, index), exposed=True)


@app.command()
def export(
    run: Run,
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="ONNX file to write.")],
    confidence: Annotated[list[str], typer.Option(help="Threshold that the file recommends: CLASS=SCORE, for each.")],
    commit: Annotated[str, typer.Option(help="Commit of this code, for the record.")] = "",
) -> None:
    """Write the averaged network as ONNX, with names, stride, threshold and provenance in its metadata."""
    trained = fitting.trained(run / fitting.LAST, torch.device("cpu"))
    data = json.loads((run / "pictures.json").read_text(encoding="utf-8"))
    about = {
        "confidence": json.dumps({name: float(score) for name, _, score in (one.partition("=") for one in confidence)}),
        "producer": "mcap-landmarks generator.train",
        "commit": commit,
        "seed": str(trained.recipe.seed),
        "phases": " ".join(str(phase) for phase in trained.recipe.phases),
        "steps": str(trained.step),
        "pictures": str(data["pictures"]),
        "pictures_sha256": data["sha256"],
        "from_sha256": data["from"],
        "learning_rate": str(trained.recipe.learning_rate),
        "licence": "the licence of mcap-landmarks",
    }
    onnx_export.export(trained.network, model, None, about)
    typer.echo(f"{model}: {model.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    app()
