"""The document of `diff --json` of two drives, as schemas/json/diff_drives.schema.json describes it."""

from typing import Literal, TypedDict

from mcap_landmarks.diff.document import ConditionEntry, ManifestRow, MetricEntry


class DriveEntry(TypedDict):
    """A drive: when it was, None of an empty log, how long, and how far the robot went by its odometry, if any."""

    start_ns: int | None
    end_ns: int | None
    duration_s: float
    distance_m: float | None


class RateEntry(TypedDict):
    """How often a topic has messages, and the gaps: steps of more than three times the median one."""

    messages: int
    rate_hz: float | None
    longest_gap_s: float | None
    gaps: int


class TopicEntry(TypedDict):
    """A topic of either drive, None where a side lacks it."""

    type: str
    baseline: RateEntry | None
    candidate: RateEntry | None


class SpreadEntry(TypedDict):
    """Percentiles of a field's values."""

    count: int
    p5: float
    median: float
    p95: float


class FieldDistance(TypedDict):
    """How a field is distributed in both drives.

    distance: between the drives (Kolmogorov-Smirnov). within: the larger one of those between the halves of each.
    verdict: `alike` where the drives differ no more than that.
    """

    verdict: Literal["alike", "different"]
    distance: float
    within: float
    baseline: SpreadEntry
    candidate: SpreadEntry


class ClassRates(TypedDict):
    """How often a class is found in a drive."""

    per_message: float
    per_minute: float | None
    per_metre: float | None


class ClassEntry(TypedDict):
    """How often a class is found in both."""

    baseline: ClassRates
    candidate: ClassRates


class LandmarkEntry(TypedDict):
    """A landmark that only one side has: class and place in the map of its side."""

    id: str
    class_name: str
    x_m: float
    y_m: float


class LandmarksEntry(TypedDict):
    """The landmarks of both: of two maps those that came and went, of one map those that only one drive saw."""

    one_map: bool
    both: int
    came: list[LandmarkEntry]
    went: list[LandmarkEntry]


class DriveDocument(TypedDict):
    """Everything that was found of two drives."""

    verdict: Literal["two drives"]
    baseline: DriveEntry
    candidate: DriveEntry
    manifest: list[ManifestRow]
    channels: dict[str, TopicEntry]
    fields: dict[str, dict[str, FieldDistance]]
    statuses: dict[str, MetricEntry]
    classes: dict[str, dict[str, ClassEntry]]
    landmarks: LandmarksEntry | None
    metrics: dict[str, MetricEntry]
    conditions: list[ConditionEntry]
