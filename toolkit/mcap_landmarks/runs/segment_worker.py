"""What a worker does with one segment of a log: the results of one stage between two log times, as a file."""

from dataclasses import replace
from pathlib import Path

from mcap_landmarks.errors import RecordingError
from mcap_landmarks.progress import Watch, unwatched
from mcap_landmarks.runs.plan import plan
from mcap_landmarks.runs.segment_jobs import job_of
from mcap_landmarks.runs.segmented_stage import write_segment
from mcap_landmarks.runs.session import open_session
from mcap_landmarks.runs.stage_input import StageInput


def run_segment(text: str, target: Path, watch: Watch = unwatched) -> None:
    """Make the results of the segment that the text of a `SegmentJob` tells of.

    Raises:
        RecordingError: the log, a file or the program is not what it was when the segment was planned.
        ToolkitError: the log or a file cannot be used; nothing is left behind.
    """
    job = job_of(text)
    with open_session(job.request, target.parent, None) as session:
        (step,) = plan(session.request, session.log, [job.stage])
        if step.record.key != job.key:
            raise RecordingError(
                f"{job.request.recording}: the log, the network or the program changed since the log was cut into "
                "segments, or is another where the worker runs; run the command again"
            )
        span = replace(session.request.span, start_ns=job.start_ns, end_ns=job.end_ns)
        log = StageInput(step.stage, session.log_for(step.record), span, session.examiner)
        write_segment(job, step, log, target, watch)
