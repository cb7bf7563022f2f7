"""The figures of two runs side by side, each against the truth."""

from collections.abc import Mapping
from functools import partial

from mcap_landmarks.diff.document import MetricEntry
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.evaluation.metrics import NOWHERE, Reference, RunResult, evaluate
from mcap_landmarks.evaluation.read import read_reference, read_run
from mcap_landmarks.evaluation.trajectory import interpolated
from mcap_landmarks.locations import Location
from mcap_landmarks.maps.map_message import scene_from_map
from mcap_landmarks.maps.model import LandmarkMap, MapSource
from mcap_landmarks.messages.match import Status

PAIRING = partial(interpolated, max_gap_ns=500_000_000)  # as evaluate's


def metric_names() -> list[str]:
    """Every figure that there can be, by its dotted name."""
    nothing = scene_from_map(LandmarkMap.surveyed((), (), [], MapSource("reference", "none")), 0)
    statuses = {status.name.lower(): 0 for status in Status}
    document = evaluate(RunResult(NOWHERE, 0, 0, statuses, nothing), Reference(NOWHERE, nothing), PAIRING)
    return [name for name in flat(document) if name != "alignment"]


def metric_rows(
    baseline: Location, candidate: Location, reference: Location | None = None, *, same_recording: bool = False
) -> tuple[dict[str, MetricEntry], list[str]]:
    """The figures of both by name, and what could not be read; no figures unless both have truth and can be evaluated.

    What truth a side lacks it takes from the other, if they are runs of the same recording, else from `reference`.

    Raises:
        RecordingError: the reference cannot be read or holds no truth.
    """
    known, lost = read_reference(reference) if reference else (Reference(), [])
    losses = [f"{reference}: {loss}" for loss in lost]
    try:
        (mine, truth, lost), (theirs, other, more) = read_run(baseline), read_run(candidate)
    except RecordingError:  # poses that are not finite, results of other types: the fields tell, figures cannot
        return {}, losses
    if same_recording:
        truth, other = truth.over(other), other.over(truth)
    truth, other = truth.over(known), other.over(known)
    losses += [f"{baseline}: {loss}" for loss in lost] + [f"{candidate}: {loss}" for loss in more]
    if any(side.trajectory is None and side.objects is None for side in (truth, other)):
        return {}, losses
    return side_by_side(flat(evaluate(mine, truth, PAIRING)), flat(evaluate(theirs, other, PAIRING))), losses


def side_by_side(baseline: Mapping[str, float | None], candidate: Mapping[str, float | None]) -> dict[str, MetricEntry]:
    """The figures that either side has, with their changes."""
    rows: dict[str, MetricEntry] = {}
    for name in {**baseline, **candidate}:
        mine, theirs = baseline.get(name), candidate.get(name)
        delta = theirs - mine if mine is not None and theirs is not None else None
        if mine is not None or theirs is not None:
            rows[name] = {"baseline": mine, "candidate": theirs, "delta": delta}
    return rows


def flat(document: Mapping[str, object], prefix: str = "") -> dict[str, float | None]:
    """The figures of a document by dotted name."""
    found: dict[str, float | None] = {}
    for key, value in document.items():
        if isinstance(value, Mapping):
            found.update(flat(value, f"{prefix}{key}."))
        elif value is None or isinstance(value, int | float):
            found[prefix + key] = value
    return found
