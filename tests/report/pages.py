"""A browser for the pages that tests look at, and logs with results to make pages of."""

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from heapq import merge
from pathlib import Path

import pytest
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.resources import resource
from playwright.sync_api import Browser, Page, Route

GOLDEN = Path(__file__).parents[1] / "golden" / "localize.mcap"
START_NS = 1_767_225_600 * 10**9
SECONDS = 4


@dataclass
class Watched:
    """An open page, what it asked of the network, and what went wrong in it."""

    page: Page
    requests: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)


def chromium() -> str:
    """Where Chromium is; tests that need it are skipped without, but fail in CI, which has to install it."""
    path = shutil.which("chromium")
    if path is None and os.environ.get("CI") == "true":
        pytest.fail("CI has no chromium; .ci/run installs it with apt-get")
    return path or pytest.skip("no chromium on this machine; apt-get install chromium")


@contextmanager
def opened(browser: Browser, path: Path, width: int = 1280) -> Iterator[Watched]:
    """A page that is open in a browser, which may load its file and nothing else, and finds nothing wrong in it."""
    context = browser.new_context(viewport={"width": width, "height": 900})
    watched = Watched(context.new_page())

    def answer(route: Route) -> None:
        if route.request.url == path.as_uri():
            route.continue_()
        else:
            watched.requests.append(route.request.url)
            route.abort()

    context.route("**/*", answer)
    watched.page.on("console", lambda line: watched.errors.append(line.text))
    watched.page.on("pageerror", lambda error: watched.errors.append(str(error)))
    watched.page.goto(path.as_uri())
    yield watched
    context.close()
    assert (watched.requests, watched.errors) == ([], [])


def joined(path: Path, parts: Sequence[Path], seconds: float = SECONDS) -> Path:
    """A recording with the first seconds of others, as a run writes it that keeps its input's channels."""
    with create_recording(path) as writer:
        logs = []
        for part in parts:
            with open_recording(part) as recording:
                raws = recording.messages(end_ns=START_NS + round(seconds * 1e9))
                logs.append([raw._replace(data=bytes(raw.data)) for raw in raws])
        for raw in merge(*logs, key=lambda raw: raw.log_time_ns):
            writer.write(raw)
    return path


def sensed_and_localized(path: Path) -> Path:
    """Four seconds of the demo's second log, with images, scans, odometry and truth, and its golden results."""
    return joined(path, [resource("recordings", "demo_localize.mcap"), GOLDEN])
