"""`localize --at`: the answer for one moment is the one that the whole run has for the nearest bundle."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap_landmarks.channels import MATCH, POSE
from mcap_landmarks.maps.database import read_map, write_map
from mcap_landmarks.maps.model import LandmarkMap, MapSource
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.moments import moment
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.resources import resource

from tests.cli.calls import call, refused
from tests.cli.logs import messages, write

STEP_NS = 500_000_000


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log, its surveyed map, and the log localized in it."""
    here = tmp_path_factory.mktemp("at")
    write(here / "log.mcap", messages(seed=2))
    assert call("map", here / "log.mcap", "--from-reference", "--map", here / "map.db") == 0
    assert call("localize", here / "log.mcap", "--map", here / "map.db", "-o", here / "out.mcap") == 0
    return here


def asked(folder: Path, capsys: pytest.CaptureFixture[str], when: object) -> dict[str, Any]:
    capsys.readouterr()
    assert call("localize", folder / "log.mcap", "--map", folder / "map.db", "--at", when, "--json") == 0
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, json.loads(resource("schemas", "json/localize.schema.json").read_text()))
    return document


@pytest.mark.slow
def test_the_answer_is_that_of_the_whole_run(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with open_recording(folder / "out.mcap") as recording:
        poses = {
            raw.log_time_ns: decode(POSE.message, raw.data)
            for raw in recording.messages(recording.connections(POSE.topic))
        }
        matches = {
            raw.log_time_ns: decode(MATCH.message, raw.data)
            for raw in recording.messages(recording.connections(MATCH.topic))
        }
    for bundle, off_ns in ((0, -1_000_000_000), (40, 200_000_000), (41, -249_000_000), (119, 1_900_000_000)):
        stamp_ns = 1 + bundle * STEP_NS
        document = asked(folder, capsys, stamp_ns + off_ns if bundle else moment(stamp_ns))
        assert document["stamp_ns"] == stamp_ns
        match = matches[stamp_ns]
        assert document["status"] == match.status.name.lower()
        assert tuple(document["landmarks"].values()) == match.landmark_ids
        if stamp_ns in poses:
            np.testing.assert_allclose(document["position_m"], poses[stamp_ns].pose[:2])
            assert 0 < document["sigma_m"] < 0.5
        else:
            assert document["position_m"] is document["sigma_m"] is None


def test_it_says_so_in_words(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(folder.iterdir())
    assert call("localize", folder / "log.mcap", "--map", folder / "map.db", "--at", 1 + 50 * STEP_NS) == 0
    said = capsys.readouterr().out
    assert "1970-01-01T00:00:25.000000001Z (+0.000 s): localized" in said
    assert "sigma" in said
    assert sorted(folder.iterdir()) == before


@pytest.mark.slow
def test_bundles_before_are_joined(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    surveyed = read_map(folder / "map.db")
    classes = tuple(f"kind {i % 3}" for i in range(len(surveyed)))
    repeated = LandmarkMap.surveyed(surveyed.ids, classes, surveyed.positions_xy, MapSource("import", "test"))
    write_map(tmp_path / "map.db", repeated)
    renamed = dict(zip(surveyed.classes, classes, strict=True))
    log = write(tmp_path / "log.mcap", messages(seed=2, renamed=renamed))
    call("localize", log, "--map", tmp_path / "map.db", "--at", 1 + 30 * STEP_NS, "--json")
    document = json.loads(capsys.readouterr().out)
    assert document["bundles_joined"] > 1
    assert document["candidates"]


@pytest.mark.slow
def test_what_it_refuses(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("localize", folder / "log.mcap", "--map", folder / "map.db")
    line = refused(capsys, 2, *words, "--at", 10**12)
    assert "no bundle within 2 s" in line
    assert "the nearest is at 1970-01-01T00:00:59.500000001Z" in line
    assert "nanoseconds" in refused(capsys, 2, *words, "--at", "noon")
    assert "leave -o out" in refused(capsys, 2, *words, "--at", 1, "-o", folder / "x.mcap")
    assert "--at TIME" in refused(capsys, 2, *words)
