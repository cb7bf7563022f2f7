"""The metadata record of an output that says what of its input is lost."""

from collections.abc import Sequence

from mcap_landmarks.manifest import entry_text

REPORT = "mcap-landmarks.recover"
"""Its name; its entries are JSON texts."""


def loss_report(
    expected: int | None, recovered: int, losses: Sequence[str], more: dict[str, object] | None = None
) -> dict[str, str]:
    """Its entries: the messages that the input tells of, those that are there, what is lost in words, and `more`."""
    told = {"expected": expected, "recovered": recovered, "losses": list(losses), **(more or {})}
    return {name: entry_text(value) for name, value in told.items()}
