"""The main job from the command line, and what it answers to bad input."""

import dataclasses
import json
import resource
import shutil
import sqlite3
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from mcap_landmarks.channels import MATCH, ODOMETRY, POSE, SCENE_OBJECTS, TF
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.stage import Channel, Stamped

from tests.cli.calls import call, refused, schema_of, topics
from tests.cli.logs import messages, write


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs of one world, the map of the first, the second localized in it."""
    here = tmp_path_factory.mktemp("logs")
    write(here / "a.mcap", messages(seed=1))
    write(here / "b.mcap", messages(seed=2))
    assert call("map", here / "a.mcap", "--map", here / "a.db", "-o", here / "mapped.mcap") == 0
    assert call("localize", here / "b.mcap", "--map", here / "a.db", "-o", here / "b_in_a.mcap") == 0
    return here


def test_map_writes_database_and_log(folder: Path) -> None:
    before, after = topics(folder / "a.mcap"), topics(folder / "mapped.mcap")
    assert before.items() <= after.items()
    assert after["/landmarks/map_pose"] == 120
    assert after["/landmarks/map_path"] == after["/landmarks/map_markers"] == 1


def test_localize_finds_every_bundle(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    after = topics(folder / "b_in_a.mcap")
    assert after[MATCH.topic] == 120
    assert after[POSE.topic] == after["/landmarks/pose_cov"] == after[TF.topic] > 100
    assert after["/landmarks/map"] == 1
    assert call("evaluate", folder / "b_in_a.mcap", "--align", "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert document["false"]["count"] == 0
    assert document["position"]["rmse_m"] < 0.06
    assert document["map"]["rmse_aligned_m"] < 0.03


@pytest.mark.slow
def test_json_documents(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("map", folder / "a.mcap", "--map", tmp_path / "a.db", "--json") == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, schema_of("map"))
    assert (document["landmarks"], document["logs"][0]["bundles"]) == (15, 120)
    assert call("localize", folder / "b.mcap", "--map", tmp_path / "a.db", "-o", tmp_path / "b.mcap", "--json") == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, schema_of("localize"))
    assert document["bundles"] == sum(document["statuses"].values()) == 120
    assert document["stages"] == {"localize": "ran"}


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs of half a lap through one world."""
    here = tmp_path_factory.mktemp("short")
    for seed, name in enumerate("ab"):
        write(here / f"{name}.mcap", messages(seed=seed, count=40))
    return here


def test_a_map_is_the_same_whatever_the_order_of_its_logs(short: Path, tmp_path: Path) -> None:
    """To the last byte, with the logs' own results."""
    for name, order in (("one", ("a", "b")), ("other", ("b", "a"))):
        (tmp_path / name).mkdir()
        logs = [short / f"{log}.mcap" for log in order]
        assert call("map", *logs, "--map", tmp_path / name / "map.db", "-o", tmp_path / name / "out") == 0
    for name in ("map.db", "out/a.mcap", "out/b.mcap"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "other" / name).read_bytes()


@pytest.mark.slow
def test_a_log_that_does_not_fit_is_left_out_by_name(
    short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With exit 3, and again where its map is found; of two logs, both of which may be wrong, there is no map."""
    renamed = {f"tag {i}": f"other {i}" for i in range(15)}
    strange = write(tmp_path / "strange.mcap", messages(seed=3, count=40, renamed=renamed))
    logs = (short / "a.mcap", strange, short / "b.mcap")
    for state in ("ran", "reused"):
        assert call("map", *logs, "--map", tmp_path / "map.db", "-o", tmp_path / "out", "--json") == 3
        document, told = json.loads((printed := capsys.readouterr()).out), printed.err
        jsonschema.validate(document, schema_of("map"))
        reason = "cannot be laid on the rest of the map: too few landmarks in common"
        assert f"warning: {strange}: left out of the map: {reason}" in told
        assert [log["path"] for log in document["logs"]] == [str(log) for log in logs]
        assert [log.get("excluded") for log in document["logs"]] == [None, reason, None]
        assert document["logs"][1]["used"] == 0
        assert document["stages"]["build_map"] == state
    assert call("map", logs[0], logs[2], "--map", tmp_path / "without.db", "--json") == 0
    assert json.loads(capsys.readouterr().out)["landmarks"] == document["landmarks"]
    assert "/landmarks/map_pose" not in topics(tmp_path / "out" / "strange.mcap")
    line = refused(capsys, 1, "map", *logs[:2], "--map", tmp_path / "two.db")
    assert reason in line


@pytest.mark.slow
def test_twice_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    assert call("map", folder / "a.mcap", "--map", tmp_path / "again.db") == 0
    assert (tmp_path / "again.db").read_bytes() == (folder / "a.db").read_bytes()
    assert call("localize", folder / "b.mcap", "--map", folder / "a.db", "-o", tmp_path / "again.mcap") == 0
    assert (tmp_path / "again.mcap").read_bytes() == (folder / "b_in_a.mcap").read_bytes()


def test_results_replace_older_results(folder: Path, tmp_path: Path) -> None:
    assert call("localize", folder / "b_in_a.mcap", "--map", folder / "a.db", "-o", tmp_path / "b.mcap") == 0
    assert topics(tmp_path / "b.mcap")[MATCH.topic] == 120


def test_a_mapped_log_keeps_its_path_when_it_is_localized(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Markers of a map are on one topic, whoever drew them last; what nothing replaces stays."""
    assert call("localize", folder / "mapped.mcap", "--map", folder / "a.db", "-o", tmp_path / "both.mcap") == 0
    told = capsys.readouterr().err
    assert "build_map's /landmarks/map_markers in the log is left out: localize writes it, too" in told
    before, after = topics(folder / "mapped.mcap"), topics(tmp_path / "both.mcap")
    assert before.items() <= after.items()
    assert after["/landmarks/path"] > 1
    words = ("map", tmp_path / "both.mcap", "--map", tmp_path / "again.db", "-o", tmp_path / "again.mcap")
    assert call(*words) == 0
    assert "localize's /landmarks/map_markers in the log is left out" in capsys.readouterr().err
    assert topics(tmp_path / "again.mcap") == after
    assert call(*words[:-1], tmp_path / "anew.mcap") == 0  # what is only a part is not taken for the whole
    assert topics(tmp_path / "anew.mcap")["/landmarks/map_markers"] == 1


def test_results_only(folder: Path, tmp_path: Path) -> None:
    words = ("localize", folder / "b.mcap", "--map", folder / "a.db", "-o", tmp_path / "r.mcap", "--results-only")
    assert call(*words) == 0
    found = topics(tmp_path / "r.mcap")
    assert ODOMETRY.topic not in found
    assert found[MATCH.topic] == 120


@pytest.mark.slow
def test_many_logs_go_into_a_folder(folder: Path, tmp_path: Path) -> None:
    logs = (folder / "a.mcap", folder / "b.mcap")
    assert call("localize", *logs, "--map", folder / "a.db", "-o", tmp_path / "out") == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a.mcap", "b.mcap"]


@pytest.mark.slow
def test_a_map_from_the_reference(folder: Path, tmp_path: Path) -> None:
    assert call("map", folder / "a.mcap", "--from-reference", "--map", tmp_path / "truth.db") == 0
    assert call("localize", folder / "b.mcap", "--map", tmp_path / "truth.db", "-o", tmp_path / "b.mcap") == 0


@pytest.mark.slow
def test_a_frame_above_odom_is_left_alone(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    transform = Transform.planar(1, ("world", "odom"), (0, 0, 0))
    log = write(tmp_path / "log.mcap", [Stamped(TF, 1, TFMessage((transform,))), *messages(seed=2)])
    assert call("localize", log, "--map", folder / "a.db", "-o", tmp_path / "out.mcap") == 0
    assert topics(tmp_path / "out.mcap")[TF.topic] == 1
    assert "odom has a parent frame already" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(("parent", "child", "written"), [("map", "wheels", False), ("wheels", "odom", True)])
def test_the_frame_that_counts_is_that_of_the_odometry(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], parent: str, child: str, written: bool
) -> None:
    transform = Transform.planar(1, (parent, child), (0, 0, 0))
    driven = [
        Stamped(stamped.channel, stamped.log_time_ns, dataclasses.replace(stamped.message, frame_id="wheels"))
        if stamped.channel == ODOMETRY
        else stamped
        for stamped in messages(seed=2)
    ]
    log = write(tmp_path / "log.mcap", [Stamped(TF, 1, TFMessage((transform,))), *driven])
    assert call("localize", log, "--map", folder / "a.db", "-o", tmp_path / "out.mcap") == 0
    assert (topics(tmp_path / "out.mcap")[TF.topic] > 1) == written
    assert ("wheels has a parent frame already" in capsys.readouterr().err) != written


def without(channel: Channel, content: list[Stamped]) -> list[Stamped]:
    return [stamped for stamped in content if stamped.channel != channel]


def test_bad_files(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, database = tmp_path / "out.mcap", folder / "a.db"
    line = refused(capsys, 1, "localize", tmp_path / "no.mcap", "--map", database, "-o", out)
    assert "no.mcap: there is no such file" in line
    text = tmp_path / "text.mcap"
    text.write_text("not a recording")
    assert "not an MCAP file" in refused(capsys, 1, "localize", text, "--map", database, "-o", out)
    assert "No such file" in refused(capsys, 1, "localize", folder / "b.mcap", "--map", tmp_path / "no.db", "-o", out)
    line = refused(capsys, 2, "localize", folder / "b.mcap", "--map", database, "-o", tmp_path / "no" / "out.mcap")
    assert "does not exist; create it first" in line
    line = refused(capsys, 2, "localize", folder / "b.mcap", "--map", database, "-o", folder / "b.mcap")
    assert "is the input itself" in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["text.mcap"]


def test_a_map_of_another_version(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = tmp_path / "other.db"
    shutil.copy(folder / "a.db", other)
    with sqlite3.connect(other) as database:
        database.execute("PRAGMA user_version = 99")
    database.close()
    line = refused(capsys, 1, "localize", folder / "b.mcap", "--map", other, "-o", tmp_path / "out.mcap")
    assert "other.db" in line
    assert "99" in line
    assert not (tmp_path / "out.mcap").exists()


@pytest.mark.slow
def test_missing_and_ambiguous_inputs(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blind = write(tmp_path / "blind.mcap", without(ODOMETRY, messages()))
    line = refused(capsys, 1, "map", blind, "--map", tmp_path / "x.db")
    assert "no odometry" in line
    assert "--odom" in line
    empty = write(tmp_path / "empty.mcap", without(SCENE_OBJECTS, messages()))
    assert "no scene_objects" in refused(capsys, 1, "map", empty, "--map", tmp_path / "x.db")
    second = Channel("/wheel/odom", ODOMETRY.message)
    doubled = [Stamped(second, s.log_time_ns, s.message) for s in messages() if s.channel == ODOMETRY]
    two = write(tmp_path / "two.mcap", [*messages(), *doubled])
    line = refused(capsys, 2, "map", two, "--map", tmp_path / "x.db")
    assert "/odom and /wheel/odom" in line
    assert "--odom TOPIC" in line
    assert call("map", two, "--map", tmp_path / "x.db", "--odom", "/wheel/odom") == 0
    assert call("localize", blind, "--map", folder / "a.db", "-o", tmp_path / "out.mcap") == 0
    assert "without odometry" in capsys.readouterr().err


@pytest.mark.slow
def test_numbers_that_are_not_finite_and_time_that_goes_back(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = messages(seed=2)
    spoilt = []
    for i, stamped in enumerate(content):
        message = stamped.message
        if stamped.channel == SCENE_OBJECTS and i % 5 == 0 and len(message):
            positions = message.positions_xy.copy()
            positions[0] = [np.nan, np.inf]
            message = dataclasses.replace(message, positions_xy=positions)
        if stamped.channel == ODOMETRY and i % 7 == 0:
            message = dataclasses.replace(message, stamp_ns=1)
        spoilt.append(Stamped(stamped.channel, stamped.log_time_ns, message))
    log = write(tmp_path / "spoilt.mcap", spoilt)
    assert call("localize", log, "--map", folder / "a.db", "-o", tmp_path / "out.mcap") == 0
    said = capsys.readouterr().err
    assert "objects with numbers that are not finite" in said
    assert "17 odometry messages whose stamp cannot be" in said
    assert topics(tmp_path / "out.mcap")[POSE.topic] > 90


def test_a_cut_log_is_localized_up_to_the_cut(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = (folder / "b.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) // 2])
    assert call("localize", cut, "--map", folder / "a.db", "-o", tmp_path / "out.mcap") == 3
    assert "cut at byte" in capsys.readouterr().err
    assert 0 < topics(tmp_path / "out.mcap")[MATCH.topic] < 120


def test_a_full_disk_leaves_nothing(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        line = refused(capsys, 1, "localize", folder / "b.mcap", "--map", folder / "a.db", "-o", tmp_path / "o.mcap")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert "free space or choose another place" in line
    assert list(tmp_path.iterdir()) == []


def test_a_recording_is_mapped_once(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for again in (folder / "a.mcap", folder / "mapped.mcap"):
        line = refused(capsys, 2, "map", folder / "a.mcap", again, "--map", tmp_path / "twice.db")
        assert f"{again} is the same recording as {folder / 'a.mcap'}; name it once" in line
