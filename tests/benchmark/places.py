"""The whole job in the generator's places: a drive mapped, a second drive localized in that map, both held to truth.

python -m tests.benchmark.places [PLACE...] [--seed N] [--keep FOLDER] [--model FILE] [--json] [--quick]

Drives, maps and results stay in the folder, and a later run uses what still holds: drives of the same generator, and
of the toolkit's results those that it finds to be of the same inputs and settings itself.
"""

import argparse
import hashlib
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mcap_landmarks_generator
import numpy as np
from mcap_landmarks.evaluation.alignment import fit, search
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.locations import location
from mcap_landmarks.maps.database import read_map
from mcap_landmarks_generator.checks import stage
from mcap_landmarks_generator.loading import load_scenario
from scipy.optimize import linear_sum_assignment

from tests.benchmark.rows import Row, main
from tests.benchmark.thesis_runs import attempt, call

SEED = 10_001
NEAR_M = 1.0
"""A landmark is an object of its class that stands no farther off, after one fit of the map."""
_RINGS = ("--scan-from", "/points", "--image-rate", "4")
PLACES: Mapping[str, tuple[str, ...]] = {
    "warehouse": (),
    "seasons": (),
    "street": _RINGS,
    "campus": _RINGS,
    "hard": ("--image", "all"),
}
"""By name, the words with which `map` and `localize` read its drives."""
SECOND: Mapping[str, tuple[str, ...]] = {"seasons": ("--set", "session=2")}
"""What the second drive has otherwise; of such a place both drives are mapped, and the maps compared."""


@dataclass(frozen=True, slots=True, eq=False)
class Things:
    """Objects or landmarks: classes and positions_xy (N, 2)."""

    classes: tuple[str, ...]
    positions_xy: Array


def measure(
    quick: bool, places: Sequence[str] = (), seed: int = SEED, keep: Path | None = None, model: Path | None = None
) -> Iterator[Row]:
    """The rows of each place."""
    with tempfile.TemporaryDirectory() as name:
        folder = keep or Path(name)
        folder.mkdir(parents=True, exist_ok=True)
        for place in places or (["warehouse"] if quick else PLACES):
            yield from place_rows(place, seed, folder, ["--model", str(model)] if model else [])


def place_rows(place: str, seed: int, folder: Path, model: Sequence[str]) -> Iterator[Row]:
    """One place: its map, the positions of the second drive in it, and where things change, what is told of that."""
    words, second = [*PLACES[place], *model], SECOND.get(place, ())
    mapped, asked = drive(place, seed, folder), drive(place, seed + 1, folder, *second)
    database = mapped_to(mapped, words)
    yield from map_rows(place, landmarks(database), standing(place, seed))
    out = asked.with_suffix(".out.mcap")
    _say(f"localizing {asked.name}")
    told = attempt("localize", asked, "--map", database, "-o", out, "--results-only", "--overwrite", *words)
    if told.code:
        _say(f"localize ended with {told.code}: {told.told}")
    yield position_row(place, call("evaluate", out, "--reference", asked, "--align") if not told.code else None)
    if second:
        document = attempt(
            "diff", database, mapped_to(asked, words), "--align"
        ).document  # that they differ is no failure
        yield change_row(place, document, standing(place, seed), standing(place, seed + 1, *second))


def drive(place: str, seed: int, folder: Path, *settings: str) -> Path:
    """A recording of the place, made by this generator, if there is none yet."""
    digest = hashlib.sha256()
    for file in sorted(Path(mcap_landmarks_generator.__file__).parent.rglob("*")):
        if file.suffix in {".py", ".toml", ".urdf"}:
            digest.update(file.name.encode() + b"\0" + file.read_bytes())
    log = folder / f"{place}-{seed}-{digest.hexdigest()[:8]}.mcap"
    if not log.exists():
        _say(f"driving {log.name}")
        call("generate", place, "-o", log, "--seed", seed, *settings)
    return log


def mapped_to(log: Path, words: Sequence[str]) -> Path:
    """The map of a drive."""
    _say(f"mapping {log.name}")
    database = log.with_suffix(".db")
    call("map", log, "--map", database, "-o", log.with_suffix(".mapped.mcap"), "--results-only", "--overwrite", *words)
    return database


def landmarks(database: Path) -> Things:
    """What a map holds surely enough to be localized by."""
    found = read_map(location(str(database)))
    kept = np.flatnonzero(~found.tentative)
    return Things(tuple(found.classes[i] for i in kept), found.positions_xy[kept])


def standing(place: str, seed: int, *settings: str) -> Things:
    """The objects of a place that a detector knows and that stay where they are."""
    chosen = [word for word in settings if word != "--set"]
    there = [one for one in stage(load_scenario(place, chosen, seed)).objects if one.is_landmark and not one.moves]
    return Things(tuple(one.asset.name for one in there), np.array([one.pose_at(0.0)[:2] for one in there]))


def map_rows(place: str, found: Things, there: Things) -> Iterator[Row]:
    """How many of the objects are landmarks, which are missing and which landmarks are none of them; how far off."""
    mine, theirs, off_m = paired(found, there)
    missing = Counter(there.classes[i] for i in range(len(there.classes)) if i not in theirs)
    wrong = Counter(found.classes[i] for i in range(len(found.classes)) if i not in mine)
    peers: dict[str, float] = {"landmarks": len(found.classes), "that are none": wrong.total()}
    peers |= {f"missing {name}": count for name, count in sorted(missing.items())}
    peers |= {f"wrong {name}": count for name, count in sorted(wrong.items())}
    cases = len(there.classes)
    yield Row(f"{place}: standing objects that are landmarks", len(theirs) / cases, "", cases=cases, peers=peers)
    rmse_m = float(np.sqrt((off_m**2).mean())) if len(off_m) else float("nan")
    worst = {"worst_m": float(off_m.max(initial=0.0))}
    yield Row(f"{place}: landmarks off after one fit", rmse_m, "m RMSE", cases=len(off_m), peers=worst)


def paired(found: Things, there: Things) -> tuple[list[int], list[int], Array]:
    """Indices (K,) of landmarks and of the objects that they are, and how far (K,) they are off after one SE(2) fit."""
    same = np.array(found.classes, dtype=np.str_)[:, None] == np.array(there.classes, dtype=np.str_)
    there_from_map, _ = search(found.positions_xy, there.positions_xy, same, NEAR_M)
    mine: list[int] = []
    theirs: list[int] = []
    off_m = np.zeros(0)
    for _ in range(3):
        moved = transform_points(there_from_map, found.positions_xy)
        apart = np.linalg.norm(moved[:, None] - there.positions_xy, axis=-1)
        # Farther apart than NEAR_M costs more than leaving both out, so no assignment gains by it.
        gain = np.where(same & (apart <= NEAR_M), apart**2 - NEAR_M**2, 0.0)
        rows, columns = linear_sum_assignment(gain)
        kept = gain[rows, columns] < 0
        mine, theirs = rows[kept].tolist(), columns[kept].tolist()
        off_m = apart[mine, theirs]
        there_from_map = fit(found.positions_xy[mine], there.positions_xy[theirs])
    return mine, theirs, off_m


def position_row(place: str, scores: Mapping[str, Any] | None) -> Row:
    """The positions of the second drive; not a number where none came."""
    name = f"{place}: positions of a second drive"
    if scores is None or not scores["scored"]:
        return Row(name, float("nan"), "m RMSE", cases=0)
    position = scores["position"]
    peers: dict[str, float] = {
        "bundles": scores["bundles"],
        "with two objects": scores["eligible"],
        "false": scores["false"]["count"],
        "median_m": position["median_m"],
        "p95_m": position["p95_m"],
        "worst_m": position["max_m"],
        "heading_deg": scores["heading"]["rmse_deg"],
        "nees": scores["nees"] or float("nan"),
    }
    peers |= {status: count for status, count in scores["statuses"].items() if count and status != "localized"}
    return Row(name, position["rmse_m"], "m RMSE", cases=scores["scored"], peers=peers)


def change_row(place: str, document: Mapping[str, Any], before: Things, after: Things) -> Row:
    """How many of the things that vanished or appeared a comparison of both maps tells, by their classes."""
    first, second = (Counter(_identities(things)) for things in (before, after))
    told = document["channels"]["landmarks"]["classes"]
    right = 0
    for how, true in (("removed", first - second), ("added", second - first)):
        classes = Counter(name for name, *_ in true.elements())
        right += sum(min(count, told.get(name, {}).get(how, 0)) for name, count in classes.items())
    changes = ((first - second) + (second - first)).total()
    every = sum(counts["added"] + counts["removed"] for counts in told.values())
    return Row(f"{place}: changes told", right / changes, "", cases=changes, peers={"told besides": every - right})


def _identities(things: Things) -> Iterator[tuple[str, float, float]]:
    for name, (x_m, y_m) in zip(things.classes, things.positions_xy.tolist(), strict=True):
        yield name, x_m, y_m


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _options() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(add_help=False)
    options.add_argument("places", nargs="*", choices=PLACES, metavar="PLACE", help=", ".join(PLACES))
    options.add_argument(
        "--seed", type=int, default=SEED, help="of the drive that is mapped; the next one is localized"
    )
    options.add_argument("--keep", type=Path, metavar="FOLDER", help="where drives, maps and results stay")
    options.add_argument("--model", type=Path, metavar="FILE", help="detector instead of the bundled one")
    return options


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or "", _options()))
