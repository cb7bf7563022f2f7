"""How many single changes of the code the tests of its package notice: mutation testing of what decides results.

python -m tests.benchmark.mutants [--json] [--quick] [--list] [--seed N] [--packages A,B] [--mutants N] [--resume FILE]

Tools that are at hand mutate whole projects in place or by functions, and draw no sample; this draws one by its seed.
Each mutant meets the quick tests of its package (`-m "not slow"`); those that survive are named on stderr.
"""

import argparse
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

from tests.benchmark.kept import ROOT, Kept
from tests.benchmark.mutant_runs import SOURCES, SURVIVED, TIMED_OUT, Copy, Suite
from tests.benchmark.mutation import Mutant, mutants_of
from tests.benchmark.rows import Row, main

PACKAGES = ("localization", "mapping", "estimation", "fusion")
SEED = 10_000
_AT_ONCE = 2
_QUICK_COUNT, _COUNT = 25, 60
_GOAL = 0.8


@dataclass(frozen=True, slots=True)
class Sample:
    """Mutants of one package, drawn from all that there are."""

    package: str
    drawn: list[Mutant]
    of: int

    @classmethod
    def of_package(cls, package: str, count: int, seed: int) -> "Sample":
        """The same for the same sources and seed.

        Raises:
            ValueError: there is no such package.
        """
        root = ROOT / SOURCES
        files = sorted((root / package).rglob("*.py"))
        if not files:
            raise ValueError(f"no package {root / package}")
        every = [mutant for file in files for mutant in mutants_of(file.read_text(), file.relative_to(root).as_posix())]
        drawn = random.Random(f"{seed} {package}").sample(every, min(count, len(every)))  # noqa: S311 - a sample, no secret
        return cls(package, drawn, len(every))


def measure(
    quick: bool, listed: bool, seed: int, packages: list[str], mutants: int | None, resume: Path | None
) -> Iterator[Row]:
    """A row for each package."""
    count = mutants if mutants is not None else _QUICK_COUNT if quick else _COUNT
    samples = [Sample.of_package(package, count, seed) for package in packages]
    for sample in samples:
        _say(f"{sample.package}: {len(sample.drawn)} of {sample.of:,} mutants, seed {seed}")
        if listed:
            print("\n".join(map(str, sample.drawn)))
    if listed:
        return
    outcomes = Kept.of(resume)
    _run([sample for sample in samples if any(mutant.key not in outcomes.known for mutant in sample.drawn)], outcomes)
    for sample in samples:
        yield _row(sample, outcomes, seed)


def _row(sample: Sample, outcomes: Kept, seed: int) -> Row:
    became = {mutant: outcomes.known[mutant.key] for mutant in sample.drawn}
    counts = Counter(became.values())
    survivors = [mutant for mutant in sample.drawn if became[mutant] == SURVIVED]
    if survivors:
        _say(f"{sample.package}: {len(survivors)} survived")
    for mutant in sorted(survivors, key=lambda survivor: (survivor.file, survivor.start)):
        _say(f"  {mutant}")
    share = 1 - counts[SURVIVED] / len(became)
    peers: dict[str, float] = {"timed out": counts[TIMED_OUT], "of mutants": sample.of, "seed": seed}
    return Row(f"killed_{sample.package}", share, at_least=_GOAL, cases=len(became), peers=peers)


def _run(samples: list[Sample], outcomes: Kept) -> None:
    """What is not known yet, in copies that take turns; first the tests without any mutant."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as name, ThreadPoolExecutor(_AT_ONCE) as pool:
        copies: SimpleQueue[Copy] = SimpleQueue()
        for i in range(_AT_ONCE):
            copies.put(Copy.at(Path(name).resolve() / str(i)))

        def unchanged(package: str) -> Suite:
            copy = copies.get()
            try:
                return copy.run_unchanged(package)
            finally:
                copies.put(copy)

        def one(mutant: Mutant, tests: Suite) -> None:
            copy = copies.get()
            try:
                outcome = copy.run(mutant, tests)
            finally:
                copies.put(copy)
            outcomes.add(mutant.key, outcome)
            _say(f"{outcome}: {mutant}")

        try:
            every = list(pool.map(unchanged, [sample.package for sample in samples]))
            for tests in every:
                _say(f"{tests.package}: {len(tests.durations)} tests take {tests.seconds:.0f} s")
            waiting = [
                pool.submit(one, mutant, tests)
                for sample, tests in zip(samples, every, strict=True)
                for mutant in sample.drawn
                if mutant.key not in outcomes.known
            ]
            for future in waiting:
                future.result()
        finally:
            pool.shutdown(cancel_futures=True)


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    OPTIONS = argparse.ArgumentParser(add_help=False)
    OPTIONS.add_argument("--list", dest="listed", action="store_true", help="name the mutants drawn, and run none")
    OPTIONS.add_argument("--seed", type=int, default=SEED, help="of the draw")
    OPTIONS.add_argument(
        "--packages", type=lambda names: names.split(","), default=PACKAGES, help="separated by commas"
    )
    OPTIONS.add_argument("--mutants", type=int, help="how many of each package")
    OPTIONS.add_argument("--resume", type=Path, metavar="FILE", help="where outcomes are kept, to go on from")
    sys.exit(main(measure, __doc__ or "", OPTIONS))
