"""How accurate positions are: against the bound, against other solvers, and on real snapshots."""

import sys
from collections.abc import Iterator

from tests.benchmark.positions import position_rows
from tests.benchmark.rows import Row, main
from tests.benchmark.snapshots import snapshot_rows
from tests.shared import data_folder


def measure(quick: bool) -> Iterator[Row]:
    """All rows; those on data that others made are left out where it is missing."""
    yield from position_rows(quick)
    data = data_folder()
    if data is not None:
        yield from snapshot_rows(data)


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or ""))
