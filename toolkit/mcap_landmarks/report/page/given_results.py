"""The results that a report is asked for: files, and the outputs of a catalogue, each once."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from mcap_landmarks.catalogue.catalogue_file import is_catalogue
from mcap_landmarks.catalogue.last_runs import last_runs
from mcap_landmarks.errors import RecordingError, RemoteError, UsageError
from mcap_landmarks.locations import Location, address
from mcap_landmarks.report.page.fleet_page import UnreadResult


@dataclass(frozen=True, slots=True)
class GivenResults:
    """The files of a report; the outputs of catalogues that are not there; notes on files that were named twice.

    `is_many` says whether it is of many results, even where only one of them is left.
    """

    files: tuple[Location, ...]
    missing: tuple[UnreadResult, ...] = ()
    notes: tuple[str, ...] = ()
    is_many: bool = False


def given_results(places: Sequence[Location], *, is_diff: bool) -> GivenResults:
    """The results behind what a user named; of two that are compared, both as they are.

    Raises:
        UsageError: --diff is of catalogues.
        RecordingError, RemoteError: the only one cannot be read, or has no results.
    """
    catalogues = [place for place in places if is_catalogue(place)]
    if is_diff:
        if catalogues:
            last_runs(catalogues[0])  # which is wrong before it is of many
            raise UsageError(f"--diff is of two results, and {catalogues[0]} is of many; see mcap-landmarks diff")
        return GivenResults(tuple(places))
    files, missing = list[Location](), list[UnreadResult]()
    for place in places:
        if place not in catalogues:
            files.append(place)
            continue
        try:
            outputs, gone = _catalogued(place)
        except (RecordingError, RemoteError) as error:
            if len(places) == 1:
                raise
            outputs, gone = [], [UnreadResult(place.name, str(error))]
        files += outputs
        missing += gone
    once, notes = _each_once(files)
    return GivenResults(tuple(once), tuple(missing), tuple(notes), len(places) > 1 or bool(catalogues))


def _catalogued(place: Location) -> tuple[list[Location], list[UnreadResult]]:
    """The outputs of a catalogue, and those that are not there."""
    runs = last_runs(place)
    outputs = dict.fromkeys(run.output for run in runs if run.output is not None)  # logs of one map share it
    return list(outputs), [UnreadResult(run.name, run.error) for run in runs if run.error is not None]


def _each_once(files: Iterable[Location]) -> tuple[list[Location], list[str]]:
    """Each file as it was named first, and notes on the others."""
    known: dict[str, Location] = {}
    notes = []
    for file in files:
        key = address(file)
        if key in known:
            notes.append(f"{file} was named twice and counts once")
        known.setdefault(key, file)
    return list(known.values()), list(dict.fromkeys(notes))
