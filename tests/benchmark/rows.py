"""One row of a benchmark, and how a benchmark prints its rows."""

import argparse
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from rich.console import Console
from rich.table import Table


@dataclass(frozen=True, slots=True)
class Row:
    """A measured value, the bounds it should keep (either may be None), the cases behind it, and others' values."""

    name: str
    value: float
    unit: str = ""
    at_least: float | None = None
    at_most: float | None = None
    cases: int | None = None
    peers: dict[str, float] = field(default_factory=dict)

    @property
    def goal(self) -> str | None:
        """The bounds in words; None for a figure without a goal."""
        if self.at_least is not None and self.at_most is not None:
            return f"{self.at_least:g} to {self.at_most:g}"
        if self.at_least is not None:
            return f">= {self.at_least:g}"
        return None if self.at_most is None else f"<= {self.at_most:g}"

    @property
    def holds(self) -> bool | None:
        """Whether the value keeps its bounds (a value that is not a number never does); None without a goal."""
        if self.goal is None:
            return None
        low = float("-inf") if self.at_least is None else self.at_least
        high = float("inf") if self.at_most is None else self.at_most
        return low <= self.value <= high

    def as_json(self) -> dict[str, object]:
        """The row as design.md's JSON."""
        return {
            "name": self.name,
            "value": self.value,
            "unit": self.unit,
            "goal": self.goal,
            "holds": self.holds,
            "cases": self.cases,
            "peers": self.peers,
        }


def main(measure: Callable[..., Iterable[Row]], description: str, *options: argparse.ArgumentParser) -> int:
    """Run `measure(quick)` as the command line asks and print its rows; 1 if one of them misses its goal.

    `options` are parsers without help of options that `measure` takes by name.
    """
    parser = argparse.ArgumentParser(description=description, parents=options)
    parser.add_argument("--json", action="store_true", help="print a list of rows instead of a table")
    parser.add_argument("--quick", action="store_true", help="fewer cases, within ten minutes")
    arguments = vars(parser.parse_args())
    as_json = arguments.pop("json")
    rows = list(measure(**arguments))
    if as_json:
        print(json.dumps([row.as_json() for row in rows], indent=2))
    else:
        Console(width=180).print(_table(rows))
    return int(any(row.holds is False for row in rows))


def _table(rows: list[Row]) -> Table:
    table = Table("name", "value", "unit", "goal", "holds", "cases", "peers", box=None)
    for row in rows:
        peers = ", ".join(f"{name} {value:.4g}" for name, value in row.peers.items())
        holds = {True: "yes", False: "NO", None: ""}[row.holds]
        cases = "" if row.cases is None else f"{row.cases:,}"
        table.add_row(row.name, f"{row.value:.4g}", row.unit, row.goal or "", holds, cases, peers)
    return table
