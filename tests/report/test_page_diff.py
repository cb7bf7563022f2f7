"""The page of two runs in a browser: both overlaid, and the worst change a click from its bundle."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import MATCH, POSE
from mcap_landmarks.evaluation.pose_metrics import FALSE_M
from mcap_landmarks.messages.match import Status
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.report.page.bundle_changes import bundle_changes
from mcap_landmarks.report.page.paged_result import read_result
from playwright.sync_api import Browser, expect

from tests.cli.calls import call
from tests.diff.recordings import START_NS, STEP_NS, localized_log, localized_messages, write
from tests.report.pages import opened


def changed_log(path: Path) -> Path:
    """The first bundle is localized no more, the second is half a metre off, the third is localized now."""
    messages = []
    for channel, stamp_ns, message in localized_messages():
        place = (stamp_ns - START_NS) // STEP_NS
        entry = message
        if channel == MATCH and place in {0, 2}:
            entry = replace(message, status=Status.NO_MATCH if place == 0 else Status.LOCALIZED)
        if channel == POSE and place == 0:
            continue
        if channel == POSE and place == 1:
            entry = PoseStamped.planar(stamp_ns, "map", np.array([2.0, 2.5, 0.1]))
        messages.append((channel, stamp_ns, entry))
    return write(path, messages)


def test_the_worst_changes_come_first(tmp_path: Path) -> None:
    assert FALSE_M > 0.5  # so that the second bundle moved, and is not false
    sides = [
        read_result(path, path.name) for path in (localized_log(tmp_path / "a.mcap"), changed_log(tmp_path / "b.mcap"))
    ]
    changes = bundle_changes(*sides)
    assert [(one.words, (one.stamp_ns - START_NS) // STEP_NS) for one in changes] == [
        ("localized → no match", 0),
        ("moved", 1),
        ("ambiguous → localized", 2),
    ]
    assert changes[1].moved_m == pytest.approx(0.5)
    assert changes[1].off_m == pytest.approx((0.0, 0.5))
    assert bundle_changes(sides[0], sides[0]) == []


@pytest.mark.slow
def test_a_change_is_a_click_from_both_its_bundles(browser: Browser, tmp_path: Path) -> None:
    sides = localized_log(tmp_path / "a.mcap"), changed_log(tmp_path / "b.mcap")
    assert call("report", *sides, "--diff", "-o", tmp_path / "diff.html") == 0
    with opened(browser, tmp_path / "diff.html") as watched:
        page = watched.page
        expect(page.locator(".lead")).to_contain_text("3 bundles changed: 1 localized no more, 1 localized now")
        expect(page.locator("#panels .panel")).to_have_count(2)
        page.get_by_role("button", name="Show the bundle of row 2").first.press("Enter")
        expect(page.locator("#where")).to_contain_text("baseline: localized; candidate: localized")
        expect(page.locator("#panels .panel").nth(1)).to_contain_text("off by 0.500 m")
        expect(page.locator("tr.chosen").first).to_contain_text("moved")


@pytest.mark.slow
def test_the_same_runs_and_two_maps_have_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    golden = Path(__file__).parents[1] / "golden"
    log, page = localized_log(tmp_path / "a.mcap"), tmp_path / "p.html"
    assert call("report", log, log, "--diff", "-o", page) == 0
    assert "The two files are equal byte by byte." in page.read_text()
    assert call("report", golden / "map.db", golden / "map.db", "--diff", "-o", page, "--overwrite") == 0
    text = page.read_text()
    assert ">The map</h2>" in text
    assert "that both runs have" not in text
    assert call("report", log, "--diff", "-o", page) == 2
    assert "BASELINE and CANDIDATE, not of 1" in capsys.readouterr().err
