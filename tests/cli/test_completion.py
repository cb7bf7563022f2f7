"""Shells complete verbs, the commands below them, and the options of the verb that is being typed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("mcap-landmarks loc", ["localize"]),
        ("mcap-landmarks localize --map", ["--map"]),
        ("mcap-landmarks landmarks ", ["import", "export", "show"]),
    ],
)
def test_bash_gets_what_can_come_next(typed: str, expected: list[str]) -> None:
    asked = {"COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" ")), "_MCAP_LANDMARKS_COMPLETE": "complete_bash"}
    shown = subprocess.run(
        [Path(sys.executable).with_name("mcap-landmarks")],
        env=os.environ | asked,
        capture_output=True,
        text=True,
        check=True,
    )
    assert [word for word in shown.stdout.split() if word != "--"] == expected
