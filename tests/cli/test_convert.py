"""The verb convert."""

import json
import os
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from mcap_landmarks.cli.console import DONE, PARTIAL, UNUSABLE, USAGE, run_command
from mcap_landmarks.cli.main import build
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.resources import resource

from tests.cli.calls import call
from tests.sources.bags import write_mrclam, write_plain_db3, write_ros1, write_ros2

SCHEMA: dict[str, Any] = json.loads(resource("schemas", "json/convert.schema.json").read_text())


def run(*arguments: str | Path) -> int:
    return run_command(build("convert"), ["convert", *map(str, arguments)])


def document(capsys: pytest.CaptureFixture[str], *arguments: str | Path, code: int = DONE) -> dict[str, Any]:
    assert run(*arguments, "--json") == code
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    jsonschema.validate(found, SCHEMA)
    return found


def test_the_document_fits_its_schema(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    found = document(capsys, write_ros1(tmp_path / "a.bag"), "-o", tmp_path / "a.mcap")
    assert found == {
        "schema": "mcap-landmarks/convert/1",
        "outputs": [
            {"path": str(tmp_path / "a.mcap"), "format": "mcap", "messages": 80, "topics": {"/scan": 40, "/talk": 40}}
        ],
        "declared": 80,
        "read": 80,
        "lost": 0,
        "left_out": [],
        "dropped": {},
        "losses": [],
        "failures": [],
    }
    found = document(capsys, write_mrclam(tmp_path / "set"), "-o", tmp_path / "robots")
    assert len(found["outputs"]) == 2
    assert found["dropped"] == {"Robot1_Measurement.dat: barcode of a robot": 5}


def test_it_says_what_it_did(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        run(
            write_ros1(tmp_path / "a.bag"),
            "--topics",
            "/talk",
            "--end",
            "1700000001000000000",
            "-o",
            tmp_path / "a.mcap",
        )
        == DONE
    )
    out, err = capsys.readouterr()
    assert out == f"{tmp_path}/a.mcap: 10 messages, 1 topic\n"
    assert err == f"note: {tmp_path}/a.mcap: left out 30: messages outside the time range\n"


def test_times_may_be_written_as_dates(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_ros2(tmp_path / "a")
    start, end = "2023-11-14T22:13:21Z", "2023-11-14T23:13:21.000000001+01:00"
    found = document(capsys, source, "--start", start, "--end", end, "-o", tmp_path / "a.mcap")
    assert found["outputs"][0]["topics"] == {"/scan": 1, "/talk": 0}


def test_settings_reach_the_source(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "c.toml").write_text("[mrclam]\nbearing_sd_rad = 0.05\n[localize]\nmax_sigma_m = 0.2\n")
    source = write_mrclam(tmp_path / "set")
    options = ["--config", tmp_path / "c.toml", "--set", "mrclam.range_sd_m=0.5"]
    assert run(source, *options, "-o", tmp_path / "out") == DONE
    with open_recording(tmp_path / "out" / "robot1.mcap") as recording:
        config = json.loads(recording.metadata["mcap-landmarks.run"]["config"])["mrclam"]
    assert (config["range_sd_m"], config["bearing_sd_rad"], config["slip_sd_m"]) == (0.5, 0.05, 0.05)
    assert run(source, "--set", "mrclam.rnge_sd_m=0.5", "-o", tmp_path / "out") == USAGE
    assert "did you mean range_sd_m" in capsys.readouterr().err


def test_a_distribution_may_be_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_plain_db3(tmp_path / "a.db3", message_type="shape_msgs/msg/SolidPrimitive")
    assert run(source, "-o", tmp_path / "a.mcap") == UNUSABLE
    assert "such as --distro" in capsys.readouterr().err
    assert run(source, "-o", tmp_path / "a.mcap", "--distro", "humble") == UNUSABLE
    assert "are not humble's shape_msgs/msg/SolidPrimitive" in capsys.readouterr().err
    assert run(write_plain_db3(tmp_path / "b.db3"), "-o", tmp_path / "a.mcap", "--distro", "humble") == DONE


def test_losses_end_with_their_own_code(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_ros1(tmp_path / "a.bag")
    source.write_bytes(source.read_bytes()[: source.stat().st_size * 3 // 4])
    found = document(capsys, source, "-o", tmp_path / "a.mcap", code=PARTIAL)
    assert 0 < found["read"] < 80
    assert "cut" in " ".join(found["losses"])
    good = write_ros1(tmp_path / "good.bag")
    bad = write_plain_db3(tmp_path / "bad.db3", message_type="my_msgs/msg/Own")
    found = document(capsys, good, bad, "-o", tmp_path / "both", code=PARTIAL)
    assert [Path(output["path"]).name for output in found["outputs"]] == ["good.mcap"]
    assert "my_msgs/msg/Own" in found["failures"][0]


def refused(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str]:
    """Exit code and the one line of a refusal."""
    code = run(*arguments)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("error: ")
    return code, err


def test_bad_input_is_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, target = write_ros1(tmp_path / "a.bag"), tmp_path / "a.mcap"
    (tmp_path / "words.txt").write_text("words")
    (tmp_path / "words.mcap").write_text("words")
    (tmp_path / "empty.bag").touch()
    expected = [
        (UNUSABLE, "there is no such file or folder; check", (tmp_path / "none.bag", "-o", target)),
        (UNUSABLE, "is nothing that can be converted; known are", (tmp_path / "words.txt", "-o", target)),
        (UNUSABLE, "is not an MCAP file", (tmp_path / "words.mcap", "-o", target)),
        (UNUSABLE, "is empty (0 bytes); record or copy", (tmp_path / "empty.bag", "-o", target)),
        (USAGE, "does not exist; create it first", (source, "-o", tmp_path / "none" / "a.mcap")),
        (USAGE, "is the input itself", (source, "-o", source)),
        (USAGE, "--start yesterday: give RFC 3339", (source, "--start", "yesterday", "-o", target)),
        (USAGE, "matches none of /scan, /talk", (source, "--topics", "scan", "-o", target)),
    ]
    for code, words, arguments in expected:
        found, line = refused(capsys, *arguments)
        assert words in line
        assert found == code
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.bag", "empty.bag", "words.mcap", "words.txt"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_what_may_not_be_read_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_ros1(tmp_path / "a.bag")
    source.chmod(0)
    code, line = refused(capsys, source, "-o", tmp_path / "a.mcap")
    assert code == UNUSABLE
    assert "change its permissions" in line


def test_an_output_that_exists_is_replaced_whole_or_not_at_all(tmp_path: Path) -> None:
    target = tmp_path / "out.mcap"
    assert run(write_ros1(tmp_path / "a.bag"), "-o", target) == DONE
    before = target.read_bytes()
    assert run(tmp_path / "a.bag", "-o", target) == DONE
    assert target.read_bytes() == before
    other, unknown = write_ros2(tmp_path / "c"), write_plain_db3(tmp_path / "b.db3", message_type="my_msgs/msg/Own")
    assert run(other, "-o", target) == USAGE
    assert run(unknown, "-o", target, "--overwrite") == UNUSABLE
    assert target.read_bytes() == before
    assert run(other, "-o", target, "--overwrite") == DONE
    with open_recording(target) as recording:
        assert sum(entry.count for entry in recording.channels) == 40


def test_a_topic_that_nobody_understands_is_left_out_or_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good = write_plain_db3(tmp_path / "good.db3")
    own = [write_plain_db3(tmp_path / f"{name}.db3", message_type=f"my_msgs/msg/{name}") for name in ("One", "Two")]
    target = tmp_path / "out.mcap"
    found = document(capsys, good, *own, "-o", target, code=PARTIAL)
    assert [one["type"] for one in found["left_out"]] == ["my_msgs/msg/One", "my_msgs/msg/Two"]
    assert (found["declared"], found["read"], found["lost"]) == (60, 20, 40)
    assert run(good, *own, "-o", target) == PARTIAL
    assert "left out topic /talk (my_msgs/msg/Two), 20 messages: the file does not define" in capsys.readouterr().err
    target.unlink()
    code, line = refused(capsys, good, *own, "-o", target, "--strict")
    assert code == UNUSABLE
    assert all(f"topic /talk (my_msgs/msg/{name}), 20 messages" in line for name in ("One", "Two"))
    assert not target.exists()


def test_definitions_may_be_given(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_plain_db3(tmp_path / "a.db3", message_type="my_msgs/msg/Words")
    definition = tmp_path / "share" / "my_msgs" / "msg" / "Words.msg"
    definition.parent.mkdir(parents=True)
    definition.write_text("string data\n")
    given = ("--definitions", tmp_path / "share")
    assert run(source, "-o", tmp_path / "a.mcap", *given) == DONE
    assert run(source, "-o", tmp_path / "b.mcap", "--definitions", definition, "--strict") == DONE
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()  # no path is in it
    capsys.readouterr()
    assert call("info", source, "--check", *given) == DONE
    assert "cannot be converted" not in capsys.readouterr().err
    assert call("info", source, "--json") == PARTIAL
    (topic,) = json.loads(capsys.readouterr().out)["left_out"]
    assert (topic["topic"], topic["messages"]) == ("/talk", 20)
    definition.write_text("int64 data\n")
    assert run(source, "-o", tmp_path / "c.mcap", *given) == UNUSABLE
    assert "are not the given my_msgs/msg/Words" in capsys.readouterr().err
    assert run(source, "-o", tmp_path / "c.mcap", "--definitions", tmp_path / "none") == USAGE
