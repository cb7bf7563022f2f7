"""Scenario files: what they may say, what they extend, and errors that name the line."""

import json
import tomllib
from pathlib import Path

import jsonschema
import pytest
from mcap_landmarks.errors import ToolkitError, UsageError
from mcap_landmarks_generator.bundled import FOLDER, bundled
from mcap_landmarks_generator.checks import stage
from mcap_landmarks_generator.loading import effective, load_scenario
from mcap_landmarks_generator.scenario import ADAPTER, json_schema
from mcap_landmarks_generator.toml_lines import lines_of

from tests.generator.conftest import StageText

GOOD = """\
seed = 4
objects = [
  { class = "fire hydrant", at = [3.0, 0.0] },
  { class = "suitcase", at = [5.0, 2.0] },
]
[robot]
start = [0.0, 0.0, 0.0]
[camera]
rate_hz = 5
[trajectory]
waypoints = [
  { at = [1.0, 0.0] },
  { at = [1.0, 2.0], stop_s = 1.0 },
]
"""


def refused(tmp_path: Path, text: str) -> str:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(ToolkitError) as caught:
        stage(load_scenario(str(path)))
    return str(caught.value).replace(str(path), "bad.toml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"suitcase"', '"dragon"', "bad.toml:4: objects.1.class = 'dragon': choose one of person, bicycle"),
        ("at = [5.0, 2.0]", "at = [3.1, 0.1]", "bad.toml:4: suitcase_1 stands inside fire_hydrant_1"),
        (
            "at = [1.0, 0.0] }",
            "at = [4.0, 0.0] }",
            "bad.toml:12: waypoint 0 at (4, 0) cannot be reached: fire",
        ),
        ("at = [1.0, 2.0],", "at = [5.0, 2.1],", "bad.toml:13: waypoint 1 at (5, 2.1) cannot be reached: suitcase_1"),
        ("rate_hz = 5", "rate_hz = -5", "bad.toml:9: camera.rate_hz = -5: should be greater than 0"),
        ("rate_hz = 5", "rat_hz = 5", "bad.toml:9: unknown key rat_hz; did you mean rate_hz?"),
        (
            "[camera]",
            "[light]\nwarmth = 3\n[camera]",
            "bad.toml:9: unknown key warmth; there are ambient, azimuth_deg, diffuse",
        ),
        ("at = [5.0, 2.0]", "at = [5.0, 2.0], yaw = 3", "bad.toml:4: unknown key yaw; did you mean"),
        ("[camera]", "[ring_lidar]\nring = 16\n[camera]", "bad.toml:9: unknown key ring; did you mean rings?"),
        ("seed = 4", "sede = 4", "bad.toml:1: unknown key sede; did you mean seed?"),
        ("rate_hz = 5", 'when = "often"', "bad.toml:9: camera.when = 'often': should be 'always', 'stops' or 'never'"),
        (
            "start = [0.0, 0.0, 0.0]",
            "start = [3.0, 0.2, 0.0]",
            "bad.toml:7: the robot would start inside fire",
        ),
        ('class = "suitcase", ', "", "bad.toml:4: the key class is missing"),
        ('"suitcase"', '"suitcase", variant = "huge"', "bad.toml:4: unknown variant 'huge' of suitcase"),
        ("at = [5.0, 2.0]", "at = [5.0, nan]", "bad.toml:4: objects.1.at.1 = nan: should be a finite number"),
        ("seed = 4", "seed = ", "not a TOML file: Invalid value (at line 1, column 8)"),
        ("[camera]", "[groups]\ncount = 3\n[camera]", "bad.toml:13: groups bring a way of their own"),
        ("seed = 4", 'extends = "nowhere"', "nowhere: there is no such scenario file"),
        (
            'class = "suitcase", at = [5.0, 2.0]',
            'class = "person", variant = "legs", at = [5.0, 0.0], walk = [[1.0, -0.1]]',
            "bad.toml:4: person_1 would walk into fire_hydrant_1",
        ),
    ],
)
def test_refuses_a_bad_scenario_with_its_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in GOOD
    assert message in refused(tmp_path, GOOD.replace(old, new))


def test_a_file_may_extend_another_one(tmp_path: Path) -> None:
    (tmp_path / "base.toml").write_text(GOOD)
    child = tmp_path / "child.toml"
    child.write_text('extends = "base.toml"\nseed = 9\n[camera]\nwhen = "stops"\n')
    scenario = load_scenario(str(child)).scenario
    assert (scenario.seed, scenario.camera.when, scenario.camera.rate_hz) == (9, "stops", 5.0)
    assert len(scenario.objects) == 2


def test_an_error_in_the_extended_file_names_that_file(tmp_path: Path) -> None:
    (tmp_path / "base.toml").write_text(GOOD.replace("rate_hz = 5", "rate_hz = 0"))
    child = tmp_path / "child.toml"
    child.write_text('extends = "base.toml"\n[camera]\nwhen = "stops"\n')
    with pytest.raises(ToolkitError, match=r"base\.toml:9: camera\.rate_hz = 0"):
        load_scenario(str(child))


def test_files_that_extend_each_other_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('extends = "b.toml"\n')
    (tmp_path / "b.toml").write_text('\nextends = "a.toml"\n')
    with pytest.raises(ToolkitError, match=r"b\.toml:2: a\.toml extends this file in turn"):
        load_scenario(str(tmp_path / "a.toml"))


def test_settings_come_over_the_file(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(GOOD)
    loaded = load_scenario(str(path), ["camera.rate_hz=2.5", "odometry.source=world", "lidar.beams=720"], seed=11)
    assert loaded.scenario.camera.rate_hz == 2.5
    assert loaded.scenario.odometry.source == "world"
    assert (loaded.scenario.lidar.beams, loaded.scenario.seed) == (720, 11)


@pytest.mark.parametrize("setting", ["camera.rate_hz", "camera.rat_hz=3", "camera.rate_hz=0", "=3", "camera..x=1"])
def test_a_bad_setting_is_wrong_usage(setting: str) -> None:
    with pytest.raises(UsageError, match=r"--set "):
        load_scenario("small", [setting])


def test_objects_appear_and_vanish_between_sessions_and_keep_their_ids(stage_text: StageText) -> None:
    text = GOOD.replace("at = [3.0, 0.0] }", "at = [3.0, 0.0], sessions = [1] }").replace("[5.0, 2.0]", "[3.1, 0.1]")
    text = text.replace("[robot]", "", 1).replace("start = [0.0, 0.0, 0.0]\n", "")
    more = '  { class = "suitcase", at = [6.0, 2.0] },\n]'
    text = text.replace("at = [3.1, 0.1] },\n]", f"at = [3.1, 0.1], sessions = [2, 3] }},\n{more}")
    found = {n: [one.object_id for one in stage_text(f"session = {n}\n{text}").objects] for n in (1, 2)}
    assert found == {1: ["fire_hydrant_1", "suitcase_2"], 2: ["suitcase_1", "suitcase_2"]}
    both = text.replace("sessions = [2, 3]", "sessions = [1, 2]")
    with pytest.raises(ToolkitError, match=r"scene\.toml:4: suitcase_1 stands inside fire_hydrant_1"):
        stage_text(both)


def test_an_unknown_name_gets_a_hint() -> None:
    with pytest.raises(UsageError, match="did you mean small"):
        load_scenario("smal")


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(bundled()))
def test_bundled_scenarios_can_be_run(name: str) -> None:
    staged = stage(load_scenario(name))
    assert staged.scenario.trajectory.waypoints
    assert len(staged.objects) >= 9


def test_every_bundled_scenario_says_what_it_is_for() -> None:
    assert set(bundled()) >= {
        "thesis_map",
        "thesis_localize",
        "loop",
        "small",
        "cluttered",
        "random",
        "street",
        "campus",
        "warehouse",
        "seasons",
    }
    assert all(len(text) > 20 for text in bundled().values())


def test_the_effective_scenario_makes_the_same_scenario() -> None:
    scenario = load_scenario("thesis_map_drift").scenario
    assert ADAPTER.validate_python(json.loads(json.dumps(effective(scenario)))) == scenario


def test_the_schema_in_the_repository_is_the_code_s() -> None:
    """Remake it with: python -m tests.generator.test_scenario."""
    assert json.loads(_SCHEMA.read_text()) == json_schema()


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.toml")), ids=lambda path: path.stem)
def test_bundled_files_fit_the_schema(path: Path) -> None:
    jsonschema.validate(tomllib.loads(path.read_text()), json.loads(_SCHEMA.read_text()))


def test_lines_are_found_in_all_that_toml_allows() -> None:
    text = 'a = 1\nb = [1,\n  {x = "q]", y = [2,\n 3]}] # c ]\n"c d".e = """\n"""\n'
    text += "[t]\nk = 'v'\n[[o]]\n[[o]]\nz = 2\n[o.s]\nw = 1"
    tomllib.loads(text)
    lines = lines_of(text)
    assert lines["a",] == 1
    assert lines["b", 1, "y", 1] == 4
    assert lines["c d", "e"] == 5
    assert lines["t", "k"] == 8
    assert (lines["o", 0], lines["o", 1, "z"], lines["o", 1, "s", "w"]) == (9, 11, 13)


_SCHEMA = FOLDER.parents[2] / "schemas" / "json" / "scenario.schema.json"

if __name__ == "__main__":
    _SCHEMA.write_text(json.dumps(json_schema(), indent=2) + "\n")
