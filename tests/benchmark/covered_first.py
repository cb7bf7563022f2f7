"""A pytest plugin for runs of mutants: a given order of tests, bounds, and what the tests took.

`MUTANT_ORDER` names a JSON list of test ids that come first, `MUTANT_SECONDS` is the most processor time of a process,
and `MUTANT_TAKEN` names a file for the processor time of all tests and the seconds of each.
"""

import json
import os
import resource
import time
from collections import defaultdict
from pathlib import Path

import pytest

ORDER, SECONDS, TAKEN = "MUTANT_ORDER", "MUTANT_SECONDS", "MUTANT_TAKEN"
# A mutant that asks for endless memory must not take the machine's; the tests themselves need a tenth.
_MOST_BYTES = 8 * 2**30

_durations: dict[str, float] = defaultdict(float)


def pytest_configure() -> None:
    for what, most in ((resource.RLIMIT_AS, _MOST_BYTES), (resource.RLIMIT_CPU, int(os.environ[SECONDS]))):
        resource.setrlimit(what, (most, resource.getrlimit(what)[1]))


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if ORDER in os.environ:
        rank = {name: i for i, name in enumerate(json.loads(Path(os.environ[ORDER]).read_text()))}
        items.sort(key=lambda item: rank.get(item.nodeid, len(rank)))


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    _durations[report.nodeid] += report.duration


def pytest_sessionfinish() -> None:
    if TAKEN in os.environ:
        Path(os.environ[TAKEN]).write_text(json.dumps({"all": time.process_time(), "each": _durations}))
