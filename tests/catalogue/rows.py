"""Rows of catalogues, for tests."""

from datetime import UTC, datetime, timedelta

from mcap_landmarks.catalogue.catalogue_columns import Row, Value

STARTED = datetime(2026, 3, 1, 12, 0, 0, 250_000, tzinfo=UTC)


def row(log: str, output: str | None, day: int = 0, verb: str = "localize", **values: Value) -> Row:
    """A row of a run on a day."""
    return {
        "log": log,
        "output": output,
        "verb": verb,
        "outcome": "failed" if output is None else "done",
        "started": STARTED + timedelta(days=day),
        **values,
    }
