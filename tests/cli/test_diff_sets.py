"""The verb diff of two folders: what it pairs, tells, writes and refuses."""

import json
import shutil
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import jsonschema
import pytest
from mcap_landmarks.catalogue.catalogue_file import append_rows
from mcap_landmarks.channels import TRUTH_POSE
from mcap_landmarks.cli.console import DONE, USAGE, run_command
from mcap_landmarks.cli.diff_text import DIFFERENT
from mcap_landmarks.cli.main import build
from mcap_landmarks.diff.sets import diff_sets
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.stage import Stamped

from tests.catalogue.rows import row
from tests.cli.calls import schema_of
from tests.diff.sets import folder, result

MAP_DB = Path(__file__).parents[1] / "golden" / "map.db"
ERRORS_M = {f"drive_{i}": 0.03 + 0.01 * i for i in range(8)}


def run(*arguments: str | Path) -> int:
    return run_command(build("diff"), ["diff", *map(str, arguments)])


def document(capsys: pytest.CaptureFixture[str], *arguments: str | Path, name: str = "diff_sets") -> dict[str, Any]:
    capsys.readouterr()
    run(*arguments, "--json")
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator.check_schema(schema_of(name))
    jsonschema.validate(found, schema_of(name))
    return found


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folders of eight logs: `before`, and `after` with errors that are 10 % larger, in one log by half."""
    place = tmp_path_factory.mktemp("sets")
    folder(place / "before", ERRORS_M)
    after = {name: error_m * (1.5 if name == "drive_3" else 1.1) for name, error_m in ERRORS_M.items()}
    folder(place / "after", after)
    return place


@pytest.fixture
def sets(made: Path, tmp_path: Path) -> Path:
    """The same, to be changed."""
    shutil.copytree(made, tmp_path / "sets")
    return tmp_path / "sets"


def test_worse_in_all_logs_is_worse(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(made / "before", made / "after") == DIFFERENT
    out = capsys.readouterr().out
    assert out.startswith("worse: over 8 pairs of logs, at 95 % confidence\n")
    assert "fails: position.rmse_m: worse" in out
    assert {"position.rmse_m": "worse", "localized_share": "same"}.items() <= {
        (words[0], words[1]) for line in out.splitlines() if len(words := line.split()) > 2
    }
    worst = out[out.index("worst logs") :].splitlines()[1]
    assert worst.startswith("drive_3 ")
    assert worst.endswith("+50.00 %")
    assert run(made / "after", made / "before") == DONE
    assert capsys.readouterr().out.startswith("better: ")
    assert run(made / "before", made / "before") == DONE
    assert "every figure of every log is equal" in capsys.readouterr().out


def test_the_document(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = document(capsys, made / "before", made / "after")
    assert (found["verdict"], found["fails"], found["pairs"], found["partial"]) == ("worse", True, 8, False)
    assert found["logs"][0]["log"] == "drive_3"
    assert {log["paired_by"] for log in found["logs"]} == {"fingerprint"}
    rmse = found["metrics"]["position.rmse_m"]
    assert rmse["change"] == pytest.approx(0.1, abs=1e-3)
    assert rmse["p_change"] == pytest.approx(2 * 2 / 2**8)  # of two that changed
    assert found["logs"][0]["figures"]["residual_m"]["change"] == pytest.approx(0.5, abs=1e-3)
    assert document(capsys, made / "before", made / "after") == found


def test_what_is_not_compared_is_named(sets: Path, capsys: pytest.CaptureFixture[str]) -> None:
    after = sets / "after"
    (after / "drive_0.mcap").rename(after / "renamed.mcap")
    (after / "drive_1.mcap").unlink()
    cut = after / "drive_2.mcap"
    cut.write_bytes(cut.read_bytes()[:-300])
    (after / "text.mcap").write_text("no recording")
    (after / "map.db").touch()
    result(after / "new.mcap", 77)
    assert run(sets / "before", after) == USAGE
    told = capsys.readouterr()
    for text in ("of a part of the logs", "no pair of their own: 4", "fails: drive_1: missing in the candidate"):
        assert text in told.out, told.out
    assert "drive_2.mcap: the file is cut" in told.err
    assert "maps are compared one by one, and map.db not at all here" in told.err
    assert "text.mcap is not an MCAP file" in told.err
    found = document(capsys, sets / "before", after)
    assert found["unpaired"] == {"baseline": ["drive_1"], "candidate": ["new"]}
    assert [(one["log"], one["side"]) for one in found["broken"]] == [("drive_2", "candidate"), ("text", "candidate")]
    assert ("drive_0", "renamed") in [(log["log"], log["candidate"]) for log in found["logs"]]


def test_a_recording_counts_once(sets: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Copies of one log are no more witnesses than the one."""
    for side in ("before", "after"):
        for path in (sets / side).iterdir():
            result(path, 0, 0.02 if path.stem == "drive_7" and side == "before" else 0.06)
    found = document(capsys, sets / "before", sets / "after")
    assert (found["pairs"], found["repeated"]) == (8, [f"drive_{i}" for i in range(1, 8)])
    rmse = found["metrics"]["position.rmse_m"]
    assert (rmse["verdict"], rmse["logs"]) == ("inconclusive", 1)
    assert rmse["baseline"] == pytest.approx((7 * 0.06 + 0.02) / 8)


def test_a_missing_log_fails_unless_criteria_say_otherwise(sets: Path, tmp_path: Path) -> None:
    shutil.copytree(sets / "before", sets / "less")
    (sets / "less" / "drive_1.mcap").unlink()
    assert run(sets / "before", sets / "less") == DIFFERENT
    (tmp_path / "c.toml").write_text('missing = "pass"')
    assert run(sets / "before", sets / "less", "--criteria", tmp_path / "c.toml") == DONE


def test_criteria_for_single_logs(made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    criteria = tmp_path / "c.toml"
    criteria.write_text(
        "[metrics.position.rmse_m]\nmargin = 0.9\nlog_margin = 0.3\nlimit = 0.1\n"
        "[metrics.heading.rmse_deg]\nmargin = 0.9\n"
    )
    assert run(made / "before", made / "after", "--criteria", criteria) == DIFFERENT
    fails = [line for line in capsys.readouterr().out.splitlines() if line.startswith("fails: ")]
    assert fails == [
        "fails: drive_3: position.rmse_m got worse by more than 0.3",
        "fails: drive_7: position.rmse_m is 0.11, beyond its limit of 0.1",
    ]


@pytest.mark.slow
def test_conditions_decide_alone(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sides = made / "before", made / "after"
    assert run(*sides, "--fail-on", "worst.position.rmse_m > 1") == DONE
    assert "fails" not in capsys.readouterr().out
    assert run(*sides, "--fail-on", "delta.position.rmse_m > 0.005") == DIFFERENT
    assert run(*sides, "--fail-on", "missing > 0") == DONE
    assert run(*sides, "--fail-on", "worst.position.rmsem > 1") == USAGE
    assert "did you mean worst.position.rmse_m?" in capsys.readouterr().err


@pytest.mark.slow
def test_blessed_results_stand_for_the_logs(sets: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blessed = sets / "blessed"
    assert document(capsys, sets / "before", "--baseline", blessed, "--bless", name="diff_bless")["logs"] == [*ERRORS_M]
    jsonschema.validate(json.loads((blessed / "blessed.json").read_text()), schema_of("blessed"))
    by_logs = document(capsys, sets / "before", sets / "after")
    assert document(capsys, sets / "after", "--baseline", blessed) == by_logs
    assert run(sets / "before", "--baseline", blessed) == DONE
    first = (blessed / "blessed.json").read_bytes()
    assert run(sets / "after", "--baseline", blessed, "--bless") == DONE
    assert run(sets / "after", "--baseline", blessed) == DONE
    assert first != (blessed / "blessed.json").read_bytes()


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"schema": "x/1"}', '{"schema": "mcap-landmarks/blessed/1", "logs": [{}]}']
)
def test_what_is_not_blessed_is_refused(text: str, sets: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (sets / "blessed").mkdir()
    (sets / "blessed" / "blessed.json").write_text(text)
    assert run(sets / "after", "--baseline", sets / "blessed") == USAGE
    assert "bless" in capsys.readouterr().err


def test_only_whole_results_are_blessed(sets: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cut = sets / "after" / "drive_2.mcap"
    cut.write_bytes(cut.read_bytes()[:-300])
    assert run(sets / "after", "--baseline", sets / "blessed", "--bless") == USAGE
    assert "drive_2.mcap: the file is cut" in capsys.readouterr().err
    assert not (sets / "blessed").exists()


@pytest.mark.slow
def test_truth_from_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, truth in (("bare", False), ("truth", True)):
        (tmp_path / name).mkdir()
        for drive in range(2):
            result(tmp_path / name / f"d{drive}.mcap", drive, truth=truth)
    assert "position.rmse_m" not in document(capsys, tmp_path / "bare", tmp_path / "bare")["metrics"]
    found = document(capsys, tmp_path / "bare", tmp_path / "bare", "--reference", tmp_path / "truth")
    assert found["metrics"]["position.rmse_m"]["baseline"] == pytest.approx(0.05)
    assert found["metrics"]["localized_share"]["verdict"] == "same"


@pytest.mark.slow
def test_junit_and_markdown(sets: Path, tmp_path: Path) -> None:
    evil = "a|b `x` <script>&@all\u202e\x01 #1 **bold**"
    for side in ("before", "after"):
        (sets / side / "drive_0.mcap").rename(sets / side / f"{evil}.mcap")
    (sets / "after" / "drive_1.mcap").write_text("no recording")
    junit, markdown = tmp_path / "j.xml", tmp_path / "m.md"
    assert run(sets / "before", sets / "after", "--junit", junit, "--markdown", markdown) == USAGE
    root = ET.fromstring(junit.read_text(encoding="utf-8"))  # noqa: S314 - we wrote it
    suites = {suite.get("name"): suite for suite in root}
    assert list(suites) == ["metrics", "logs"]
    for suite in root:
        cases = list(suite)
        assert {case.tag for case in cases} == {"testcase"}
        assert all(set(case.attrib) == {"classname", "name", "time"} for case in cases)
        outcomes = [child.tag for case in cases for child in case]
        counts = {"failures": "failure", "errors": "error", "skipped": "skipped"}
        assert {name: suite.get(name) for name in counts} == {
            name: str(outcomes.count(tag)) for name, tag in counts.items()
        }
        assert suite.get("tests") == str(len(cases)) == str(len(outcomes))
    assert suites["logs"].get("errors") == "1"
    assert len(suites["logs"]) == 8
    names = [case.get("name") or "" for case in suites["logs"]]
    assert "a|b `x` <script>&@all   #1 **bold**" in names
    text = markdown.read_text(encoding="utf-8")
    assert "`a\u00a6b 'x' <script>&@all   #1 **bold**`" in text
    assert text.startswith("### Results: worse (fails)\n")
    rows = text[text.index("| worst logs") :].split("\n\n")[0].splitlines()
    assert len(rows) == 2 + 7
    assert {row.count("|") for row in rows} == {6}
    before = junit.read_bytes(), markdown.read_bytes()
    assert run(sets / "before", sets / "after", "--junit", junit) == USAGE
    run(sets / "before", sets / "after", "--junit", junit, "--markdown", markdown, "--overwrite")
    assert (junit.read_bytes(), markdown.read_bytes()) == before


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("before", "name BASELINE and CANDIDATE, or give --baseline DIR"),
        ("before after --baseline before", "name the candidate alone"),
        ("before after --bless", "--bless: where to?"),
        ("before --baseline before --bless", "holds the results themselves"),
        ("before after --align", "are of two files"),
        ("before after --tolerance a.b=1", "are of two files"),
        ("before before/drive_0.mcap", "is no folder"),
        ("before/drive_0.mcap after/drive_0.mcap --criteria c.toml", "of two folders of logs"),
        ("before empty", "holds neither logs"),
        ("before other", "no log is in both"),
        ("before after --junit before/drive_0.mcap --overwrite", "is part of the input"),
    ],
)
def test_wrong_words_are_answered(
    words: str, told: str, sets: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (sets / "empty").mkdir()
    (sets / "other").mkdir()
    result(sets / "other" / "x.mcap", 99)
    monkeypatch.chdir(sets)
    assert run(*words.split()) == USAGE
    assert told in capsys.readouterr().err


def test_no_results_is_told(sets: Path) -> None:
    """A log without results is no pair, and the others are compared all the same."""
    with create_recording(sets / "after" / "drive_5.mcap") as writer:
        writer.add(Stamped(TRUTH_POSE, 10**18, PoseStamped.planar(10**18, "map", [0.0, 0, 0])))
    found = diff_sets(sets / "before", sets / "after")
    assert found["pairs"] == 7
    assert "has no results" in found["broken"][0]["error"]


@pytest.mark.slow
def test_catalogues_stand_for_the_folders_of_their_outputs(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for side in ("before", "after"):
        rows = [row(f"{name}.mcap", str(made / side / f"{name}.mcap")) for name in ERRORS_M]
        append_rows(tmp_path / f"{side}.db", [*rows, row("a.mcap", "a.json", verb="evaluate")])
    folders = document(capsys, made / "before", made / "after")
    assert document(capsys, tmp_path / "before.db", tmp_path / "after.db") == folders
    assert document(capsys, made / "before", tmp_path / "after.db") == folders
    append_rows(tmp_path / "after.db", [row("drive_1.mcap", "gone.mcap", 1), row("drive_2.mcap", None, 1)])
    assert run(tmp_path / "before.db", tmp_path / "after.db") == USAGE
    err = capsys.readouterr().err
    assert f"error: {tmp_path}/gone.mcap: is gone, which the last run of drive_1.mcap wrote" in err
    assert "error: drive_2.mcap: its last run left no output: failed" in err
    assert run(tmp_path / "before.db", MAP_DB) == USAGE
    assert "is no folder and no catalogue" in capsys.readouterr().err
