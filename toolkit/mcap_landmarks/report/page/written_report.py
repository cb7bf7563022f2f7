"""A report from files to a file: which page it is, reading, and writing it."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from mcap_landmarks.atomic import atomic_file, check_target
from mcap_landmarks.errors import UsageError
from mcap_landmarks.evaluation.metrics import Reference
from mcap_landmarks.evaluation.read import read_reference
from mcap_landmarks.locations import Location
from mcap_landmarks.progress import Progress
from mcap_landmarks.report.page.paged_result import read_result
from mcap_landmarks.report.page.result_page import MadePage, result_page
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


def check_report(output: Location) -> None:
    """Refuse what cannot become a page.

    Raises:
        UsageError: the output's name is not of a page or it cannot be written.
    """
    check_target(output)
    if output.suffix.lower() not in _ENDINGS:
        raise UsageError(f"{output}: a report is a page; use a name that ends with .html")


def written_report(
    results: Sequence[Location],
    output: Location,
    reference: Location | None = None,
    *,
    aligned: bool = False,
    progress: Progress | None = None,
) -> WrittenReport:
    """Read results and write their page.

    Raises:
        ToolkitError: a result or the reference cannot be read, or the page cannot be written.
    """
    truth, lost = read_reference(reference) if reference is not None else (Reference(), [])
    losses = [f"{reference}: {loss}" for loss in lost]
    mark = picture_mark("report", results)
    names = names_of(results)
    result = read_result(results[0], names[0], truth, aligned=aligned, progress=progress)
    losses += [f"{result.path}: {loss}" for loss in result.losses]
    page = result_page(result, mark)
    with atomic_file(output) as stream:
        stream.write(page.content)
    return WrittenReport("page", names, page, tuple(losses))


def names_of(results: Sequence[Location]) -> tuple[str, ...]:
    """What results are called: their file names, with the folder before it where two have the same name."""
    counts = Counter(path.name for path in results)
    return tuple(path.name if counts[path.name] == 1 else "/".join(str(path).split("/")[-2:]) for path in results)
