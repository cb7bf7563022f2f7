"""The criteria file: what it sets, what it leaves, and what it refuses."""

from pathlib import Path

import pytest
from mcap_landmarks.diff.criteria import METRICS, Criteria, read_criteria
from mcap_landmarks.errors import UsageError

TEXT = """
confidence = 0.9
inconclusive = "fail"

[metrics.position.rmse_m]
margin = 0.05
log_margin = 0.3

[metrics."localized_share"]
gates = false
limit = 0.8
"""


def read(folder: Path, text: str) -> Criteria:
    (folder / "criteria.toml").write_text(text)
    return read_criteria(folder / "criteria.toml")


def test_what_is_not_said_stays(tmp_path: Path) -> None:
    found = read(tmp_path, TEXT)
    assert (found.confidence, found.inconclusive, found.missing) == (0.9, "fail", "fail")
    rmse, share = found.metrics["position.rmse_m"], found.metrics["localized_share"]
    assert (rmse.margin, rmse.log_margin, rmse.direction, rmse.gates) == (0.05, 0.3, "lower", True)
    assert (share.margin, share.gates, share.limit) == (0.01, False, 0.8)
    assert found.metrics["nees"] == METRICS["nees"].criterion
    assert read(tmp_path, "") == Criteria()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("confidense = 0.9", "there is no criterion confidense; did you mean confidence?"),
        ("confidence = 1.0", "confidence = 1.0: give a number from 0.5 to below 1"),
        (
            "[metrics.position.rmsem]\nmargin = 1",
            "no figure position.rmsem with criteria; did you mean position.rmse_m",
        ),
        ("[metrics.positions.rmse_m]\nmargin = 1", "no figure positions with criteria"),
        ("[metrics.nees]\nmarginn = 1", "metrics.nees has no key marginn; did you mean margin?"),
        ("[metrics.nees]\nmargin = 0", "metrics.nees.margin = 0: give a number above 0"),
        ("[metrics.nees]\nmargin = 'x'", "metrics.nees.margin = 'x'"),
        ("[metrics.nees]\nlimit = 2.0", "metrics.nees.limit needs a direction"),
        ("[metrics.nees]\ndirection = 'down'", "metrics.nees.direction = 'down': give one of lower, higher, one, none"),
        ("metrics = 3", "write a table for each"),
        ("[metrics]\nposition.rmse_m = 3", "metrics.position.rmse_m = 3: give a table, such as { margin = 0.05 }"),
        ("metrics.position = 3", "no figure position with criteria"),
        ("[metrics.position.rmse_m]\nlimit = true", "metrics.position.rmse_m.limit = true: give a number"),
        ('[metrics.position.rmse_m]\ngates = "yes"', "metrics.position.rmse_m.gates = 'yes': give true or false"),
        ('[metrics.position.rmse_m]\nmargin = "0.03"', "metrics.position.rmse_m.margin = '0.03'"),
        ("[", "not a TOML file"),
    ],
)
def test_wrong_words_are_answered(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as refusal:
        read(tmp_path, text)
    assert words in str(refusal.value)
    assert str(refusal.value).startswith(str(tmp_path / "criteria.toml"))


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file of criteria"):
        read_criteria(tmp_path / "none.toml")
