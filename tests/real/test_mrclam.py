"""UTIAS MRCLAM data set 6 (Leung et al. 2011): five real robots, mapped and localized from the command line."""

import json
from pathlib import Path
from typing import Any

import pytest
from mcap_landmarks.cli.main import run

pytestmark = pytest.mark.slow

FIRST_THIRD = ("--end", "2009-07-24T14:07:55Z")
"""Five of fifteen minutes are enough to map all landmarks as accurately as the tests demand."""


def call(*words: object) -> None:
    with pytest.raises(SystemExit) as stop:
        run([str(word) for word in words])
    assert not stop.value.code


@pytest.fixture(scope="module")
def logs(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with robot1.mcap to robot5.mcap and the surveyed map."""
    folder = tmp_path_factory.mktemp("mrclam")
    call("convert", shared_data / "mrclam" / "MRCLAM_Dataset6.zip", "-o", folder / "d6")
    call("map", folder / "d6" / "robot1.mcap", "--from-reference", "--map", folder / "surveyed.db")
    return folder


@pytest.fixture(scope="module")
def with_robot_3(logs: Path) -> Path:
    """The same folder with robot 3's map, which takes twenty seconds: only for those who need it."""
    call("map", logs / "d6" / "robot3.mcap", "--map", logs / "robot3.db", *FIRST_THIRD)
    return logs


def evaluated(capsys: pytest.CaptureFixture[str], *words: object) -> dict[str, Any]:
    capsys.readouterr()
    call("evaluate", *words, "--json")
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    return document


def localized(logs: Path, database: str, capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    output, setting = logs / f"robot1_in_{database}.mcap", "localize.max_sigma_m=0.3"
    call("localize", logs / "d6" / "robot1.mcap", "--map", logs / database, "-o", output, "--set", setting)
    return evaluated(capsys, output, *words)


def test_robot_3_alone_maps_every_landmark(with_robot_3: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figures = evaluated(capsys, with_robot_3 / "robot3.db", "--reference", with_robot_3 / "d6" / "robot1.mcap")["map"]
    assert figures["rmse_aligned_m"] <= 0.13
    assert (figures["matched"], figures["missing"], figures["spurious"]) == (15, 0, 0)


def test_five_robots_map_better_than_one(logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call("map", *sorted((logs / "d6").glob("robot*.mcap")), "--map", logs / "all.db", *FIRST_THIRD)
    figures = evaluated(capsys, logs / "all.db", "--reference", logs / "d6" / "robot1.mcap")["map"]
    assert figures["rmse_aligned_m"] <= 0.10
    assert (figures["matched"], figures["missing"], figures["spurious"]) == (15, 0, 0)


def test_single_bundles_in_the_surveyed_map(logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = localized(logs, "surveyed.db", capsys)
    assert found["position"]["median_m"] <= 0.13
    assert found["false"]["count"] == 0
    assert found["localized"] / found["eligible"] >= 0.18


def test_single_bundles_in_the_map_of_another_robot(with_robot_3: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = localized(with_robot_3, "robot3.db", capsys, "--align")
    assert found["position"]["median_m"] <= 0.22
    assert found["false"]["share"] <= 0.01
    assert found["localized"] / found["eligible"] >= 0.18
