"""Localize one moment of a recording: the answer that the whole run has for the bundle nearest to it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toolkit.channels import MATCH, POSE, POSE_COVARIANCE
from toolkit.errors import UsageError
from toolkit.geometry.se2 import Array
from toolkit.messages.match import LandmarkMatch
from toolkit.recording.association import WINDOW_NS
from toolkit.recording.blocks import Progress
from toolkit.recording.reader import open_recording
from toolkit.runs.bundles import Reading, Span, inputs_of, read_bundles
from toolkit.stage import Omission, Stage, Stamped


@dataclass(slots=True)
class Answer:
    """What localization says of one bundle: its match and, where localized, pose (3,) and covariance (3, 3).

    The thesis's method has no covariance; its pose then has no heading either.
    """

    stamp_ns: int
    match: LandmarkMatch
    pose: Array | None = None
    covariance: Array | None = None


def localize_at(
    stage: Stage,
    config: Any,
    resources: Mapping[str, Path],
    path: Path,
    span: Span,
    time_ns: int,
    progress: Progress | None = None,
) -> tuple[Answer, Reading]:
    """The answer for the bundle nearest to a time, from everything that the span holds before it.

    Raises:
        UsageError: no bundle is within 2 s of that time.
        RecordingError: the recording has no scene objects.
    """
    reading = Reading()
    with open_recording(path) as recording:
        inputs = inputs_of(recording, stage.reads, stage.reads[:1], span.choice)
        raws = recording.messages(tuple(inputs), span.start_ns, span.end_ns, progress)
        bundles = read_bundles(raws, inputs, stage.reads, reading)
        nearest: Answer | None = None
        for answer in _answers(stage.process(bundles, config, resources)):
            if nearest is None or abs(answer.stamp_ns - time_ns) < abs(nearest.stamp_ns - time_ns):
                nearest = answer
            if answer.stamp_ns > time_ns + WINDOW_NS:
                break
        reading.close(recording.losses)
    if nearest is None or abs(nearest.stamp_ns - time_ns) > WINDOW_NS:
        known = "there is none at all" if nearest is None else f"the nearest is at {nearest.stamp_ns}"
        raise UsageError(f"{path}: no bundle within 2 s of {time_ns}; {known}")
    return nearest, reading


def _answers(results: Iterator[Stamped | Omission]) -> Iterator[Answer]:
    """One answer per match among the results, whole with the pose that follows it."""
    answer: Answer | None = None
    for result in results:
        if isinstance(result, Omission):
            continue
        message: Any = result.message
        if result.channel == MATCH:
            if answer is not None:
                yield answer
            answer = Answer(message.stamp_ns or result.log_time_ns, message)
        elif answer is not None and result.channel == POSE:
            answer.pose = message.pose
        elif answer is not None and result.channel == POSE_COVARIANCE:
            answer.covariance = message.planar_covariance
    if answer is not None:
        yield answer
