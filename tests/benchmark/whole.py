"""The whole job on one log, from the raw recording to evaluated positions, against the time that the log lasts.

python -m tests.benchmark.whole [--json] [--quick]
"""

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from tests.benchmark.rows import Row, main
from tests.benchmark.thesis_runs import call

SEED = 10_000
_ROUNDS = 3


def measure(quick: bool) -> Iterator[Row]:
    """Medians over some rounds, each in fresh processes as from a shell; the map is of another drive."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = [folder / "mapped.mcap", folder / "asked.mcap"]
        for seed, log in enumerate(logs, SEED):
            call("generate", "small", "-o", log, "--seed", seed)
        described = call("info", logs[1])
        lasts_s = (described["end_ns"] - described["start_ns"]) / 1e9
        database, out = folder / "map.db", folder / "out.mcap"
        rounds = []
        for _ in range(1 if quick else _ROUNDS):
            mapped_s = seconds("map", logs[0], "--map", database, "--force")
            localized_s = seconds("localize", logs[1], "--map", database, "-o", out, "--force")
            rounds.append((mapped_s, localized_s, seconds("evaluate", out, "--align")))
        map_s, localize_s, evaluate_s = (statistics.median(seconds) for seconds in zip(*rounds, strict=True))
        scores = call("evaluate", out, "--align")
    peers = {"log": lasts_s, "localize": localize_s, "evaluate": evaluate_s, "map of another log": map_s}
    share = (localize_s + evaluate_s) / lasts_s
    yield Row(
        "small: raw log to evaluated positions / its length",
        share,
        "x real time",
        at_most=0.5,
        cases=len(rounds),
        peers=peers,
    )
    yield Row("small: positions, RMSE aligned", scores["position"]["rmse_m"], "m", cases=scores["localized"])


def seconds(*words: object) -> float:
    """Wall-clock time of a verb in a process of its own.

    Raises:
        RuntimeError: it did not end well.
    """
    command = [sys.executable, "-c", "from mcap_landmarks.cli.main import run; run()", *map(str, words)]
    began = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{words[0]} ended with {done.returncode}: {done.stderr[-500:]}")
    return time.perf_counter() - began


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or ""))
