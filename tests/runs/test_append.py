"""Outputs that a run appends its results to are sound to other tools, whatever the log looked like."""

from collections import Counter
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_landmarks.runs.pipeline import run_stages
from mcap_landmarks.runs.plan import Request

from tests.runs.chain import by_others, raw_log
from tests.runs.conversion import doctor

OBJECTS = "/landmarks/scan_objects"


@pytest.fixture(scope="module")
def raw(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log without results."""
    return raw_log(tmp_path_factory.mktemp("append") / "raw.mcap", 4)


def appended(log: Path, output: Path, **settings: object) -> Counter[str]:
    """Messages by topic of a log with what `cluster` makes of it, as the mcap package reads them with all CRCs."""
    run_stages(Request(log, settings={"cluster": settings}), output, ["cluster"], "cluster")
    assert doctor(output) == []
    with output.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return Counter(channel.topic for _, channel, _ in reader.iter_messages())


def test_results_replace_those_of_another_run(raw: Path, tmp_path: Path) -> None:
    first = appended(raw, tmp_path / "first.mcap")
    assert first[OBJECTS] == first["/scan"] == 4
    assert appended(tmp_path / "first.mcap", tmp_path / "second.mcap", sigma_m=0.02) == first


def test_results_in_chunks_with_other_topics_are_replaced(raw: Path, tmp_path: Path) -> None:
    first = appended(raw, tmp_path / "first.mcap")
    mixed = by_others(tmp_path / "first.mcap", tmp_path / "mixed.mcap")
    assert appended(mixed, tmp_path / "second.mcap") == first
