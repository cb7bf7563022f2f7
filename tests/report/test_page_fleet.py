"""The page of many results in a browser: the worst first, sorting by keyboard, and a section for each."""

from pathlib import Path

import pytest
from mcap_landmarks.channels import TRUTH_POSE
from playwright.sync_api import Browser, expect

from tests.cli.calls import call
from tests.diff.recordings import localized_log, localized_messages, write
from tests.report.pages import GOLDEN, opened


@pytest.mark.slow
def test_a_table_of_all_sorts_and_opens_sections(browser: Browser, tmp_path: Path) -> None:
    blind = write(tmp_path / "blind.mcap", [entry for entry in localized_messages() if entry[0] != TRUTH_POSE])
    logs = GOLDEN, localized_log(tmp_path / "half.mcap"), blind
    assert call("report", *logs, "-o", tmp_path / "fleet.html") == 0
    with opened(browser, tmp_path / "fleet.html", width=360) as watched:
        page = watched.page
        names = page.locator("#logs tbody th")
        expect(names).to_have_text(["half.mcap", "blind.mcap", "localize.mcap"])  # one false pose, two failures, none
        head = page.locator("#logs thead th").nth(4)
        head.locator("button").focus()
        page.keyboard.press("Enter")
        expect(head).to_have_attribute("aria-sort", "ascending")
        expect(names.last).to_have_text("localize.mcap")
        page.keyboard.press("Enter")
        expect(head).to_have_attribute("aria-sort", "descending")
        expect(names.first).to_have_text("localize.mcap")
        names.first.locator("a").press("Enter")
        expect(page.locator("details[open] svg[aria-label='Map of localize.mcap']")).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") <= 360


def test_a_log_that_cannot_be_read_is_told_and_the_others_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "broken.mcap").write_bytes(b"nothing")
    log, page = localized_log(tmp_path / "r.mcap"), tmp_path / "fleet.html"
    assert call("report", log, tmp_path / "broken.mcap", "-o", page) == 3
    assert "broken.mcap could not be read" in capsys.readouterr().err
    assert "broken.mcap could not be read" in page.read_text()
    assert call("report", tmp_path / "broken.mcap", tmp_path / "gone.mcap", "-o", tmp_path / "none.html") == 1
    assert "none of 2 results can be read" in capsys.readouterr().err


def test_a_map_is_a_result_but_no_log(tmp_path: Path) -> None:
    log, page = localized_log(tmp_path / "my log.mcap"), tmp_path / "fleet.html"
    assert call("report", log, GOLDEN.parent / "map.db", "-o", page) == 0
    text = page.read_text()
    assert "in 1 log were localized" in text
    assert "1 result has no bundles." in text
    assert "1 log with bundles" in text
    assert f"report &#39;{log}&#39; -o &#39;my log.html&#39;" in text
