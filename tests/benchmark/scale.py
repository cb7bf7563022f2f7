"""Fleets of logs: how much two workers bring, what Ray and scheduling cost, whether memory stays flat.

python -m tests.benchmark.scale [--json] [--quick]

Verbs run from the command line, in fresh processes, on logs that the generator made; each worker has one thread.
"""

import json
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from mcap_landmarks.fleet.local_workers import LocalWorkers
from mcap_landmarks.fleet.tasks import Task, TaskLimits

from tests.benchmark.rows import Row, main
from tests.benchmark.thesis_runs import call

SEED = 10_000
LOGS = 8
WORKERS = 2
TINY = 10_000
_MANY = 40
_COMMAND = (sys.executable, "-c", "from mcap_landmarks.cli.main import run; run()")


def measure(quick: bool) -> Iterator[Row]:
    """All rows; quick: one round instead of three, and a tenth of the tiny logs."""
    rounds = 1 if quick else 3
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = prepared(folder)
        yield from _worker_rows(folder, logs, rounds)
        yield _memory_row(folder, logs)
    yield _scheduling_row(TINY // 10 if quick else TINY)


def prepared(folder: Path) -> list[Path]:
    """Logs of one world, and beside them a map of it, `map.db`."""
    logs = [folder / f"log_{number}.mcap" for number in range(LOGS)]
    for seed, log in enumerate(logs, SEED):
        call("generate", "small", "-o", log, "--seed", seed)
    call("map", logs[0], "--map", folder / "map.db")
    return logs


def _worker_rows(folder: Path, logs: list[Path], rounds: int) -> Iterator[Row]:
    """Two workers against one, and Ray against local ones, each round one after the other."""
    ratios, on_ray, starts = [], [], []
    for _ in range(rounds):
        alone = _batch(folder, logs, 1)
        two = _batch(folder, logs, WORKERS)
        ray = _batch(folder, logs, WORKERS, "--ray", "local")
        ratios.append(alone["wall_s"] / two["wall_s"])
        on_ray.append(ray["work_s"] / two["work_s"])
        starts.append(ray["wall_s"] - ray["work_s"])
        peers = {"one worker, s": alone["wall_s"], "two workers, s": two["wall_s"]}
    yield Row(f"two workers against one, {LOGS} logs", statistics.median(ratios), "x", 1.8, cases=rounds, peers=peers)
    yield Row(
        "Ray's time per log against local workers'",
        statistics.median(on_ray),
        "x",
        at_most=1.1,
        cases=rounds,
        peers={"to start and end Ray, s": statistics.median(starts)},
    )


def _batch(folder: Path, logs: list[Path], workers: int, *more: object) -> dict[str, float]:
    """Seconds that a batch takes: as a whole, and from the first log that begins to the last that ends."""
    events = folder / "events.jsonl"
    events.unlink(missing_ok=True)
    words = ["localize", *logs, "--map", folder / "map.db", "-o", folder / "out", "--force", "--overwrite"]
    began = time.perf_counter()
    document = _call("batch", *words, "--workers", workers, "--events", events, *more)
    wall_s = time.perf_counter() - began
    if document["done"] != len(logs):
        raise RuntimeError(f"not all logs are done: {document}")
    times = [datetime.fromisoformat(json.loads(line)["time"]) for line in events.read_text().splitlines()]
    return {"wall_s": wall_s, "work_s": (max(times) - min(times)).total_seconds()}


def _memory_row(folder: Path, logs: list[Path]) -> Row:
    """What the worker's peak grows to from the first tenth of many logs, once warm, to the last tenth."""
    many = folder / "many"
    many.mkdir()
    for number in range(_MANY):
        shutil.copy(logs[number % LOGS], many / f"{number:03}.mcap")
    words = ["detect", many / "*.mcap", "-o", folder / "detected", "--image-rate", 0.5]
    document = _call("batch", *words, "--workers", 1)
    peaks = [log["peak_bytes"] for log in document["logs"]]
    first, last = statistics.median(peaks[4:12]), statistics.median(peaks[-8:])
    name = f"memory of a worker, last of {_MANY} logs against first"
    return Row(name, last / first, "x", at_most=1.05, cases=_MANY, peers={"last, MB": last / 1e6})


def _scheduling_row(count: int) -> Row:
    """What it costs to hand out tasks that do nothing."""
    tasks = [Task(Path(f"{number}.mcap"), Path(f"{number}.out"), ("nothing",)) for number in range(count)]
    began = time.perf_counter()
    ended = list(LocalWorkers(WORKERS, nothing).run(tasks, TaskLimits(), lambda _task, _pid: None, lambda _task: None))
    seconds = time.perf_counter() - began
    if len(ended) != count or any(one.exit_code for one in ended):
        raise RuntimeError("not all tasks ended well")
    return Row(f"scheduling {TINY:,} tiny logs", seconds * TINY / count, "s", at_most=60, cases=count)


def nothing(_words: list[str]) -> None:
    """Do nothing, as a verb."""
    raise SystemExit(0)


def _call(*words: object) -> Any:  # noqa: ANN401 - JSON
    done = subprocess.run([*_COMMAND, *map(str, words), "--json"], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{words}: {done.stderr}")
    return json.loads(done.stdout)


if __name__ == "__main__":
    sys.exit(main(measure, "Fleets of logs."))
