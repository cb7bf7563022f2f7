"""One log under work: results are taken from where they lie, or made and kept beside the output until it is whole."""

import contextlib
import shutil
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from mcap_landmarks.atomic import held
from mcap_landmarks.channels import DRAWN, ODOMETRY, SHARED
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.inspection.examination import Asked, Examiner
from mcap_landmarks.inspection.log_frames import LogFrames
from mcap_landmarks.inspection.odometry_examination import ExaminedOdometry
from mcap_landmarks.inspection.topic_roles import choose, chosen_before
from mcap_landmarks.locations import Location, is_there
from mcap_landmarks.manifest import Outcome, StageRecord
from mcap_landmarks.mounting import read_extrinsics
from mcap_landmarks.progress import Watch
from mcap_landmarks.recording.layered_log import Layer, LayeredLog, result_layers
from mcap_landmarks.recording.reader import Recording, open_recording
from mcap_landmarks.runs.plan import Request, Step
from mcap_landmarks.runs.recorded_log import RecordedLog
from mcap_landmarks.runs.segmented_stage import run_in_segments
from mcap_landmarks.runs.stage_input import StageInput
from mcap_landmarks.runs.stage_runner import run_stage


@dataclass(frozen=True, slots=True)
class StageRun:
    """What became of one stage: `state` is `ran` or `reused`, `reason` says why, in words; `seconds` it ran."""

    stage: str
    state: str
    reason: str
    outcome: Outcome
    seconds: float | None = None


@contextlib.contextmanager
def parts_folder(output: Location) -> Iterator[Path]:
    """Where finished stages lie until the output is whole: `.OUTPUT.parts`, which goes when the block ends well.

    That of an output elsewhere lies in the cache folder, see `remote.staged_outputs`.

    When it does not, what is finished stays for the next run. No other process can work on the output meanwhile.

    Raises:
        UsageError, RecordingError: the output cannot be written, or another process writes it.
    """
    with held(output) as path:
        folder = path.with_name(f".{path.name}.parts")
        is_whole = False
        try:
            yield folder
            is_whole = True
        finally:
            if folder.is_dir() and (is_whole or not any(folder.iterdir())):
                shutil.rmtree(folder, ignore_errors=True)


def part_file(folder: Path, record: StageRecord) -> Path:
    """The file for the results of a record, in a folder that is there then.

    Raises:
        RecordingError: the folder cannot be made.
    """
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise RecordingError(
            f"{folder}: cannot be made ({error.strerror}); choose another place to write to"
        ) from error
    return folder / record.file_name


@contextlib.contextmanager
def open_session(request: Request, parts: Path, output: Location | None) -> Iterator["Session"]:
    """One log to work on, with the results that lie in the log, in an earlier `output` and among the `parts`.

    Where the request chooses no images, those count that results in the log were made of.

    Raises:
        RecordingError: the log cannot be read.
    """
    with ExitStack() as stack:
        recording = stack.enter_context(open_recording(request.recording))
        asked = _with_images(request, recording)
        yield Session(stack, asked, RecordedLog(recording, asked.span), parts, output)


def _with_images(request: Request, recording: Recording) -> Request:
    """A request that chooses the images that results in the log were made of, unless it chooses its own."""
    choice = request.span.choice
    if choice.images or "image" in choice.topics:
        return request
    records = [layer.record for layer in result_layers(recording).values()]
    before = chosen_before(recording, [record.options for record in records if record is not None])
    chosen = replace(choice, topics={**choice.topics, **before.topics}, images=before.images)
    return replace(request, span=replace(request.span, choice=chosen))


class Session:
    """One log and its results so far; made by `open_session`."""

    def __init__(
        self, stack: ExitStack, request: Request, log: RecordedLog, parts: Path, output: Location | None
    ) -> None:
        self.request, self.log = request, log
        self.results = dict(log.results)
        self.of_this_run: set[str] = set()
        extrinsics = request.files.get("extrinsics")
        own = read_extrinsics(extrinsics) if extrinsics is not None else ()
        self.examiner = Examiner(request.span.start_ns, request.span.end_ns, own)
        self._stack, self._parts = stack, parts
        self.earlier: Recording | None = None
        self._stores: list[tuple[str, dict[str, Layer]]] = [("the log", log.results)]
        if output is not None and is_there(output):
            with contextlib.suppress(RecordingError):  # what is no recording has no results
                self.earlier = self._open(output)
                self._stores.append(("the earlier output", result_layers(self.earlier)))

    def log_for(self, record: StageRecord) -> LayeredLog:
        """What a stage can read: the log, with the results that its record says it reads."""
        read = [self.results[name] for name in sorted(record.inputs) if name in self.results]
        topics = {entry.connection.topic for layer in read for entry in layer.channels}
        return self.log.layered([self.own_without(topics), *read])

    def odometry(self) -> tuple[str, ExaminedOdometry, LogFrames] | None:
        """The topic of the log's odometry, what can be used of it, and the log's frames; None where there is none."""
        own = self.log.without_results()
        with contextlib.suppress(UsageError):  # stages say so
            inputs = dict.fromkeys(choose(own, ODOMETRY, self.request.span.choice), ODOMETRY)
            if inputs:
                first = next(iter(inputs))
                examined = self.examiner.examine(own, Asked(inputs, first))
                if examined.odometry is not None:
                    return first.topic, examined.odometry, examined.frames
        return None

    def work(self, step: Step, watch: Watch) -> StageRun:
        """The results of a step: found, or made now."""
        found = None if self.request.force else self.find(step.record)
        if found is not None:
            return found
        name, reason = step.stage.name, self._why(step.record)
        self._check_files(step, reason)
        target = part_file(self._parts, step.record)
        began = time.perf_counter()
        log = StageInput(step.stage, self.log_for(step.record), self.request.span, self.examiner)
        with watch(f"{name} {self.log.path.name}", log.count, "bundles") as progress:
            run = run_stage if self._in_one_piece(step) else run_in_segments
            record = run(step, log, self.request, target, progress)
        self._show(result_layers(self._open(target)))
        return StageRun(name, "ran", reason, record.outcome, time.perf_counter() - began)

    def _in_one_piece(self, step: Step) -> bool:
        """Whether this process runs a stage over the whole log."""
        return self.request.segments is None or step.stage.in_segments is None or self.log.has_videos

    def has_all(self, steps: Sequence[Step]) -> bool:
        """Whether no step has to run, since the results of all are there."""
        return not self.request.force and all(self.find(step.record) is not None for step in steps)

    def _check_files(self, step: Step, reason: str) -> None:
        lacking = [name for name in step.stage.resources if name not in step.files]
        if lacking:
            raise UsageError(
                f"{self.log.path}: {step.stage.name} has to run anew ({reason}), and nothing tells where the "
                f"{lacking[0]} is that made what the log holds; give --{lacking[0]} FILE"
            )

    def find(self, record: StageRecord) -> StageRun | None:
        """The results with the key of a record, taken from where they lie; None if they lie nowhere."""
        unfinished = self._results_in(self._parts / record.file_name)
        for place, layers in [("what an unfinished run left", unfinished), *self._stores]:
            layer = layers.get(record.stage)
            known = layer.record if layer is not None else None
            if layer is not None and known is not None and known.key == record.key and not known.is_cut:
                self._show({record.stage: layer})
                return StageRun(record.stage, "reused", f"the same results are in {place}", known.outcome)
        return None

    def _results_in(self, path: Path) -> dict[str, Layer]:
        """The results in a file, none if it is no recording."""
        if path.is_file():
            with contextlib.suppress(RecordingError):
                return result_layers(self._open(path))
        return {}

    def kept_results(self) -> tuple[list[Layer], list[str]]:
        """The results for an output, by stage, and what is to be said of those that are left out.

        These are such as were made from results that are not the ones for the output, and such as lie on a topic that a
        stage of the run writes; of what is only drawn that topic alone. Where only results are asked for, those of the
        run's own stages are meant.
        """
        kept = dict(sorted(self.results.items()))
        if self.request.results_only:
            kept = {name: layer for name, layer in kept.items() if name in self.of_this_run}
        notes = {
            name: f"{name}'s results in the log are on topics that {writer} writes; they are left out"
            for name, writer in _replaced(kept, self.of_this_run).items()
        }
        while stale := _stale(kept, notes):
            left_out = "results in the log were made from results that changed; they are left out"
            notes.update({name: f"{name}'s {left_out}" for name in stale})
        layers, told = _with_one_drawing(
            {name: layer for name, layer in kept.items() if name not in notes}, self.of_this_run
        )
        return layers, [*notes.values(), *told]

    def own_without(self, topics: Collection[str]) -> Layer:
        """The log's own messages, without those on topics that results are on instead."""
        own, gone = self.log.own, {*topics} - SHARED
        return replace(own, channels=tuple(entry for entry in own.channels if entry.connection.topic not in gone))

    def _show(self, layers: Mapping[str, Layer]) -> None:
        self.results.update(layers)
        self.of_this_run.update(layers)

    def _open(self, path: Location) -> Recording:
        return self._stack.enter_context(open_recording(path))

    def _why(self, record: StageRecord) -> str:
        """Why a stage has to run, in words: what became other since the results that there are."""
        if self.request.force:
            return "--force"
        for place, layers in reversed(self._stores):
            layer = layers.get(record.stage)
            if layer is not None and layer.record is not None:
                if layer.record.is_cut and layer.record.key == record.key:
                    return f"the results in {place} are only a part"
                return f"{record.difference(layer.record)} since the results in {place}"
        return "there were no results"


def _replaced(layers: Mapping[str, Layer], of_this_run: Collection[str]) -> dict[str, str]:
    """The stages with results on a topic that a stage of this run writes, with that one: a topic has one writer."""
    writers = {topic: name for name in of_this_run if name in layers for topic in _topics(layers[name])}
    return {
        name: writers[topic]
        for name, layer in layers.items()
        if name not in of_this_run
        for topic in _topics(layer)
        if topic in writers
    }


def _topics(layer: Layer) -> set[str]:
    return {entry.connection.topic for entry in layer.channels} - SHARED - DRAWN


def _drawn(layer: Layer) -> set[str]:
    return {entry.connection.topic for entry in layer.channels} & DRAWN


def _with_one_drawing(layers: Mapping[str, Layer], of_this_run: Collection[str]) -> tuple[list[Layer], list[str]]:
    """Results without what a stage of this run draws on the same topic, and what is to be said of it.

    The record of such results says that they are only a part.
    """
    writers = {topic: name for name, layer in layers.items() if name in of_this_run for topic in _drawn(layer)}
    kept, notes = [], []
    for name, layer in layers.items():
        covered = set[str]() if name in of_this_run else _drawn(layer) & writers.keys()
        notes += [f"{name}'s {topic} in the log is left out: {writers[topic]} writes it, too" for topic in covered]
        left = tuple(entry for entry in layer.channels if entry.connection.topic not in covered)
        part = layer.record and replace(layer.record, is_cut=True)
        kept.append(replace(layer, channels=left, record=part) if covered else layer)
    return kept, notes


def _stale(layers: Mapping[str, Layer], gone: Collection[str]) -> list[str]:
    """The stages whose results were made from results that are gone, or are not the ones that are there."""
    there = {name: layer.record for name, layer in layers.items() if name not in gone and layer.record is not None}
    keys = {name: record.key for name, record in there.items()}
    return [
        name
        for name, record in there.items()
        if any(source in gone or keys.get(source, key) != key for source, key in record.inputs.items())
    ]
