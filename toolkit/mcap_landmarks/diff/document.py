"""The document of `diff --json`, part by part, as schemas/json/diff.schema.json describes it."""

from typing import Literal, TypedDict

Count = Literal["same", "changed", "added", "removed"]
COUNTS: tuple[Count, ...] = ("same", "changed", "added", "removed")


class Counts(TypedDict):
    """How many are the same, changed, only in the candidate and only in the baseline."""

    same: int
    changed: int
    added: int
    removed: int


class Unpaired(TypedDict):
    """How many of a class only one side has."""

    added: int
    removed: int


class Transition(TypedDict):
    """How often which text became which other."""

    baseline: str
    candidate: str
    count: int


class FieldEntry(TypedDict):
    """A field that is beyond its tolerance somewhere; a difference that no number tells is None."""

    changed: int
    largest: float | None
    tolerance: dict[str, float]
    transitions: list[Transition]


class CaseEntry(TypedDict):
    """One difference; the values of the sides are any JSON values."""

    time_ns: int | None
    item: str | None
    field: str
    baseline: object
    candidate: object
    difference: float | None


class ChannelEntry(Counts):
    """What differs in a channel; the counts are of what `unit` says."""

    type: str
    unit: str
    messages: Counts
    classes: dict[str, Unpaired]
    fields: dict[str, FieldEntry]
    worst: list[CaseEntry]


class MetricEntry(TypedDict):
    """A figure of both sides and its change, None where it is unknown."""

    baseline: float | None
    candidate: float | None
    delta: float | None


class ManifestRow(TypedDict):
    """A key whose JSON values differ, None where a side lacks it."""

    key: str
    baseline: object
    candidate: object


class StructureRow(TypedDict):
    """Something that the recordings hold beside their messages' contents, and that differs."""

    what: str
    name: str
    baseline: object
    candidate: object


class ConditionEntry(TypedDict):
    """A condition of `--fail-on`, the figure that it is about, and whether it holds."""

    condition: str
    value: float
    holds: bool


class DiffDocument(TypedDict):
    """Everything that a diff found."""

    verdict: Literal["same", "different"]
    identical: bool
    manifest: list[ManifestRow]
    structure: list[StructureRow]
    channels: dict[str, ChannelEntry]
    metrics: dict[str, MetricEntry]
    alignment: dict[str, float] | None
    conditions: list[ConditionEntry]
