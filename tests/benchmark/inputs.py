"""Good logs with one thing wrong: what maps and positions lose without a word, and what is refused for little.

python -m tests.benchmark.inputs [--json] [--quick] [--seed SEED] [--draws N] [--only KIND] [--keep FOLDER]

Each draw is a kind of `input_mutations.KINDS` at a random place of the demo's logs, shortened, with true boxes instead
of images: one log mapped, the other localized in the surveyed map. `--keep` writes what went wrong into a folder.
"""

import argparse
import math
import os
import re
import sys
import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from mcap_landmarks.channels import CAMERA_IMAGE, DETECTIONS, SCAN, TRUTH_DETECTIONS
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Connection

from tests.benchmark.input_mutations import KINDS, Kind
from tests.benchmark.kept import ROOT
from tests.benchmark.log_edits import SECOND_NS, Log
from tests.benchmark.rows import Row, main
from tests.benchmark.thesis_runs import Ended, attempt, call

SEED = 10_000
"""Rows are of seeds from here on; smaller ones are for development."""
_DRAWS, _QUICK_DRAWS = 200, 40
_VERBS = ("map", "localize")
_SECONDS = {"map": 12.0, "localize": 5.0}
_EVERY = {"map": 2, "localize": 1}
"""Of the scans of a log only every so manieth is kept: that halves the time of a draw, and the map stays whole."""
_WORSE = 3.0
_PROCESSES = 2


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of one log: how the verb ended, and its result against the truth, infinite where there is none.

    `landmarks` counts those that are missing or spurious, `rmse_m` is that of the map, aligned, or of the positions.
    """

    ended: Ended
    landmarks: int = 0
    rmse_m: float = math.inf

    @property
    def notes(self) -> frozenset[str]:
        """What was told, but for what every run tells."""
        lines = re.sub(r"\S+\.(mcap|db): ", "", self.ended.told).splitlines()
        return frozenset(line for line in lines if line.startswith(("note: ", "warning: ", "error: ")))


@dataclass(frozen=True, slots=True)
class Draw:
    """One mutation: its kind and seed."""

    kind: Kind
    seed: int

    def log_of(self, log: Log) -> Log:
        """A log with it."""
        return self.kind.change(log, np.random.default_rng([self.seed, 1]))


@dataclass(frozen=True, slots=True)
class Judged:
    """Whether one of a draw's logs went wrong without a word, or was refused, and what was seen."""

    wrong_silently: bool
    refused: bool
    seen: str


def measure(quick: bool, seed: int, draws: int | None, only: str | None, keep: Path | None) -> Iterator[Row]:
    """The shares of draws that went wrong."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    count = draws or (_QUICK_DRAWS if quick else _DRAWS)
    drawn = draws_of(seed, count, only)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        clean = _prepare(folder)
        with ProcessPoolExecutor(_PROCESSES) as pool:
            wrong, refused = _counted(drawn, pool.map(partial(_try, folder, clean, keep), drawn))
    yield Row("wrong_silently", wrong / count, "", at_most=0.01, cases=count)
    yield Row("refused_needlessly", refused / count, "", at_most=0.05, cases=count)


def _counted(drawn: Iterable[Draw], judged: Iterable[Judged]) -> tuple[int, int]:
    """How many draws went wrong without a word, and were refused; each of them is told as it comes."""
    wrong = refused = 0
    for draw, one in zip(drawn, judged, strict=True):
        wrong, refused = wrong + one.wrong_silently, refused + one.refused
        if one.wrong_silently or one.refused:
            print(f"{draw.kind.name}, seed {draw.seed}: {one.seen}", file=sys.stderr, flush=True)
    return wrong, refused


def draws_of(seed: int, count: int, only: str | None = None) -> list[Draw]:
    """Draws of seeds from one on: all kinds in turn, in an order of chance; or of one kind only."""
    kinds = [kind for kind in KINDS if only in (None, kind.name)]
    order = np.random.default_rng(seed).permutation(len(kinds))
    return [Draw(kinds[order[i % len(kinds)]], seed + i) for i in range(count)]


def _prepare(folder: Path) -> dict[str, Outcome]:
    """Write the good logs and the surveyed map, and give what comes of them."""
    for verb in _VERBS:
        write(base_log(verb), folder / f"{verb}.mcap")
    call("map", ROOT / "recordings" / "demo_map.mcap", "--from-reference", "--map", folder / "site.db")
    return {verb: run(verb, folder / f"{verb}.mcap", folder, folder / verb) for verb in _VERBS}


def base_log(verb: str) -> Log:
    """The messages of the good log that a verb is given."""
    found, scans = [], 0
    named: dict[Connection, Connection] = {}
    with open_recording(ROOT / "recordings" / f"demo_{verb}.mcap") as recording:
        kept = [entry.connection for entry in recording.channels if entry.connection.topic != CAMERA_IMAGE.topic]
        for connection in kept:
            is_boxes = connection.topic == TRUTH_DETECTIONS.topic
            named[connection] = replace(connection, topic=DETECTIONS.topic) if is_boxes else connection
        end_ns = (recording.start_ns or 0) + round(_SECONDS[verb] * SECOND_NS)
        for raw in recording.messages(kept, None, end_ns):
            scans += raw.connection.topic == SCAN.topic
            if raw.connection.topic != SCAN.topic or scans % _EVERY[verb] == 0:
                found.append(raw._replace(connection=named[raw.connection], data=bytes(raw.data)))
    return tuple(found)


def write(log: Log, target: Path) -> None:
    """Write a log's messages."""
    with create_recording(target) as writer:
        for raw in log:
            writer.write(raw)


def run(verb: str, log: Path, folder: Path, work: Path) -> Outcome:
    """What comes of a log; results lie in the folder `work`, the truth and the surveyed map in `folder`."""
    work.mkdir(exist_ok=True)
    truth = folder / f"{verb}.mcap"
    if verb == "map":
        database = work / "map.db"
        ended = attempt("map", log, "--map", database)
        if not database.exists():
            return Outcome(ended)
        found = call("evaluate", database, "--reference", truth)["map"]
        database.unlink()
        return Outcome(ended, found["missing"] + found["spurious"], _number(found["rmse_aligned_m"]))
    out = work / "localized.mcap"
    ended = attempt("localize", log, "--map", folder / "site.db", "-o", out)
    if not out.exists():
        return Outcome(ended)
    rmse_m = _number(call("evaluate", out, "--reference", truth)["position"]["rmse_m"])
    out.unlink()
    return Outcome(ended, 0, rmse_m)


def _number(value: float | None) -> float:
    return math.inf if value is None else value


def _try(folder: Path, clean: dict[str, Outcome], keep: Path | None, draw: Draw) -> Judged:
    """Both logs of a draw."""
    judged = []
    with tempfile.TemporaryDirectory(dir=folder) as name:
        work = Path(name)
        for verb in _VERBS:
            log = work / f"{verb}.mcap"
            write(draw.log_of(base_log(verb)), log)
            one = judge(draw.kind, run(verb, log, folder, work), clean[verb])
            judged.append(replace(one, seen=f"{verb}: {one.seen}"))
            if keep is not None and (one.wrong_silently or one.refused):
                log.rename(keep / f"{draw.kind.name.replace(' ', '_')}_{draw.seed}_{verb}.mcap")
    bad = [one for one in judged if one.wrong_silently or one.refused]
    seen = "; ".join(one.seen for one in bad)
    return Judged(any(one.wrong_silently for one in bad), any(one.refused for one in bad), seen)


def judge(kind: Kind, found: Outcome, clean: Outcome) -> Judged:
    """A result against that of the good log: notes count that the good log does not give, and that concern the kind."""
    code = found.ended.code
    told = [line for line in found.notes - clean.notes if re.search(kind.words, line, re.IGNORECASE)]
    is_worse = found.landmarks > clean.landmarks or not found.rmse_m <= _WORSE * clean.rmse_m
    refused = code not in (0, 3)
    seen = f"exit {code}, {found.landmarks} landmarks wrong, RMSE {found.rmse_m:.4f} m for {clean.rmse_m:.4f} m"
    seen = f"{seen}; {found.ended.told.splitlines()[-1][:300]}" if refused else seen
    return Judged(code == 0 and is_worse and not told, refused and not kind.may_refuse, seen)


def _options() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--seed", type=int, default=SEED, help="the first draw's; smaller ones are for development")
    parser.add_argument("--draws", type=int, help="how many")
    parser.add_argument("--only", choices=[kind.name for kind in KINDS], help="draws of one kind")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="where logs that went wrong are written to")
    return parser


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or "", _options()))
