"""One browser, and one page of each kind, for all tests of pages."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, sync_playwright

from tests.cli.calls import call
from tests.report.pages import chromium, sensed_and_localized


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Debian's Chromium without a window; no sandbox, which containers do not allow."""
    path = chromium()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def sensed_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log with images, scans, truth and results."""
    return sensed_and_localized(tmp_path_factory.mktemp("sensed") / "located.mcap")


@pytest.fixture(scope="session")
def result_html(sensed_log: Path) -> Path:
    """The page of one result."""
    path = sensed_log.with_name("result.html")
    assert call("report", sensed_log, "-o", path) == 0
    return path
