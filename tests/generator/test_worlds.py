"""Worlds in SDF: where their models stand, what becomes of them, and files that mean harm."""

from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks_generator.checks import stage
from mcap_landmarks_generator.loading import effective, load_scenario
from mcap_landmarks_generator.sdf_world import SdfModel, read_world
from mcap_landmarks_generator.world_objects import objects_of

WORLDS = Path(__file__).parent / "worlds"


def world(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "world.sdf"
    path.write_text(f'<sdf version="1.9"><world name="w">{text}</world></sdf>')
    return path


def place(model: SdfModel) -> list[float]:
    return [*model.world_from_model[:2, 3].tolist(), model.heading_rad]


def test_models_stand_where_frames_and_models_around_them_put_them() -> None:
    models = {model.name: model for model in read_world(WORLDS / "depot.sdf")}
    quarter = np.pi / 2
    expected = {
        "ground_plane": [0, 0, 0],
        "Fire hydrant": [10, 3, quarter],  # a metre along the aisle, which leads along y
        "visitor": [9, 6, quarter],  # at the end of the aisle, a metre to its left
        "suitcase_red": [20, 0.5, quarter],  # its handle is a metre along, and itself half a metre before that
        "sign": [22, 1, quarter],  # two metres to the right of the handle
        "column_7": [5, -5, 0],
        "rack_7": [5.1, -5, 0],
    }
    assert models.keys() == expected.keys()
    for name, pose in expected.items():
        np.testing.assert_allclose(place(models[name]), pose, atol=1e-12, err_msg=name)
    assert models["visitor"].uri == "Casual female"
    assert (models["column_7"].solid, models["column_7"].size_m) == ("cylinder", (0.1, 3.0))


def test_saved_poses_count_and_actors_walk() -> None:
    models = {model.name: model for model in read_world(WORLDS / "crossing.world")}
    np.testing.assert_allclose(place(models["fire_hydrant_0"]), [6, -2, 1])
    walker = models["walker"]
    np.testing.assert_allclose(place(walker)[:2], [4, -4])
    np.testing.assert_allclose(walker.way_xy, [[4, 4], [4, -4]])
    assert walker.walks_s == 10.0


def test_models_become_objects(tmp_path: Path) -> None:
    (tmp_path / "depot.sdf").write_text((WORLDS / "depot.sdf").read_text())
    (tmp_path / "depot.toml").write_text('[world]\nfile = "depot.sdf"\n[robot]\nstart = [0, 0, 0]\n')
    staged = stage(load_scenario(str(tmp_path / "depot.toml")))
    assert [(spec.class_name, spec.at) for spec in staged.scenario.objects] == [
        ("fire hydrant", (10.0, 3.0)),
        ("person", (9.0, 6.0)),
        ("suitcase", (20.0, 0.5)),
        ("stop sign", (22.0, 1.0)),
        ("pole", (5.0, -5.0)),
    ]
    assert len(staged.warnings) == 2
    assert staged.warnings[0].startswith("column_7, rack_7: of no class")
    assert staged.warnings[1].startswith("rack_7: left out")
    assert "world" not in effective(staged.scenario)  # no path gets into a manifest, and the objects are there


def test_the_scenario_says_which_class_a_model_is(tmp_path: Path) -> None:
    text = f'[world]\nfile = "{WORLDS}/depot.sdf"\nclasses = {{ "column_*" = "bench", "rack_*" = "" }}\n'
    (tmp_path / "depot.toml").write_text(text)
    staged = stage(load_scenario(str(tmp_path / "depot.toml")))
    assert [spec.class_name for spec in staged.scenario.objects][-1] == "bench"
    assert staged.warnings == ()
    (tmp_path / "depot.toml").write_text(text.replace("bench", "benhc"))
    with pytest.raises(ToolkitError, match=r"world\.classes\.column_.*choose one of"):
        load_scenario(str(tmp_path / "depot.toml"))


def test_the_world_stands_in_for_the_objects_of_a_scenario() -> None:
    setting = f"world.file={WORLDS / 'crossing.world'}"
    staged = stage(load_scenario("small", [setting, "trajectory.waypoints=[{at=[0, 0]}]"]))
    walker = next(placed for placed in staged.objects if placed.moves)
    assert [spec.class_name for spec in staged.scenario.objects] == ["car", "fire hydrant", "person"]
    assert walker.speed_mps == pytest.approx(1.6)
    assert staged.warnings == ()


def classes_of(file: str) -> tuple[dict[str, str], tuple[str, ...]]:
    found = objects_of(read_world(WORLDS / file), {})
    return dict(zip(found.models, (spec.class_name for spec in found.objects), strict=True)), found.warnings


def test_a_store_whose_models_have_names_in_mixed_case() -> None:
    """Words begin with capitals, lamps hang from the ceiling, and ground and roof are no objects."""
    classes, warnings = classes_of("store.world")
    assert {name.removeprefix("vendor_robot_store_"): one for name, one in classes.items()} == {
        "ShelfF_01": "box",
        "ShelfE_01": "box",
        "TrashCanC_01": "barrel",
        "PalletJackB_01": "box",
        "DeskC_01": "table",
        "WallB_01": "box",
    }
    assert len(warnings) == 2
    assert warnings[0].startswith("vendor_robot_store_WallB_01: of no class")
    assert warnings[1] == "vendor_robot_store_Lamp_01: left out, since they hang more than 2 m above the ground"


def test_a_block_of_a_city() -> None:
    classes, warnings = classes_of("block.sdf")
    assert classes == {
        "stop_sign": "stop sign",
        "lamp_post": "pole",
        "hydrant": "fire hydrant",
        "parked": "car",
        "hatch": "car",
        "cone_0": "cone",
        "drum": "barrel",
        "oak_tree": "tree",
        "pedestrian": "person",
        "house_1_0": "box",
        "mailbox": "box",
    }
    assert len(warnings) == 2
    assert warnings[0].startswith("house_1_0, mailbox: of no class")
    assert warnings[1] == "crowd: left out, since Gazebo scatters the members of a population"


CRATE = "<include><name>{}</name><uri>model://crate</uri><pose>{} 5 0 0 0 0</pose></include>"


@pytest.mark.parametrize(
    ("models", "words"),
    [
        (CRATE.format("a", 5) + CRATE.format("b", 5.1), "box_2 (model b) stands inside box_1 (model a)"),
        (
            CRATE.format("a", 5) + '<actor name="visitor"><script><trajectory id="0" type="walk">'
            "<waypoint><time>0</time><pose>5 8 0 0 0 0</pose></waypoint>"
            "<waypoint><time>4</time><pose>5 2 0 0 0 0</pose></waypoint></trajectory></script></actor>",
            "person_1 (model visitor) would walk into box_1 (model a)",
        ),
    ],
)
def test_what_is_wrong_with_its_objects_names_the_world_and_its_models(tmp_path: Path, models: str, words: str) -> None:
    path = world(tmp_path, models)
    with pytest.raises(ToolkitError) as caught:
        stage(load_scenario("small", [f"world.file={path}"]))
    assert str(caught.value) == f"{path}: {words}; move one of them"


CONE = "<include><uri>model://cone</uri>{}</include>"
RING = '<frame name="a"><pose relative_to="b"/></frame><frame name="b"><pose relative_to="a"/></frame>'
CHAIN = "".join(f'<frame name="f{i}"><pose relative_to="f{i + 1}"/></frame>' for i in range(3000))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (RING + CONE.format('<pose relative_to="a"/>'), "relative to itself"),
        (CHAIN + '<frame name="f3000"/>' + CONE.format('<pose relative_to="f0"/>'), "too long a chain"),
        (CONE.format('<pose relative_to="nowhere"/>'), "no frame 'nowhere' in"),
        (CONE.format("<pose>1 2 3</pose>"), "a pose has 3 numbers"),
        (CONE.format("<pose>1 2 3 x 5 6</pose>"), "not made of numbers"),
        (CONE.format("<pose>1 2 nan 4 5 6</pose>"), "finite numbers"),
        (CONE.format('<pose rotation_format="quat_xyzw">1 2 3 0 0 0 0</pose>'), "is zero"),
        ("<model name='m'>" * 40 + "</model>" * 40, "more than 30 deep"),
    ],
)
def test_what_makes_no_sense_is_named(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ToolkitError, match=words) as caught:
        read_world(world(tmp_path, text))
    assert "world.sdf: " in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('<!DOCTYPE sdf [<!ENTITY e SYSTEM "file:///etc/passwd">]><sdf><world>&e;</world></sdf>', "document type"),
        ('<!DOCTYPE s [<!ENTITY a "aaaaa"><!ENTITY b "&a;&a;&a;">]><sdf><world>&b;</world></sdf>', "document type"),
        ("<sdf><world>", "not an SDF file"),
        ("\0\1\2", "not an SDF file"),
        ("<sdf version='1.9'><model name='m'/></sdf>", "no world in it"),
        ("<robot name='r'/>", "no world in it"),
    ],
)
def test_files_that_mean_harm_or_are_no_worlds(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "bad.sdf").write_text(text)
    with pytest.raises(ToolkitError, match=words):
        read_world(tmp_path / "bad.sdf")


def test_a_world_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ToolkitError, match="no such world"):
        read_world(tmp_path / "none.sdf")
