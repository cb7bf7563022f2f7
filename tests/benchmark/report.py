"""What reports cost and how right their verdicts are: `python -m tests.benchmark.report [--json] [--quick]`."""

import sys
from collections.abc import Iterator

from tests.benchmark import report_teams_power
from tests.benchmark.report_page_hour import page_hour
from tests.benchmark.rows import Row, main


def measure(quick: bool) -> Iterator[Row]:
    """All rows; quick: the page of a log of ten minutes, and fewer draws."""
    yield from page_hour(quick)
    yield from report_teams_power.measure(quick)


if __name__ == "__main__":
    sys.exit(main(measure, "What reports cost and how right their verdicts are."))
