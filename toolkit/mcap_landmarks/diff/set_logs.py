"""The logs of a set of runs: of a folder or a catalogue, what was blessed, and the truth that others have for them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from mcap_landmarks.catalogue.catalogue_file import is_catalogue
from mcap_landmarks.catalogue.last_runs import last_runs
from mcap_landmarks.diff.blessed import BLESSED, BlessedLog, read_blessed
from mcap_landmarks.diff.log_figures import ReadLog, log_figures, read_log
from mcap_landmarks.diff.paired_logs import pair_logs
from mcap_landmarks.errors import RecordingError, ToolkitError, UsageError
from mcap_landmarks.evaluation.metrics import Reference
from mcap_landmarks.evaluation.read import read_reference
from mcap_landmarks.locations import Location, address, files_in, is_folder, is_there, size_of
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.reader import open_recording

_SUFFIX = ".mcap"


@dataclass(frozen=True, slots=True)
class SetLog:
    """A log of a set: a file, or what was blessed of one; `error` says why it cannot be read."""

    name: str
    path: Location | None = None
    fingerprint: str | None = None
    blessed: BlessedLog | None = None
    error: str | None = None


def is_set(place: Location) -> bool:
    """Whether a place holds a set of logs: a folder, or a catalogue of what a batch wrote."""
    return is_catalogue(place) or is_folder(place)


def check_sets(*places: Location) -> None:
    """Refuse what is no set, where sets are compared.

    Raises:
        UsageError: one is none.
        RecordingError: one that could be a catalogue is none: then the other need not be the wrong one.
    """
    wrong = [place for place in places if not is_set(place)]
    if wrong:
        for place in filter(is_catalogue, places):
            last_runs(place)
        raise UsageError(f"{wrong[0]}: is no folder and no catalogue; compare two sets of logs, or two files")


def logs_in(folder: Location) -> list[SetLog]:
    """The logs of a folder by name, those in its folders too; where it has blessed results, these.

    Of a catalogue, the logs that the last run of each wrote; those that are gone have an error.

    Raises:
        ToolkitError: there are none, or the blessed ones cannot be read.
    """
    if is_catalogue(folder):
        return _catalogued(folder)
    if is_there(folder / BLESSED):
        return [SetLog(log.name, fingerprint=log.fingerprint, blessed=log) for log in read_blessed(folder / BLESSED)]
    files = _below(folder, _SUFFIX)
    if not files:
        maps = [str(path) for path in _below(folder, ".db").values()]
        remedy = f"compare maps such as {maps[0]} one by one" if maps else "name a folder of results"
        raise UsageError(f"{folder}: holds neither logs (*{_SUFFIX}) nor {BLESSED}; {remedy}")
    return [_listed(path, PurePosixPath(name).with_suffix("").as_posix()) for name, path in files.items()]


def _catalogued(place: Location) -> list[SetLog]:
    """The logs that the last run of each log in a catalogue wrote."""
    runs = [run for run in last_runs(place) if run.output is None or run.output.suffix == _SUFFIX]
    if not runs:
        raise UsageError(f"{place}: has no runs that wrote logs (*{_SUFFIX}); maps are compared one by one")
    return [SetLog(run.name, error=run.error) if run.output is None else _listed(run.output, run.name) for run in runs]


def maps_in(place: Location) -> list[str]:
    """The names of the landmark databases in a folder or a catalogue, which no set is compared by."""
    if is_catalogue(place):
        found = [run.output.name for run in last_runs(place) if run.output is not None and run.output.suffix == ".db"]
        return sorted(found)
    return sorted(path.name for path in _below(place, ".db").values())


def set_size(place: Location) -> int:
    """Bytes of all logs of a set."""
    if is_catalogue(place):
        return sum(size_of(run.output) for run in last_runs(place) if run.output is not None)
    return sum(size_of(path) for path in _below(place, _SUFFIX).values())


def _below(folder: Location, suffix: str) -> dict[str, Location]:
    """The files of a suffix in a folder and its folders, by their paths from there; hidden ones are left out."""
    if isinstance(folder, Path):
        paths = (path for path in sorted(folder.rglob(f"*{suffix}")) if path.is_file())
        found: dict[str, Location] = {path.relative_to(folder).as_posix(): path for path in paths}
    else:
        begin = len(address(folder)) + 1
        found = {address(file)[begin:]: file for file in files_in(folder) if file.suffix == suffix}
    return {name: path for name, path in found.items() if not path.name.startswith(".")}


def _listed(path: Location, name: str) -> SetLog:
    try:
        with open_recording(path) as recording:
            return SetLog(name, path, recording.fingerprint())
    except ToolkitError as error:
        return SetLog(name, path, error=str(error))


def read_whole(log: SetLog, progress: Progress | None = None) -> ReadLog | BlessedLog:
    """What a log holds.

    Raises:
        ToolkitError: it has no results, or cannot be read to its end: figures of a part are not those of the whole.
    """
    if log.blessed is not None:
        return log.blessed
    if log.path is None or log.error is not None:
        raise RecordingError(log.error or f"{log.name}: cannot be read")
    found = read_log(log.path, progress)
    if found.losses:
        raise RecordingError(f"{log.path}: {'; '.join(found.losses)}")
    return found


class Truths:
    """The truth that `reference` has, in a file for all logs or in a folder of logs; of nothing without one."""

    def __init__(self, reference: Location | None) -> None:
        self._known: Reference | None = Reference()
        self._logs: list[SetLog] = []
        if reference is not None and is_set(reference):
            self._logs = logs_in(reference)
        elif reference is not None:
            self._known, losses = read_reference(reference)
            if losses:
                raise RecordingError(f"{reference}: {'; '.join(losses)}")

    def of(self, log: SetLog) -> Reference:
        """The truth for a log.

        Raises:
            ToolkitError: the log that has it cannot be read.
        """
        pairs = pair_logs([log], self._logs)
        found = self._logs[pairs[0].candidate].path if pairs else None
        if found is None:
            return self._known or Reference()
        return read_reference(found)[0]


def blessed_logs(folder: Location, reference: Location | None, progress: Progress | None = None) -> list[BlessedLog]:
    """What can be blessed of a set of results: all of it.

    Raises:
        ToolkitError: a log cannot be read whole, or has no results.
    """
    truths, found = Truths(reference), []
    for log in logs_in(folder):
        read = read_whole(log, progress)
        if isinstance(read, ReadLog):
            figures = log_figures(read, read.truth.over(truths.of(log)))
            read = BlessedLog(log.name, log.fingerprint, read.manifest, figures)
        found.append(read)
    return found


def figures_of(
    logs: Sequence[SetLog], read: Sequence[ReadLog | BlessedLog], truths: Truths
) -> list[dict[str, float | None]]:
    """The figures of a pair of logs; if they are of one recording, each has the other's truth where it lacks its own.

    Raises:
        ToolkitError: the truth of `truths` cannot be read.
    """
    own = [one.truth if isinstance(one, ReadLog) else Reference() for one in read]
    if logs[0].fingerprint == logs[1].fingerprint:
        own = [own[0].over(own[1]), own[1].over(own[0])]
    return [
        log_figures(one, truth.over(truths.of(log))) if isinstance(one, ReadLog) else dict(one.figures)
        for log, one, truth in zip(logs, read, own, strict=True)
    ]
