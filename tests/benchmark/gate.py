"""Rows of benchmarks held against a baseline: which are in it, and which fall behind it by more than their noise."""

import os
import platform
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

# Accuracy is that of fixed seeds: another processor may turn a case that is on the edge, no more.
_ACCURACY_NOISE = 0.01
# Two medians of the same run, while the machine may do other things.
_SPEED_NOISE = 0.15
# Alone, or before the name of the peer that it is relative to, as "x mcap".
_RATIO = "x"
_ABSOLUTE = {"s", "ms", "us", "1/s", "GB", "MB", "MiB", "x real time"}
# Without a goal: an error, of which less is better.
_ERRORS = {"m", "deg"}
LOWER, HIGHER = "lower", "higher"


@dataclass(frozen=True, slots=True)
class Entry:
    """What a row was: its value, what is better, the relative noise that a worse value may be due to, and where.

    `better` is "lower", "higher" or the number that it should be close to; `speed` tells the ratio of two speeds.
    """

    value: float
    better: str | float
    noise: float
    speed: bool
    machine: str

    @classmethod
    def of(cls, row: dict[str, Any], where: str) -> "Entry | None":
        """That of a row as JSON; None for times, memory, and figures that nothing says which way are better."""
        better = _better(row["goal"], row["unit"])
        if row["unit"] in _ABSOLUTE or better is None:
            return None
        speed = row["unit"].split(" ")[0] == _RATIO
        return cls(float(row["value"]), better, _SPEED_NOISE if speed else _ACCURACY_NOISE, speed, where)

    def worse_by(self, value: float) -> float:
        """How much worse another value is than this one, relative to it; negative where it is better."""
        if self.better == LOWER:
            worse = value - self.value
        elif self.better == HIGHER:
            worse = self.value - value
        else:
            worse = abs(value - float(self.better)) - abs(self.value - float(self.better))
        if self.value == 0:
            return float("inf") if worse > 0 else worse
        return worse / abs(self.value)


@dataclass(frozen=True, slots=True)
class Held:
    """Rows of one benchmark against its baseline: lines to print, and the names of the rows that fall behind."""

    lines: list[str]
    behind: list[str]


def hold(name: str, rows: Iterable[dict[str, Any]], baseline: dict[str, Entry], where: str) -> Held:
    """Compare; a ratio of speeds that was measured on another type of machine is told, and not held to."""
    lines, behind = [], []
    now = entries(rows, where)
    for row, entry in now.items():
        if row not in baseline:
            lines.append(f"{name}: {row} is new: {entry.value:.4g}")
            continue
        before = baseline[row]
        worse = before.worse_by(entry.value)
        figures = f"{name}: {row} was {before.value:.4g} and is {entry.value:.4g}"
        if worse < -before.noise:
            lines.append(f"{figures}: better")
        elif not worse <= before.noise:  # not a number is worse, too
            foreign = before.speed and before.machine != where
            lines.append(f"{figures}: {f'measured on {before.machine}' if foreign else 'FALLS BEHIND'}")
            if not foreign:
                behind.append(row)
    lines += [f"{name}: {row} is missing" for row in baseline if row not in now]
    return Held(lines, behind)


def entries(rows: Iterable[dict[str, Any]], where: str) -> dict[str, Entry]:
    """Those rows that belong into a baseline."""
    found = {row["name"]: Entry.of(row, where) for row in rows}
    return {name: entry for name, entry in found.items() if entry is not None}


def as_json(baseline: dict[str, dict[str, Entry]]) -> dict[str, dict[str, dict[str, Any]]]:
    """A baseline, by benchmark and row, as it lies in its file."""
    return {name: {row: asdict(entry) for row, entry in own.items()} for name, own in sorted(baseline.items())}


def from_json(document: dict[str, dict[str, dict[str, Any]]]) -> dict[str, dict[str, Entry]]:
    """The reverse."""
    return {name: {row: Entry(**entry) for row, entry in own.items()} for name, own in document.items()}


def machine() -> str:
    """The type of this machine: processor and number of cores."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{models[0] if models else platform.machine()}, {os.cpu_count()} cores"


def _better(goal: str | None, unit: str) -> str | float | None:
    if goal is None:
        return LOWER if unit in _ERRORS else None
    if " to " in goal:
        low, high = map(float, goal.split(" to "))
        return (low + high) / 2
    return HIGHER if goal.startswith(">=") else LOWER
