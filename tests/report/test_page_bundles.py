"""Which bundles a page shows, what it tells of one, and what may stand in its data."""

import json
from pathlib import Path

import numpy as np
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.report.explain_document import explanation
from mcap_landmarks.report.explain_reading import Situations, read_situation
from mcap_landmarks.report.page.bundle_table import read_bundles
from mcap_landmarks.report.page.chosen_bundles import evenly, failures_first
from mcap_landmarks.report.page.html_page import json_in_html
from mcap_landmarks.report.page.jpeg_pictures import data_url


def test_failures_come_first_up_to_half_and_the_rest_evenly() -> None:
    failed = np.zeros(1000, dtype=np.bool_)
    failed[[3, 500, 999]] = True
    kept = failures_first(failed, np.arange(1000), 100)
    assert len(kept) == 100
    assert {3, 500, 999} <= set(kept.tolist())
    assert np.diff(kept).max() <= 12  # no part of the drive is left out
    assert failures_first(~failed, np.arange(1000), 100).tolist()[1:2] == [3]  # the few that did not fail stay, too
    assert evenly(np.arange(5), 9).tolist() == [0, 1, 2, 3, 4]
    assert evenly(np.arange(100), 3).tolist() == [0, 50, 99]


def test_a_bundle_is_told_as_explain_tells_it(sensed_log: Path) -> None:
    """The page decodes fewer messages around a bundle, and finds the same."""
    with open_recording(sensed_log) as recording:
        table = read_bundles(recording, np.zeros(0, dtype=np.int64))
        situations = Situations(recording)
        for row in (0, 9, 18):
            stamp_ns = int(table.stamps_ns[row])
            situation, view = situations.of(stamp_ns, int(table.logged_ns[row]))
            asked, seen = read_situation(sensed_log, stamp_ns)
            assert explanation(situation, (), view) == explanation(asked, (), seen)
            for mine, theirs in zip(view.pictures, seen.pictures, strict=True):
                np.testing.assert_array_equal(mine.pixels, theirs.pixels)
            np.testing.assert_array_equal(view.scan_xy, seen.scan_xy)


def test_data_cannot_end_their_script() -> None:
    text = json_in_html({"</script>": "<!--&\u2028\ud800", "n": [float("nan"), 1.00004, True, None]})
    assert not set(text) & set("<>&\u2028")
    assert json.loads(text) == {"</script>": "<!--&\u2028\ud800", "n": [None, 1.0, True, None]}


def test_pictures_shrink_until_they_fit() -> None:
    noise = np.random.default_rng(1).integers(0, 256, (480, 640, 3), dtype=np.uint8)
    large, small = data_url(noise, 10**6), data_url(noise, 20_000)
    assert (large[1], small[1]) == (0, 4)
    assert len(small[0]) < len(large[0]) / 4
