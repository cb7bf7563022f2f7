"""How accurate positions are: against the bound and other solvers, in the thesis's own places, on real snapshots."""

import sys
from collections.abc import Iterator

from tests.benchmark.appendix import appendix_rows, centre_rows
from tests.benchmark.positions import position_rows
from tests.benchmark.rows import Row, main
from tests.benchmark.snapshots import snapshot_rows
from tests.shared import data_folder


def measure(quick: bool) -> Iterator[Row]:
    """All rows; those on data that others made are left out where it is missing."""
    yield from position_rows(quick)
    yield from appendix_rows(quick)
    yield from centre_rows(quick)
    data = data_folder()
    if data is not None:
        yield from snapshot_rows(data)


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or ""))
