"""The page of one result in a browser: what it shows, by pointer and by keyboard, and that nothing in a log runs."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.channels import DETECTIONS, MAP, MATCH, SCENE_OBJECTS
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Stamped
from playwright.sync_api import Browser, expect

from tests.cli.calls import call
from tests.diff.recordings import LANDMARKS, START_NS, localized_log, localized_messages
from tests.evaluation.scenes import scene
from tests.report.pages import opened

PANEL = "#panels .panel"
PLANTED = '<script>window.ran = "script"</script><img src=x onerror="window.ran = 1">'


@pytest.mark.slow
def test_a_click_on_a_bundle_shows_its_image_on_a_phone_as_well(browser: Browser, result_html: Path) -> None:
    with opened(browser, result_html) as watched:
        page = watched.page
        expect(page.locator(".lead")).to_contain_text(re.compile(r"^19 of 19 bundles were localized \(100 %\)\."))
        first = page.locator("#where").inner_text()
        markers = page.locator("#map .scatterlayer .trace").filter(has=page.locator("path.point"))
        point = markers.first.locator("path.point").nth(9)
        box = point.bounding_box()
        assert box is not None
        page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        expect(page.locator("#where")).not_to_have_text(first)
        image = page.locator(f"{PANEL} img")
        assert image.evaluate("image => image.naturalWidth") > 0
        assert page.locator(f"{PANEL} .image rect").count() > 0
        expect(page.locator(PANEL)).to_contain_text("Conditions of the decision")
        expect(page.locator(f"{PANEL} svg.around polygon")).to_have_count(1)
        # A phone at night: it scrolls down only, and what the system says of light and dark holds.
        page.set_viewport_size({"width": 360, "height": 740})
        page.emulate_media(color_scheme="dark")
        expect(image).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") <= 360
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(15, 19, 25)"


@pytest.mark.slow
def test_the_keyboard_does_what_the_pointer_does(browser: Browser, result_html: Path) -> None:
    with opened(browser, result_html) as watched:
        page = watched.page
        page.locator("#strip").focus()
        page.keyboard.press("Home")
        expect(page.locator("#where")).to_contain_text("Bundle 1 of 19")
        page.keyboard.press("ArrowRight")
        expect(page.locator("#strip")).to_have_attribute("aria-valuenow", "1")
        page.keyboard.press("End")
        page.keyboard.press("Enter")
        assert page.evaluate("document.activeElement.className") == "panel"
        page.locator("#map").focus()
        page.keyboard.press("ArrowLeft")
        expect(page.locator("#where")).to_contain_text("Bundle 18 of 19")
        theme = page.locator("#theme")
        theme.press("Enter")
        assert page.evaluate("document.documentElement.dataset.theme") == "dark"
        expect(theme).to_have_attribute("aria-pressed", "true")


@pytest.mark.slow
def test_nothing_that_a_log_says_runs(browser: Browser, tmp_path: Path) -> None:
    """A script and an image with a handler, as class, frame, camera, topic, landmark id and file name."""
    landmarks = replace(LANDMARKS, ids=(PLANTED, *LANDMARKS.ids[1:]), hypotheses=(((PLANTED, 1.0),),) * 3)
    log = tmp_path / f"{PLANTED.replace('/', '|')}.mcap"
    with create_recording(log) as writer:
        writer.add(Stamped(MAP, START_NS, landmarks))
        for channel, stamp_ns, message in localized_messages():
            entry = message
            if channel == SCENE_OBJECTS:
                entry = replace(message, frame_id=PLANTED, hypotheses=(((PLANTED, 0.9),),) * len(message))
                boxes = Detections(stamp_ns, PLANTED, ("0",), (((PLANTED, 0.9),),), np.array([[1.0, 1, 5, 5]]))
                writer.add(Stamped(DETECTIONS, stamp_ns, boxes))
            if channel == MATCH:
                entry = replace(message, candidate_ids=(PLANTED,), candidate_scores=np.ones(1))
            writer.add(Stamped(channel, stamp_ns, entry))
        other = replace(SCENE_OBJECTS, topic=f"/{PLANTED}")
        writer.add(Stamped(other, START_NS, scene(["person"], [[1.0, 2]], START_NS)))
    assert call("report", log, "-o", tmp_path / "page.html") == 0
    with opened(browser, tmp_path / "page.html") as watched:
        page = watched.page
        for _ in range(5):
            page.locator("#after").click()
        expect(page.locator("h1")).to_contain_text("<script>window.ran")
        expect(page.locator(PANEL)).to_contain_text(PLANTED)
        box = page.locator("#map").bounding_box()
        assert box is not None
        for share in (0.3, 0.5, 0.7):
            page.mouse.move(box["x"] + share * box["width"], box["y"] + share * box["height"])
        assert page.evaluate("window.ran === undefined && !document.querySelector('img[onerror], main script')")


@pytest.mark.slow
def test_failures_are_found_and_told(browser: Browser, tmp_path: Path) -> None:
    assert call("report", localized_log(tmp_path / "r.mcap"), "-o", tmp_path / "r.html") == 0
    with opened(browser, tmp_path / "r.html") as watched:
        page = watched.page
        expect(page.locator(".lead")).to_contain_text("1 ambiguous, 1 too few objects")
        expect(page.locator(PANEL)).to_contain_text("✗ FAILS expected_accidental")
        page.locator("#strip").press("n")
        expect(page.locator(PANEL)).to_contain_text("✗ FAILS objects")
        expect(page.locator(".note")).to_contain_text("holds no images")
