"""A comparison of two sets of runs as Markdown, for a pull request."""

import re
from collections.abc import Sequence

from mcap_landmarks.diff.set_document import SetDocument
from mcap_landmarks.diff.set_text import (
    FIGURE_HEAD,
    failures_of,
    figure_cells,
    left_out_of,
    telling,
    worst_of,
)
from mcap_landmarks.wording import counted

_LOGS = 20
"""So many of the worst logs are listed: more make no one wiser in a pull request."""
_UNFIT = re.compile(r"[\0-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
_SIGNS = {"`": "'", "|": "\u00a6"}
"""The two signs that end a code span or a cell of a table, and what is written for them."""


def markdown(document: SetDocument) -> str:
    """The verdict, what failed, the metrics, and the worst logs first.

    Text from logs stands in code spans, where nothing is markup, a mention or a link.
    """
    verdict, pairs = document["verdict"], counted(document["pairs"], "pair")
    partial = ", **of a part of the logs**" if document["partial"] else ""
    outcome = "fails" if document["fails"] else "passes"
    parts = [f"### Results: {verdict} ({outcome})", ""]
    parts += [f"Over {pairs} of logs, at {100 * document['confidence']:g} % confidence{partial}.", ""]
    parts += [*_failures(document), *_metrics(document), *_logs(document), *_left_out(document), *_meant(document)]
    return "\n".join(parts).rstrip() + "\n"


def code(text: str) -> str:
    """Text from a log as a code span that fits into a table."""
    plain = _UNFIT.sub(" ", "".join(_SIGNS.get(sign, sign) for sign in text)).strip()
    return f"`{plain or ' '}`"


def _failures(document: SetDocument) -> list[str]:
    lines = [f"- {code(name)}: {code(why)}" for name, why in failures_of(document)]
    return ["What fails:", "", *lines, ""] if lines else []


def _metrics(document: SetDocument) -> list[str]:
    metrics = document["metrics"]
    shown, others = telling(metrics)
    rows = [
        [
            code(name) + ("" if entry["gates"] else " (does not gate)"),
            f"**{entry['verdict']}**" if entry["fails"] else entry["verdict"],
            *figure_cells(entry),
        ]
        for name, entry in ((name, metrics[name]) for name in shown)
    ]
    head = ["metric", "verdict", *FIGURE_HEAD]
    gating = [metrics[name]["note"] for name in shown if metrics[name]["gates"]]
    notes = [note for note in dict.fromkeys(gating) if note]
    if others:
        notes.append(f"the same: {', '.join(map(code, others))}")
    return [*_table(head, rows), *(f"- {note}" for note in notes), *([""] if notes else [])]


def _logs(document: SetDocument) -> list[str]:
    found = [(log["log"], worst) for log in document["logs"] if (worst := worst_of(log)) is not None]
    rows = [[code(log), code(name), *values] for log, (name, *values) in found[:_LOGS]]
    more = [f"and {len(found) - _LOGS} more that got worse.", ""] if len(found) > _LOGS else []
    return [*_table(["worst logs", "metric", "baseline", "candidate", "change"], rows), *more] if rows else []


def _left_out(document: SetDocument) -> list[str]:
    rows = [[code(name), why] for name, why in left_out_of(document)]
    errors = [f"- {code(one['error'])}" for one in document["broken"]]
    return [*_table(["no pair of their own", "why"], rows), *errors, *([""] if errors else [])] if rows else []


def _meant(document: SetDocument) -> list[str]:
    rows = [
        [code(row["key"]), code(_short(row["baseline"])), code(_short(row["candidate"])), str(row["logs"])]
        for row in document["manifest"]
    ]
    return _table(["meant to differ", "baseline", "candidate", "logs"], rows) if rows else []


def _short(value: object) -> str:
    text = "-" if value is None else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    ruler = [":--", *["--:"] * (len(head) - 1)]
    return [*(f"| {' | '.join(row)} |" for row in (head, ruler, *rows)), ""]
