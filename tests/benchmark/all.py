"""All benchmarks one after the other, held against what they gave before.

python -m tests.benchmark.all --quick [--gate] [--renew] [--only NAME,...] [--json] [--resume FILE]

`--gate` fails where a row of accuracy, or a speed relative to a peer's, falls behind tests/benchmark/baseline.json by
more than its noise; `--renew` writes that file. Times in seconds are never compared. `mutants` takes so long that it
only runs when it is named.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from tests.benchmark.gate import as_json, entries, from_json, hold, machine
from tests.benchmark.kept import ROOT, Kept

BASELINE = Path(__file__).with_name("baseline.json")
_ONLY_WHEN_NAMED = "mutants"
_ITSELF = "all"

Rows = list[dict[str, Any]]


def benchmarks() -> list[str]:
    """Names of the modules beside this one that can be run."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    return [file.stem for file in files if '__name__ == "__main__"' in file.read_text() and file.stem != _ITSELF]


def main(words: list[str] | None = None) -> int:
    """0; 1 where a row falls behind the baseline, or without `--gate` misses its goal, and where a benchmark fails."""
    arguments = _arguments(words)
    where, kept = machine(), Kept.of(arguments.resume)
    measured, failed = _measure(arguments.only, arguments.quick, kept)
    if arguments.json:
        print(json.dumps([row for rows in measured.values() for row in rows], indent=2))
    missed = [f"{name}: {row['name']}" for name, rows in measured.items() for row in rows if row["holds"] is False]
    for row in missed:
        _say(f"{row} misses its goal")
    behind = _gate(measured, where) if arguments.gate else []
    if arguments.renew:
        _renew(measured, where)
    for name in failed:
        _say(f"{name} FAILED")
    return int(bool(failed or behind or (missed and not arguments.gate)))


def _arguments(words: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    named = parser.add_argument("--only", type=lambda names: names.split(","), help="these, separated by commas")
    parser.add_argument("--quick", action="store_true", help="fewer cases, within ten minutes each")
    parser.add_argument("--gate", action="store_true", help="fail where a row falls behind the baseline")
    parser.add_argument("--renew", action="store_true", help="make this the baseline of the benchmarks that run")
    parser.add_argument("--json", action="store_true", help="print a list of rows")
    parser.add_argument("--resume", type=Path, metavar="FILE", help="where results are kept, to go on from")
    arguments = parser.parse_args(words)
    every = benchmarks()
    if arguments.only is None:
        arguments.only = [name for name in every if name != _ONLY_WHEN_NAMED]
    unknown = set(arguments.only) - set(every)
    if unknown:
        parser.error(f"argument {named.option_strings[0]}: no {', '.join(sorted(unknown))} among {', '.join(every)}")
    if (arguments.gate or arguments.renew) and not arguments.quick:
        parser.error("the baseline is of --quick runs")
    if arguments.gate and not BASELINE.exists():
        parser.error(f"no {BASELINE.name} yet: --renew writes it")
    return arguments


def _measure(names: list[str], quick: bool, kept: Kept) -> tuple[dict[str, Rows], list[str]]:
    """Rows by benchmark, and the benchmarks that gave none."""
    measured, failed = {}, []
    for name in names:
        key = f"{name} --quick" if quick else name
        if key not in kept.known:
            _say(f"{name} ...")
            command = [sys.executable, "-m", f"tests.benchmark.{name}", "--json", *(["--quick"] if quick else [])]
            done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
            try:
                kept.add(key, json.loads(done.stdout))
            except json.JSONDecodeError:  # the exit code tells nothing: 1 is also that of a row that misses its goal
                failed.append(name)
                continue
        measured[name] = kept.known[key]
    return measured, failed


def _gate(measured: dict[str, Rows], where: str) -> list[str]:
    """Print what differs from the baseline; give the benchmarks that fall behind."""
    baseline = from_json(json.loads(BASELINE.read_text()))
    behind = []
    for name, rows in measured.items():
        held = hold(name, rows, baseline.get(name, {}), where)
        _say("\n".join(held.lines) or f"{name}: as it was")
        behind += [name] if held.behind else []
    if behind:
        only = ",".join(behind)
        _say(
            f"If this is meant: python -m tests.benchmark.all --quick --renew --only {only}, and say why in the commit"
        )
    return behind


def _renew(measured: dict[str, Rows], where: str) -> None:
    """Write the baseline anew; benchmarks that did not run keep theirs."""
    baseline = from_json(json.loads(BASELINE.read_text())) if BASELINE.exists() else {}
    baseline |= {name: entries(rows, where) for name, rows in measured.items()}
    BASELINE.write_text(json.dumps(as_json(baseline), indent=1) + "\n")
    _say(f"wrote {BASELINE}")


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
