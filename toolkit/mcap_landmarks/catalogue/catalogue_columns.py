"""The columns of a catalogue, with what each holds; docs/catalogue.md tells them to users."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Literal

Kind = Literal["text", "integer", "number", "time"]
Value = str | int | float | datetime | None
Row = dict[str, Value]

_FIGURES: dict[str, Kind] = {
    **dict.fromkeys(("messages", "lost", "images", "detections", "bundles", "localized"), "integer"),
    **dict.fromkeys(("ambiguous", "too_few_objects", "no_match", "inconsistent", "weak_geometry"), "integer"),
    **dict.fromkeys(("landmarks", "tentative", "eligible", "scored", "false_count"), "integer"),
    **dict.fromkeys(("false_share", "rmse_m", "median_m", "p95_m", "max_m", "within_0_2_m", "within_1_m"), "number"),
    **dict.fromkeys(("heading_rmse_deg", "heading_median_deg", "nees", "rpe_m", "map_rmse_m"), "number"),
    **dict.fromkeys(("map_matched", "map_missing", "map_spurious"), "integer"),
}
COLUMNS: dict[str, Kind] = {
    **dict.fromkeys(("log", "output", "verb", "outcome"), "text"),
    "started": "time",
    "position": "integer",
    **dict.fromkeys(("fingerprint", "run_key", "settings"), "text"),
    **_FIGURES,
    "seconds": "number",
    **dict.fromkeys((f"seconds_{stage}" for stage in ("detect", "tags", "cluster", "fuse")), "number"),
    **dict.fromkeys(("seconds_build_map", "seconds_localize"), "number"),
    **dict.fromkeys(("peak_memory_bytes", "attempts", "exit_code"), "integer"),
    **dict.fromkeys(("errors", "notes", "toolkit_version"), "text"),
}
"""Every column that a catalogue has; those of other stages' seconds come behind them."""
FIGURES = tuple(_FIGURES)
NEEDED: tuple[str, ...] = ("log", "output", "verb", "outcome", "started")
"""Without these a table is no catalogue; a selection of rows or of the other columns is one still."""


@dataclass(frozen=True, slots=True)
class Catalogue:
    """The rows of a catalogue, each with a value or None for every column."""

    columns: Mapping[str, Kind]
    rows: Sequence[Row]

    def with_rows(self, rows: Iterable[Row]) -> "Catalogue":
        """The table with rows behind its own, and the columns that either has: what a row has not, is None."""
        added = list(rows)
        more = sorted({name for row in added for name in row} - COLUMNS.keys() - self.columns.keys())
        columns: dict[str, Kind] = {**COLUMNS, **self.columns, **dict.fromkeys(more, "number")}
        columns.update(COLUMNS)
        return Catalogue(columns, [{name: row.get(name) for name in columns} for row in [*self.rows, *added]])
