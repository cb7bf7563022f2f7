"""Counts as people read them."""

from mcap_landmarks.wording import counted, tallied


def test_one_is_no_plural() -> None:
    assert (counted(1, "bundle"), counted(2, "bundle"), counted(0, "bundle")) == ("1 bundle", "2 bundles", "0 bundles")
    assert tallied(2, "images left out") == "2 images left out"
    assert tallied(1, "images left out") == "images left out: 1"
