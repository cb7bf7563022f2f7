"""Localize one moment of a recording: the answer that the whole run has for the bundle nearest to it."""

import contextlib
import dataclasses
import tempfile
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path

from mcap_landmarks.channels import MATCH, POSE, POSE_COVARIANCE
from mcap_landmarks.errors import UsageError
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.match import LandmarkMatch
from mcap_landmarks.moments import moment
from mcap_landmarks.progress import Watch, unwatched
from mcap_landmarks.recording.time_association import WINDOW_NS
from mcap_landmarks.runs.bundles import Reading
from mcap_landmarks.runs.needed_stages import missing_stages
from mcap_landmarks.runs.plan import Request, Step, plan
from mcap_landmarks.runs.session import Session, open_session
from mcap_landmarks.runs.stage_input import StageInput
from mcap_landmarks.runs.stage_runner import naming
from mcap_landmarks.stage import Omission, Stamped
from mcap_landmarks.stages import find_stage

_LOCALIZE = "localize"


@dataclass(slots=True)
class Answer:
    """What localization says of one bundle: its match and, where localized, pose (3,) and covariance (3, 3).

    The thesis's method has no covariance; its pose then has no heading either.
    """

    stamp_ns: int
    match: LandmarkMatch
    pose: Array | None = None
    covariance: Array | None = None


def localize_at(request: Request, time_ns: int, watch: Watch = unwatched) -> tuple[Answer, Reading]:
    """The answer for the bundle nearest to a time, from everything that the span holds before it.

    Where the log lacks scene objects and results, they are made of what is before that time, and not kept.

    Raises:
        UsageError: no bundle is within 2 s of that time, or a setting or file is missing or wrong.
        RecordingError: the recording has no scene objects and nothing to make them from.
    """
    with tempfile.TemporaryDirectory(prefix="mcap-landmarks-") as folder:
        parts = Path(folder)
        with open_session(request, parts, None) as session:
            before = missing_stages(find_stage(_LOCALIZE), session.log, request.use)
            if set(before) <= set(session.log.results):
                return _localized(session, before, time_ns, watch)
        end_ns = time_ns + 2 * WINDOW_NS
        span = dataclasses.replace(request.span, end_ns=min(request.span.end_ns or end_ns, end_ns))
        with open_session(dataclasses.replace(request, span=span), parts, None) as session:
            return _localized(session, before, time_ns, watch)


def _localized(session: Session, before: list[str], time_ns: int, watch: Watch) -> tuple[Answer, Reading]:
    *steps, last = plan(session.request, session.log, [*before, _LOCALIZE])
    for step in steps:
        session.work(step, watch)
    log = StageInput(last.stage, session.log_for(last.record), session.request.span, session.examiner)
    nearest: Answer | None = None
    with contextlib.closing(_results(last, log, watch)) as results:
        for answer in _answers(results):
            if nearest is None or abs(answer.stamp_ns - time_ns) < abs(nearest.stamp_ns - time_ns):
                nearest = answer
            if answer.stamp_ns > time_ns + WINDOW_NS:
                break
    if nearest is None or abs(nearest.stamp_ns - time_ns) > WINDOW_NS:
        known = "there is none at all" if nearest is None else f"the nearest is at {moment(nearest.stamp_ns)}"
        raise UsageError(f"{session.log.path}: no bundle within 2 s of {moment(time_ns)}; {known}")
    return nearest, log.reading


def _results(step: Step, log: StageInput, watch: Watch) -> Generator[Stamped | Omission, None, None]:
    with watch(f"{step.stage.name} {log.path.name}", log.count, "bundles") as progress:
        try:
            yield from naming(log.path, step.stage.process(log.bundles(progress), step.config, step.files))
        finally:
            log.close()


def _answers(results: Iterator[Stamped | Omission]) -> Iterator[Answer]:
    """One answer per match among the results, whole with the pose that follows it."""
    answer: Answer | None = None
    for result in results:
        if isinstance(result, Omission):
            continue
        if match := result.get(MATCH):
            if answer is not None:
                yield answer
            answer = Answer(match.stamp_ns or result.log_time_ns, match)
        elif answer is not None and (pose := result.get(POSE)):
            answer.pose = pose.pose
        elif answer is not None and (posed := result.get(POSE_COVARIANCE)):
            answer.covariance = posed.planar_covariance
    if answer is not None:
        yield answer
