"""Stages over one recording: their results as new channels beside the input's messages."""

from collections.abc import Sequence
from dataclasses import dataclass

from mcap_landmarks.locations import Location
from mcap_landmarks.manifest import Outcome
from mcap_landmarks.maps.database import read_map
from mcap_landmarks.progress import Watch, unwatched
from mcap_landmarks.runs.clock_refusal import clock_notes
from mcap_landmarks.runs.needed_stages import in_order, missing_stages
from mcap_landmarks.runs.output_writer import write_output
from mcap_landmarks.runs.outputs import no_empty_folder, output_files
from mcap_landmarks.runs.plan import Request, check_cameras, plan
from mcap_landmarks.runs.replacing import check_apart, check_replaceable, earlier_recording
from mcap_landmarks.runs.session import StageRun, open_session, parts_folder
from mcap_landmarks.stages import find_stage


@dataclass(frozen=True, slots=True, repr=False)
class LogRun:
    """What became of one log: where the output is, what each stage did, and what is to be said about the log."""

    recording: Location
    output: Location
    stages: tuple[StageRun, ...]
    notes: tuple[str, ...] = ()
    losses: tuple[str, ...] = ()

    def __repr__(self) -> str:
        stages = ", ".join(f"{run.stage} {run.state}" for run in self.stages)
        return f"<LogRun of {self.recording}: {self.output}; {stages}>"

    @property
    def outcome(self) -> Outcome:
        """What came of the last stage."""
        return self.stages[-1].outcome


def run_stages(
    request: Request,
    output: Location,
    names: Sequence[str],
    verb: str,
    watch: Watch = unwatched,
    *,
    lacking: bool = False,
) -> LogRun:
    """Run exactly these stages over a log, in their order; results that are there already are reused.

    `lacking` puts those before them whose results they need and the log does not have as its own.

    Raises:
        ToolkitError: input or output cannot be used; of the output nothing is left behind.
    """
    names = in_order(names)
    check_apart([output], request.reads())
    with parts_folder(output) as parts, open_session(request, parts, output) as session:
        inputs = [session.log.recording.fingerprint()]
        check_replaceable(output, earlier_recording(verb, inputs), overwrite=request.overwrite)
        if lacking:
            use = (*session.request.use, *names)
            before = [other for name in names for other in missing_stages(find_stage(name), session.log, use)]
            names = in_order([*before, *names])
        check_cameras(session.request, session.log, names)
        steps = plan(session.request, session.log, names)
        check_apart([output], [file for step in steps for file in step.files.values()])
        for step in steps[1:]:  # a map that is none is refused before hours are spent on what comes before
            if "map" in step.files:
                read_map(step.files["map"])
        clocks = [] if session.has_all(steps) else clock_notes(session, steps)  # which reads the log
        runs = [session.work(step, watch) for step in steps]
        notes, losses = write_output(session, output, verb, inputs, watch)
        return LogRun(request.recording, output, tuple(runs), *told(runs, [*notes, *clocks], losses))


def run_logs(
    requests: Sequence[Request],
    output: Location,
    names: Sequence[str],
    verb: str,
    watch: Watch = unwatched,
    *,
    lacking: bool = False,
) -> list[LogRun]:
    """`run_stages` over every log, to files as `output_files` names them; raises the same."""
    with no_empty_folder(output):
        targets = output_files([request.recording for request in requests], output)
        check_apart(targets.values(), [place for request in requests for place in request.reads()])
        return [
            run_stages(request, targets[request.recording], names, verb, watch, lacking=lacking) for request in requests
        ]


def told(
    runs: Sequence[StageRun], notes: Sequence[str], losses: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What is to be said of a log: notes and losses, of its stages and beside them, each once."""
    noted = [note for run in runs for note in run.outcome.notes]
    lost = [loss for run in runs for loss in run.outcome.losses]
    return tuple(dict.fromkeys([*noted, *notes])), tuple(dict.fromkeys([*lost, *losses]))
