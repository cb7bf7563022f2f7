"""Verbs killed at random moments: `python -m tests.benchmark.kills [--json] [--quick] [--resume FILE]`.

After each `kill -9` the inputs are as before, every output is the old one or a whole new one, and a database opens. The
same command again ends as one that nobody killed does, with the same files of the same bytes, and no other file.
"""

import argparse
import os
import shutil
import sqlite3
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType
from mcap_landmarks.cli.main import run
from mcap_landmarks.maps.database import read_map

from tests.benchmark import container_logs as logs
from tests.benchmark.kept import Kept
from tests.benchmark.rows import Row, main

_RNG_SEED = 9
_RECORDINGS = Path(__file__).parents[2] / "recordings"
_CONTEXT = get_context("forkserver")  # whose children have the modules loaded, so that few are killed while they load
_FINAL_S = 600.0
Files = dict[Path, bytes]


@dataclass(frozen=True, slots=True)
class Case:
    """A command, the files that it finds in its folder (those that it reads, and earlier outputs), as words."""

    name: str
    reads: str
    words: str
    replaces: str = ""


_SEEN = "--end 1767225605000000000 --remap /ground_truth/detections=/landmarks/detections"
CASES = (
    Case("convert a bag", "log.bag", "convert log.bag -o out.mcap"),
    Case("convert and split", "log.bag", "convert log.bag -o parts --split-count 2000"),
    Case("convert by whole chunks", "log.mcap", "convert log.mcap -o out.mcap --exclude /tf"),
    Case("recover", "cut.mcap", "recover cut.mcap -o out.mcap"),
    Case(
        "localize onto an output",
        "scenes.mcap site.db",
        f"localize scenes.mcap --map site.db -o out.mcap --set localize.max_sigma_m=0.4 {_SEEN}",
        "out.mcap",
    ),
    Case(
        "run",
        "demo.mcap site.db",
        f"run demo.mcap --stages cluster,fuse,localize --map site.db -o out.mcap {_SEEN}",
    ),
    Case("map onto a database", "scenes.mcap", f"map scenes.mcap --map map.db --overwrite {_SEEN}", "map.db"),
    Case(
        "batch",
        "scenes.mcap again.mcap site.db",
        f"batch localize scenes.mcap again.mcap --map site.db -o outs {_SEEN}",
    ),
)


def measure(quick: bool, resume: Path | None = None) -> Iterator[Row]:
    """All rows; quick: five moments each instead of 50. With `resume` the outcomes are kept there as they come."""
    outcomes = Kept.of(resume)
    _CONTEXT.set_forkserver_preload([__name__, "mcap_landmarks.runs.pipeline", "mcap_landmarks.runs.convert"])
    with tempfile.TemporaryDirectory() as name:
        start = Path(name) / "start"
        start.mkdir()
        prepare(start)
        for case in CASES:
            yield _row(case, start, Path(name) / "trial", 5 if quick else 50, outcomes)


def prepare(folder: Path) -> None:
    """Write all that the commands find."""
    shutil.copy(_RECORDINGS / "demo_localize.mcap", folder / "demo.mcap")
    messages = logs.by_time(logs.odometry(4000), logs.transforms(4000), logs.scans(800), logs.images(100))
    logs.write_bag(folder / "log.bag", messages)
    log = logs.write_mcap(folder / "log.mcap", messages, CompressionType.ZSTD)
    (folder / "cut.mcap").write_bytes(log.read_bytes()[: log.stat().st_size * 2 // 3])
    site = f"map {_RECORDINGS / 'demo_map.mcap'} --from-reference --map"
    _finish(folder, f"{site} site.db")
    _finish(folder, f"{site} map.db")
    (run_case,) = (case for case in CASES if case.name == "run")
    _finish(folder, run_case.words.replace("out.mcap", "scenes.mcap").replace(",localize", ""))
    shutil.copy(folder / "scenes.mcap", folder / "again.mcap")
    _finish(folder, f"localize scenes.mcap --map site.db -o out.mcap {_SEEN}")


def _row(case: Case, start: Path, trial: Path, kills: int, outcomes: Kept) -> Row:
    """How many kills did harm."""
    clean, code, seconds = _clean(case, start, trial)
    harmful = unfinished = 0
    for number, share in enumerate(np.random.default_rng(_RNG_SEED).uniform(size=kills).tolist()):
        name = f"{case.name} {number}"
        if name not in outcomes.known:
            before = _lay_out(case, start, trial)
            _kill(trial, case.words, share * seconds)
            outcomes.add(name, _outcome(case, trial, before, clean, code))
        harm, is_unfinished = outcomes.known[name]
        unfinished += is_unfinished
        harmful += bool(harm)
        if harm:
            print(f"{case.name}, killed after {share:.1%} of its time: {'; '.join(harm)}", file=sys.stderr)
    print(f"{case.name}: {kills} kills, {harmful} did harm, {unfinished} left something half done", file=sys.stderr)
    return Row(case.name, harmful, "harmful", at_most=0, cases=kills, peers={"left something half done": unfinished})


def _outcome(case: Case, trial: Path, before: Files, clean: Files, code: int) -> tuple[list[str], bool]:
    """What harm a kill did, seen by what it left and by the same command again; whether it left something half done."""
    harm = _harm(case, before, clean, _files(trial))
    is_unfinished = any(path.name.startswith(".") for path in trial.rglob("*"))
    again = _finish(trial, case.words)
    if again != code:
        harm.append(f"the next run ends with {again}")
    harm += [f"{path} is another or too much" for path in _differing(_files(trial), clean)]
    return harm, is_unfinished


def _clean(case: Case, start: Path, trial: Path) -> tuple[Files, int, float]:
    """What a run leaves that nobody kills, its exit code, and the seconds that it takes, once the system is warm."""
    for _ in range(2):
        _lay_out(case, start, trial)
        began = time.perf_counter()
        code = _finish(trial, case.words)
        seconds = time.perf_counter() - began
    return _files(trial), code, seconds


def _lay_out(case: Case, start: Path, trial: Path) -> Files:
    """Put a case's files into a new folder."""
    shutil.rmtree(trial, ignore_errors=True)
    trial.mkdir()
    for name in f"{case.reads} {case.replaces}".split():
        shutil.copy(start / name, trial / name)
    return _files(trial)


def _files(folder: Path) -> Files:
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def _differing(one: Files, other: Files) -> list[Path]:
    return sorted(path for path in one.keys() | other.keys() if one.get(path) != other.get(path))


def _harm(case: Case, before: Files, clean: Files, after: Files) -> list[str]:
    """What a kill did that it must not, from all files."""
    harm = [f"{name} is changed" for name in case.reads.split() if after.get(Path(name)) != before[Path(name)]]
    for path in sorted(before.keys() | after.keys()):
        is_ours = any(part.startswith(".") for part in path.parts)
        if not is_ours and after.get(path) not in (before.get(path), clean.get(path)):
            harm.append(f"{path} is neither the old nor the new one")
    databases = [path for path in after if path.suffix == ".db"]
    return harm + [f"{path} is damaged" for path in databases if not _is_whole(after[path])]


def _is_whole(content: bytes) -> bool:
    with tempfile.NamedTemporaryFile(suffix=".db") as file, closing(sqlite3.connect(":memory:")) as database:
        file.write(content)
        file.flush()
        database.deserialize(content)
        return database.execute("PRAGMA integrity_check").fetchall() == [("ok",)] and len(read_map(Path(file.name))) > 0


def _call(folder: Path, words: str) -> None:
    """Run a command in a folder, unheard, and end with its exit code."""
    os.chdir(folder)
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.dup2(silence, 2)
    run(words.split())


def _finish(folder: Path, words: str) -> int:
    """The exit code of a command that nobody kills."""
    process = _CONTEXT.Process(target=_call, args=(folder, words))
    process.start()
    process.join(_FINAL_S)
    if process.exitcode is None:
        process.kill()
        raise RuntimeError(f"{words} does not end")
    return process.exitcode


def _kill(folder: Path, words: str, seconds: float) -> None:
    """Kill a command after some time."""
    process = _CONTEXT.Process(target=_call, args=(folder, words))
    process.start()
    process.join(seconds)
    process.kill()
    process.join()


def _options() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--resume", type=Path, metavar="FILE", help="where outcomes are kept, to go on from")
    return parser


if __name__ == "__main__":
    sys.exit(main(measure, "Verbs killed at random moments.", _options()))
