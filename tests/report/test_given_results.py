"""What a report is asked for: a catalogue that cannot be read is told and does not keep other results from the page."""

from pathlib import Path

import pytest
from mcap_landmarks.diff.set_logs import check_sets
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.report.page.given_results import given_results

MAP_DB = Path(__file__).parents[1] / "golden" / "map.db"
NEITHER = r"page.db: is neither a landmark database nor a catalogue \(it is no SQLite database\)"


def test_what_is_no_result_is_named_alone_and_beside_others(tmp_path: Path) -> None:
    page = tmp_path / "page.db"
    page.write_text("<!doctype html>")
    for places, is_diff in (([page], False), ([MAP_DB, page], True)):
        with pytest.raises(RecordingError, match=NEITHER):
            given_results(places, is_diff=is_diff)
    given = given_results([MAP_DB, page], is_diff=False)
    assert (given.files, [one.name for one in given.missing]) == ((MAP_DB,), ["page.db"])
    with pytest.raises(RecordingError, match=NEITHER):  # not that the map is no set
        check_sets(MAP_DB, page)
