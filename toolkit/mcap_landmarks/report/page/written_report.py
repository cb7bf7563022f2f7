"""A report from files to a file: which page it is, reading, and writing it."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from mcap_landmarks.atomic import atomic_file, check_target
from mcap_landmarks.diff.comparison import diff
from mcap_landmarks.diff.two_drives import are_two_drives
from mcap_landmarks.errors import RecordingError, ToolkitError, UsageError
from mcap_landmarks.evaluation.metrics import Reference
from mcap_landmarks.evaluation.read import read_reference
from mcap_landmarks.locations import Location
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.report.page.diff_page import diff_page
from mcap_landmarks.report.page.fleet_page import UnreadResult, fleet_page
from mcap_landmarks.report.page.given_results import GivenResults
from mcap_landmarks.report.page.paged_result import PagedResult, read_result
from mcap_landmarks.report.page.result_page import MadePage, result_page
from mcap_landmarks.report.page.stage_seconds import stage_seconds
from mcap_landmarks.runs.replacing import picture_mark

_ENDINGS = (".html", ".htm")


@dataclass(frozen=True, slots=True)
class WrittenReport:
    """What was written: a page of some kind about results with names, and what could not be read of them."""

    kind: str
    names: tuple[str, ...]
    page: MadePage
    losses: tuple[str, ...]

    @property
    def document(self) -> dict[str, object]:
        """What `report --json` prints of it."""
        results = [{"name": name, **count} for name, count in zip(self.names, self.page.counts, strict=True)]
        return {
            "kind": self.kind,
            "bytes": len(self.page.content),
            "results": results,
            "thinned": self.page.thinned,
            "losses": list(self.losses),
        }


def check_report(results: GivenResults, output: Location, *, is_diff: bool, printed: Location | None = None) -> None:
    """Refuse what cannot become a page.

    Raises:
        UsageError: the output's name is not of a page or it cannot be written, or --diff is not of two
            results, or --run not of one.
    """
    check_target(output)
    if output.suffix.lower() not in _ENDINGS:
        raise UsageError(f"{output}: a report is a page; use a name that ends with .html")
    if is_diff and len(results.files) != 2:
        raise UsageError(f"--diff is of two results, BASELINE and CANDIDATE, not of {len(results.files)}; name both")
    if printed is not None and (results.is_many or is_diff):
        raise UsageError("--run is of one result, not of several; leave it out")


def written_report(
    given: GivenResults,
    output: Location,
    reference: Location | None = None,
    *,
    printed: Location | None = None,
    is_diff: bool = False,
    aligned: bool = False,
    progress: Progress | None = None,
) -> WrittenReport:
    """Read results and write their page: of one, of two that are compared, or of many.

    `printed` is what the run of a single result printed with --json.

    Raises:
        ToolkitError: a result or the reference cannot be read, of many all cannot, or the page cannot be written.
    """
    truth, lost = read_reference(reference) if reference is not None else (Reference(), [])
    losses = [f"{reference}: {loss}" for loss in lost]
    results = given.files
    mark, names = picture_mark("report", results), names_of(results)
    read = partial(read_result, reference=truth, aligned=aligned, progress=progress)
    kind = "diff" if is_diff else "table" if given.is_many else "page"
    if kind == "table":
        found, unread = _readable(given, names, partial(read, is_brief=True))
        page = fleet_page(found, unread, mark)
        names = tuple(one.name for one in found)
        losses += [f"{one.name} could not be read: {one.reason}" for one in unread]
    else:
        found = [read(path, name) for path, name in zip(results, names, strict=True)]
        page = _diff(results, found, reference, losses, mark) if is_diff else _single(found[0], mark, printed)
    losses += [f"{one.path}: {loss}" for one in found for loss in one.losses]
    with atomic_file(output) as stream:
        stream.write(page.content)
    return WrittenReport(kind, names, page, tuple(dict.fromkeys(losses)))


def _single(found: PagedResult, mark: str, printed: Location | None) -> MadePage:
    """The page of one result, with what its run printed, if that is given."""
    return result_page(found, mark, stage_seconds(printed, found.path) if printed is not None else {})


def _diff(
    results: Sequence[Location],
    found: Sequence[PagedResult],
    reference: Location | None,
    losses: list[str],
    mark: str,
) -> MadePage:
    """The page of two results; what their diff cannot read is added to the losses."""
    if all(one.is_log for one in found):
        with open_recording(results[0]) as mine, open_recording(results[1]) as theirs:
            if are_two_drives(mine, theirs):
                raise UsageError(
                    f"{results[0]} and {results[1]} are of two drives, which have no bundle in common; "
                    "leave --diff out for a table of both, or see mcap-landmarks diff --drives"
                )
    compared = diff(results[0], results[1], reference=reference)
    losses += compared.losses
    return diff_page(found[0], found[1], compared.document, compared.losses, mark)


def _readable(
    given: GivenResults, names: Sequence[str], read: Callable[[Location, str], PagedResult]
) -> tuple[list[PagedResult], list[UnreadResult]]:
    """The results that can be read, and the others.

    Raises:
        UsageError: there is none that can, since what was asked for makes no sense.
        RecordingError: there is none that can.
    """
    found, unread = list[PagedResult](), list(given.missing)
    wrong = list[UsageError]()
    for path, name in zip(given.files, names, strict=True):
        try:
            found.append(read(path, name))
        except ToolkitError as error:
            unread.append(UnreadResult(name, str(error)))
            wrong += [error] if isinstance(error, UsageError) else []
    if not found and len(wrong) == len(unread):
        raise wrong[0]
    if not found:
        raise RecordingError(f"none of {len(unread)} results can be read, the first because: {unread[0].reason}")
    return found, unread


def names_of(results: Sequence[Location]) -> tuple[str, ...]:
    """What results are called: their file names, with the folder before it where two have the same name."""
    counts = Counter(path.name for path in results)
    return tuple(path.name if counts[path.name] == 1 else "/".join(str(path).split("/")[-2:]) for path in results)
