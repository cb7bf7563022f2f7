"""The diff of two runs: of two recordings with results, or of two landmark databases."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from mcap_landmarks.channels import ANNOTATIONS
from mcap_landmarks.diff.channel import ChannelDiff
from mcap_landmarks.diff.conditions import FailCondition, figures
from mcap_landmarks.diff.declared import by_topic, manifest_rows, structure_rows
from mcap_landmarks.diff.document import DiffDocument, ManifestRow, MetricEntry, StructureRow
from mcap_landmarks.diff.logs import Topic, compare_messages
from mcap_landmarks.diff.maps import FIELDS, diff_maps
from mcap_landmarks.diff.metric_rows import metric_names, metric_rows
from mcap_landmarks.diff.tolerances import Declared, asked, declared
from mcap_landmarks.errors import UsageError
from mcap_landmarks.evaluation.alignment import transform_document
from mcap_landmarks.evaluation.read import is_database
from mcap_landmarks.locations import Location, size_of
from mcap_landmarks.manifest import RUN
from mcap_landmarks.maps.database import read_manifest, read_map
from mcap_landmarks.messages.annotations import ImageAnnotations
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.reader import Recording, open_recording
from mcap_landmarks.stage import Tolerance


@dataclass(frozen=True, slots=True)
class Diff:
    """The document of `diff --json` (schemas/json/diff.schema.json), and what could not be read."""

    document: DiffDocument
    losses: list[str] = field(default_factory=list)

    @property
    def fails(self) -> bool:
        """Whether a condition holds, or, where none was asked for, anything differs."""
        conditions = self.document["conditions"]
        return any(entry["holds"] for entry in conditions) if conditions else self.document["verdict"] != "same"


def diff(
    baseline: Location,
    candidate: Location,
    tolerances: Sequence[str] = (),
    conditions: Sequence[FailCondition] = (),
    *,
    reference: Location | None = None,
    aligned: bool = False,
    progress: Progress | None = None,
) -> Diff:
    """What changed from baseline to candidate. The verdict is about results: manifests may differ, metrics follow.

    `tolerances` are texts `CHANNEL.FIELD=VALUE`; `reference` has the truth that a side may lack; `aligned` moves the
    candidate's map onto the baseline's.

    Raises:
        ToolkitError: a file cannot be read, they cannot be compared, or a tolerance or condition is wrong.
    """
    databases = [is_database(path) for path in (baseline, candidate)]
    if databases[0] != databases[1]:
        raise UsageError(
            f"{baseline} and {candidate}: one is a landmark database, the other is not; name two of a kind"
        )
    if aligned and not databases[0]:
        raise UsageError("--align moves landmark databases; the results of logs are compared as they stand")
    if databases[0]:
        return _of_maps(baseline, candidate, tolerances, conditions, reference, aligned=aligned)
    return _of_logs(baseline, candidate, tolerances, conditions, reference, progress)


def _of_logs(
    baseline: Location,
    candidate: Location,
    tolerances: Sequence[str],
    conditions: Sequence[FailCondition],
    reference: Location | None,
    progress: Progress | None,
) -> Diff:
    with open_recording(baseline) as mine, open_recording(candidate) as theirs:
        limits: dict[str, dict[str, Tolerance]] = {}
        topics = _topics(mine, theirs, limits)
        names = {name: topic.field_names() for name, topic in topics.items()}
        given = asked(tolerances, names)
        if not conditions and _equal_bytes(baseline, candidate):
            return Diff(_document(_counted(mine), identical=True))
        limits.update(_limits(declared(), given, topics))
        compare_messages(mine, theirs, topics, progress)
        shared = mine.fingerprint() == theirs.fingerprint()
        metrics, losses = metric_rows(baseline, candidate, reference, same_recording=shared)
        document = _document(
            {name: topic.diff for name, topic in topics.items()},
            manifest=manifest_rows(*(recording.metadata.get(RUN, {}) for recording in (mine, theirs))),
            structure=structure_rows(mine, theirs),
            metrics=metrics,
        )
        lost = [*(f"{baseline}: {loss}" for loss in mine.losses), *(f"{candidate}: {loss}" for loss in theirs.losses)]
        return _judged(document, conditions, names, list(dict.fromkeys([*lost, *losses])))


def _of_maps(
    baseline: Location,
    candidate: Location,
    tolerances: Sequence[str],
    conditions: Sequence[FailCondition],
    reference: Location | None,
    *,
    aligned: bool,
) -> Diff:
    ours, given = declared(), asked(tolerances, FIELDS)
    limits = {part: {**ours.get(part, {}), **given.get(part, {})} for part in FIELDS}
    found = diff_maps(read_map(baseline), read_map(candidate), _lookup(limits), aligned=aligned)
    metrics, losses = metric_rows(baseline, candidate, reference)
    moved = found.baseline_from_candidate
    document = _document(
        {"landmarks": found.landmarks, "groups": found.groups},
        manifest=[*found.manifest, *manifest_rows(read_manifest(baseline), read_manifest(candidate))],
        metrics=metrics,
        alignment=None if moved is None else transform_document(moved),
        identical=_equal_bytes(baseline, candidate),
    )
    return _judged(document, conditions, FIELDS, losses)


def _topics(baseline: Recording, candidate: Recording, limits: Declared) -> dict[str, Topic]:
    mine, theirs = by_topic(baseline), by_topic(candidate)
    lookup = _lookup(limits)
    return {
        name: Topic.of(mine.get(name, ()), theirs.get(name, ()), partial(lookup, name))
        for name in sorted({*mine, *theirs})
    }


def _limits(ours: Declared, given: Declared, topics: Mapping[str, Topic]) -> dict[str, dict[str, Tolerance]]:
    """Tolerances by topic and field: what was given, over what the stage that writes the topic declares."""
    found = {}
    for name, topic in topics.items():
        # annotations lie in the namespace of whichever camera they belong to
        own = ANNOTATIONS.topic if topic.ros_type == ImageAnnotations.ROS_TYPE else name
        found[name] = {**ours.get(own, {}), **given.get(name, {})}
    return found


def _lookup(limits: Declared) -> Callable[[str, str], Tolerance]:
    return lambda channel, name: limits.get(channel, {}).get(name, Tolerance())


def _counted(recording: Recording) -> dict[str, ChannelDiff]:
    """All messages of a recording as the same."""
    found: dict[str, ChannelDiff] = {}
    for entry in recording.channels:
        connection = entry.connection
        counted = found.setdefault(connection.topic, ChannelDiff(connection.message_type, lambda _name: Tolerance()))
        counted.messages.same += entry.count
    return dict(sorted(found.items()))


def _document(
    channels: Mapping[str, ChannelDiff],
    *,
    manifest: Sequence[ManifestRow] = (),
    structure: Sequence[StructureRow] = (),
    metrics: Mapping[str, MetricEntry] | None = None,
    alignment: dict[str, float] | None = None,
    identical: bool = False,
) -> DiffDocument:
    differs = bool(structure) or any(channel.differs for channel in channels.values())
    return {
        "verdict": "different" if differs else "same",
        "identical": identical,
        "manifest": list(manifest),
        "structure": list(structure),
        "channels": {name: channel.document() for name, channel in channels.items()},
        "metrics": dict(metrics or {}),
        "alignment": alignment,
        "conditions": [],
    }


def _equal_bytes(baseline: Location, candidate: Location) -> bool:
    if size_of(baseline) != size_of(candidate):
        return False
    with baseline.open("rb") as mine, candidate.open("rb") as theirs:
        while block := mine.read(1 << 20):
            if block != theirs.read(1 << 20):
                return False
    return True


def _judged(
    document: DiffDocument, conditions: Sequence[FailCondition], names: Mapping[str, Sequence[str]], losses: list[str]
) -> Diff:
    if conditions:
        known = figures(document, metric_names(), names)
        document["conditions"] = [
            {"condition": condition.text, "value": condition.value(known), "holds": condition.holds(known)}
            for condition in conditions
        ]
    return Diff(document, losses)
