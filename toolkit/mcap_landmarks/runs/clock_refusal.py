"""What the clocks of a log, and its odometry, would do to results: told before work."""

import contextlib
from collections.abc import Sequence

from mcap_landmarks.channels import SCAN, SCENE_OBJECTS, SECOND_SCAN
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.inspection.clock_checks import clock_findings
from mcap_landmarks.inspection.clock_reading import clocks_between
from mcap_landmarks.inspection.finding import Finding
from mcap_landmarks.inspection.time_offsets import OFFSET_ROLES
from mcap_landmarks.inspection.topic_roles import choose
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.runs.plan import Step
from mcap_landmarks.runs.session import Session
from mcap_landmarks.stage import Channel, Connection


def refuse_clocks(session: Session, steps: Sequence[Step]) -> None:
    """Refuse a log whose clocks or odometry would spoil a map, after some steps.

    Raises:
        RecordingError: as it says.
    """
    examined = session.odometry()
    if examined is not None and examined[1].refusal:
        raise RecordingError(f"{session.log.path}: {examined[1].refusal}")
    for found in _problems(session, steps):
        raise RecordingError(f"{session.log.path}: {_words(found)}")


def clock_notes(session: Session, steps: Sequence[Step]) -> list[str]:
    """The same as warnings for a log's notes, where one of its steps reads scene objects."""
    if not any(SCENE_OBJECTS in step.stage.reads for step in steps):
        return []
    return [f"warning: {_words(found)}" for found in _problems(session, steps)]


def _words(found: Finding) -> str:
    return f"{found.topic}: {found.text}; {found.remedy}"


def _problems(session: Session, steps: Sequence[Step]) -> list[Finding]:
    """The problems between odometry and what scene objects come from.

    Ready-made scene objects count themselves, those of ours the scans that they were made of. What was given an offset
    is taken as it is.
    """
    log, choice = session.log, session.request.span.choice
    span, odometry = _span(session), session.odometry()
    if "odometry" in choice.offsets_ns or span is None or odometry is None:
        return []
    seeing: tuple[Channel[Message], ...] = (SCAN, SECOND_SCAN) if _makes_scenes(session, steps) else (SCENE_OBJECTS,)
    own = log.without_results()
    compared = clocks_between(
        own.messages,
        span,
        odometry[:2],
        [(OFFSET_ROLES[channel], one) for channel in seeing for one in _chosen(session, channel)],
        odometry[2],
    )
    return [one for one in clock_findings(compared, choice.offsets_ns) if one.level == "problem"]


def _span(session: Session) -> tuple[int, int] | None:
    """The log times that are read, None where there are no messages."""
    recording, span = session.log.recording, session.request.span
    if recording.start_ns is None or recording.end_ns is None:
        return None
    first_ns, end_ns = recording.start_ns, recording.end_ns + 1
    return max(first_ns, span.start_ns or first_ns), min(end_ns, span.end_ns or end_ns)


def _makes_scenes(session: Session, steps: Sequence[Step]) -> bool:
    """Whether scene objects are results: of the steps, or in the log."""
    results = {entry.connection.topic for layer in session.log.results.values() for entry in layer.channels}
    return SCENE_OBJECTS.topic in results or any(SCENE_OBJECTS in step.stage.writes for step in steps)


def _chosen(session: Session, channel: Channel[Message]) -> tuple[Connection, ...]:
    """The connections of a channel; none where there are none, or several could be meant and none was chosen."""
    with contextlib.suppress(UsageError):
        return choose(session.log.without_results(), channel, session.log.choice)
    return ()
