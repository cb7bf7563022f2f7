"""Odometry whose stamps are half a second late: said before work, and put right by the option that is named."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.calls import call, refused

CASES = ("odom_half_second_late",)
SHORT = ("--end", "2026-01-01T00:00:16Z")


@pytest.fixture
def late(case_input: Callable[[str], Path]) -> Path:
    return case_input(CASES[0]) / "odom_half_second_late.mcap"


def test_map_refuses_and_names_the_option_that_puts_it_right(
    late: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    database = tmp_path / "map.db"
    said = refused(capsys, 1, "map", late, "--map", database)
    found = re.search(r"/odom: its stamps are (0\.\d+) s .* late against /objects; give (--time-offset) (\S+),", said)
    assert found is not None
    assert float(found[1]) == pytest.approx(0.5, abs=0.01)
    assert not database.exists()
    assert call("map", late, "--map", database, found[2], found[3]) == 0
    capsys.readouterr()
    assert call("evaluate", database, "--reference", late, "--json") == 0
    figures = json.loads(capsys.readouterr().out)["map"]
    assert (figures["matched"], figures["missing"], figures["spurious"]) == (9, 0, 0)


def test_localize_warns_and_goes_on(late: Path, site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "out.mcap"
    capsys.readouterr()
    assert call("localize", late, "--map", site, "-o", output, *SHORT) == 0
    assert "warning: /odom: its stamps are 0.5" in capsys.readouterr().err


def test_a_given_offset_is_taken_as_it_is(late: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("map", late, "--map", tmp_path / "map.db", "--time-offset", "odometry=0", *SHORT) == 0
    assert "its stamps are" not in capsys.readouterr().err


def test_check_foretells_it(late: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call("info", late, "--check")
    told = [line for line in capsys.readouterr().out.splitlines() if re.match(r"(problem|warning): .*stamps", line)]
    assert len(told) == 1
    assert told[0].startswith("problem: /odom: its stamps are 0.5")
