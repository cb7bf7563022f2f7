"""Conditions on a diff, such as `position.rmse_m > 0.05`: what makes a comparison fail."""

import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from mcap_landmarks.diff.document import COUNTS, DiffDocument, FieldEntry, MetricEntry
from mcap_landmarks.diff.tolerances import nearest
from mcap_landmarks.errors import UsageError

_COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
}
_FORM = re.compile(r"\s*(?P<name>[^\s<>=!]+)\s*(?P<comparison><=|>=|==|!=|<|>)\s*(?P<limit>\S+)\s*")
_UNKNOWN: MetricEntry = {"baseline": None, "candidate": None, "delta": None}
_UNCHANGED: FieldEntry = {"changed": 0, "largest": 0.0, "tolerance": {}, "transitions": []}


@dataclass(frozen=True, slots=True)
class FailCondition:
    """A figure of the diff by name, and what it is compared with."""

    text: str
    name: str
    comparison: str
    limit: float

    def value(self, figures: Mapping[str, float | None]) -> float:
        """The figure.

        Raises:
            UsageError: there is no such figure, or nothing to compute it from.
        """
        if self.name not in figures:
            raise UsageError(f"--fail-on {self.text}: there is no figure {self.name}{nearest(self.name, figures)}")
        value = figures[self.name]
        if value is None:
            raise UsageError(
                f"--fail-on {self.text}: {self.name} is unknown here; metrics need the truth and localized poses"
            )
        return value

    def holds(self, figures: Mapping[str, float | None]) -> bool:
        """Whether it is so; raises as `value`."""
        return _COMPARISONS[self.comparison](self.value(figures), self.limit)


def parse(text: str) -> FailCondition:
    """The condition of a text `NAME > NUMBER`.

    Raises:
        UsageError: the text is none.
    """
    parts = _FORM.fullmatch(text)
    try:
        limit = float(parts["limit"]) if parts else None
    except ValueError:
        limit = None
    if parts is None or limit is None or limit != limit:  # noqa: PLR0124 - NaN compares with nothing
        raise UsageError(f"--fail-on {text}: write NAME > NUMBER, such as 'position.rmse_m > 0.05'")
    return FailCondition(text.strip(), parts["name"], parts["comparison"], limit)


def figures(
    document: DiffDocument, metric_names: Sequence[str], field_names: Mapping[str, Sequence[str]]
) -> dict[str, float | None]:
    """Everything in a diff that a condition may name.

    The candidate's metrics by their own names, `baseline.` and `delta.` before the name for the others;
    `channels.TOPIC.COUNT`, `channels.TOPIC.fields.FIELD.changed` and `.largest`; and the counts over all channels.
    `field_names` are those that were compared, by topic.
    """
    found: dict[str, float | None] = {}
    for name in metric_names:
        values = document["metrics"].get(name, _UNKNOWN)
        found[name] = values["candidate"]
        found[f"baseline.{name}"], found[f"delta.{name}"] = values["baseline"], values["delta"]
    for count in COUNTS:
        found[count] = sum(channel[count] for channel in document["channels"].values())
    for topic, channel in document["channels"].items():
        found.update({f"channels.{topic}.{count}": channel[count] for count in COUNTS})
        for name in field_names[topic]:
            entry = channel["fields"].get(name, _UNCHANGED)
            largest = math.inf if entry["largest"] is None else entry["largest"]
            found[f"channels.{topic}.fields.{name}.changed"] = entry["changed"]
            found[f"channels.{topic}.fields.{name}.largest"] = largest
    return found
