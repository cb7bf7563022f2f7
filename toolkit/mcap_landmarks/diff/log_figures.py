"""The figures of one log with results that two sets of runs are compared by, with and without truth."""

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mcap_landmarks.channels import DETECTIONS, SCENE_OBJECTS
from mcap_landmarks.diff.criteria import METRICS
from mcap_landmarks.diff.metric_rows import PAIRING, flat
from mcap_landmarks.diff.values import Array
from mcap_landmarks.errors import MessageError, RecordingError
from mcap_landmarks.evaluation.metrics import Reference, RunResult, evaluate
from mcap_landmarks.evaluation.read import read_run
from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import RUN
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.header import count_in
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.reader import Recording, open_recording
from mcap_landmarks.stage import Channel

Values = Mapping[str, float | None]
"""Figures by name, None where there is nothing to compute them from."""


@dataclass(frozen=True, slots=True, eq=False)
class ReadLog:
    """What a log with results holds: the run, its own truth, the recording's fingerprint, the manifest's entries.

    lists: how many items a message has on average, by topic. losses: what could not be read.
    """

    run: RunResult
    truth: Reference
    fingerprint: str
    manifest: Mapping[str, str]
    lists: Values
    losses: tuple[str, ...]


def read_log(path: Location, progress: Progress | None = None) -> ReadLog:
    """Read what is compared of a log.

    Raises:
        ToolkitError: it cannot be read, or has no results.
    """
    run, truth, losses = read_run(path, progress)
    if not run.bundles and not len(run.trajectory) and run.landmarks is None:
        remedy = f"it is damaged ({'; '.join(losses)})" if losses else "run localize on it first"
        raise RecordingError(f"{path}: has no results; {remedy}")
    with open_recording(path) as recording:
        lists = {channel.topic: _items(recording, channel) for channel in (DETECTIONS, SCENE_OBJECTS)}
        losses = list(dict.fromkeys([*losses, *recording.losses]))
        return ReadLog(run, truth, recording.fingerprint(), recording.metadata.get(RUN, {}), lists, tuple(losses))


def log_figures(log: ReadLog, truth: Reference) -> dict[str, float | None]:
    """All of `METRICS` for a log, measured against a truth as `evaluate` does."""
    run = log.run
    known = flat(evaluate(run, truth, PAIRING))
    statuses = run.statuses or {}
    share = {name: count / run.bundles for name, count in statuses.items()} if run.bundles else {}
    known |= {f"status.{name}": value for name, value in share.items()}
    known |= {
        "localized_share": share.get("localized"),
        "sigma_m": _median(_sigmas_m(run)),
        "residual_m": _median(run.residuals_m),
        "detections_per_image": log.lists[DETECTIONS.topic],
        "objects_per_scene": log.lists[SCENE_OBJECTS.topic],
    }
    if truth.trajectory is None:
        known["false.share"] = None
    return {name: known.get(name) for name in METRICS}


def _items(recording: Recording, channel: Channel[Message]) -> float | None:
    """How many items a message of a channel has on average; those that cannot be decoded are left out."""
    connections = [one for one in recording.connections(channel.topic) if one.message_type == channel.message.ROS_TYPE]
    messages, items = 0, 0
    for raw in recording.messages(connections) if connections else ():
        with contextlib.suppress(MessageError):
            items += count_in(raw.data)
            messages += 1
    return items / messages if messages else None


def _sigmas_m(run: RunResult) -> Array:
    """How far off the poses say that they may be, along the longest axis of their ellipses (K,)."""
    spread = run.trajectory.covariances[:, :2, :2]
    known = spread[np.isfinite(spread).all(axis=(1, 2))]
    return np.sqrt(np.linalg.eigvalsh(known)[:, -1].clip(0)) if len(known) else np.zeros(0)


def _median(values: Array) -> float | None:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else None
