"""Stages that nobody knew before: found by name, and chosen where several write the same channel."""

import dataclasses
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap_landmarks import stages
from mcap_landmarks.channels import CAMERA_IMAGE, DETECTIONS, MATCH, SCAN, SCENE_MARKERS, SCENE_OBJECTS
from mcap_landmarks.config import gather, load_files
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.manifest import file_hash, stage_records
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.runs.pipeline import LogRun, run_stages
from mcap_landmarks.runs.plan import Request
from mcap_landmarks.runs.thinning import TOO_FAST, Thinning
from mcap_landmarks.stage import Connection, Stage

from tests.cli.calls import call, refused, topics
from tests.maps.examples import small_map
from tests.runs.chain import COUNT, raw_messages, two_posts

TOYS = Path(__file__).parent / "toy_stages"


@pytest.fixture(autouse=True)
def _with_toy_stages(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Two files in the folder of stages: `beacons` makes scene objects of images, `echoes` makes them of scans."""
    monkeypatch.setattr(stages, "__path__", [*stages.__path__, str(TOYS)])
    yield
    for path in TOYS.glob("*.py"):
        sys.modules.pop(f"{stages.__name__}.{path.stem}", None)


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """A folder with a log of both sensors, one of each, a detector and a map."""
    logs = {"both": (), "images": (SCAN,), "scans": (CAMERA_IMAGE,), "none": (SCAN, CAMERA_IMAGE)}
    for name, left_out in logs.items():
        with create_recording(tmp_path / f"{name}.mcap") as writer:
            for stamped in raw_messages():
                if stamped.channel not in left_out:
                    writer.add(stamped)
    two_posts(tmp_path / "model.onnx")
    write_map(tmp_path / "map.db", small_map())
    return tmp_path


def localized(here: Path, log: str, output: str = "out", *use: str) -> LogRun:
    files = {"model": here / "model.onnx", "map": here / "map.db"}
    request = Request(here / f"{log}.mcap", files=files, use=use)
    return run_stages(request, here / f"{output}.mcap", ["localize"], "localize", lacking=True)


def names(run: LogRun) -> list[str]:
    return [stage.stage for stage in run.stages]


def test_a_stage_is_one_file_and_takes_its_setting(here: Path) -> None:
    settings = gather(None, ["beacons.distance_m=2.5"], None)
    request = Request(here / "images.mcap", settings, thinning=Thinning(rate_hz=2.0))
    run = run_stages(request, here / "out.mcap", ["beacons"], "run")
    assert run.outcome.counts == {"person": run.outcome.bundles}
    assert run.outcome.bundles + run.outcome.dropped[TOO_FAST] == COUNT
    with open_recording(here / "out.mcap") as recording:
        raw = next(recording.messages(recording.connections(SCENE_OBJECTS.topic)))
        assert decode(SCENE_OBJECTS.message, raw.data).positions_xy.tolist() == [[2.5, 0.0]]
        record = stage_records(recording.metadata)["beacons"]
    assert record.config == {"method": "default", "distance_m": 2.5}
    assert record.resources == {"label": file_hash(TOYS / "label.txt")}


def test_its_declaration_says_where_channels_go(here: Path) -> None:
    run = run_stages(Request(here / "both.mcap"), here / "out.mcap", ["beacons"], "run")
    found = topics(here / "out.mcap")
    assert found["/camera/1"] == found[SCENE_OBJECTS.topic] == COUNT
    assert not {SCENE_MARKERS.topic, "/tf"} & found.keys()
    assert run.notes == (f"no transforms beside {CAMERA_IMAGE.topic}",)


def test_a_file_that_the_stage_does_not_choose_has_to_be_given() -> None:
    stage = stages.find_stage("beacons")
    assert isinstance(stage, Stage)
    files = load_files(stage, {}, {})[1]
    assert (files.paths, files.origins) == ({"label": TOYS / "label.txt"}, {"label": "toy"})
    files = load_files(stage, {"beacons": {"label": "a"}}, {"label": Path("b")})[1]
    assert (files.paths, files.origins) == ({"label": Path("b")}, {"label": "file"})
    with pytest.raises(UsageError, match="beacons needs a label; give --label FILE"):
        load_files(dataclasses.replace(stage, choices={}), {}, {})


@pytest.mark.parametrize(("log", "chosen"), [("images", "beacons"), ("scans", "echoes")])
def test_the_one_whose_sources_the_log_has_is_chosen(here: Path, log: str, chosen: str) -> None:
    assert names(localized(here, log)) == [chosen, "localize"]


def test_where_several_are_possible_the_error_names_them_and_the_option(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, given = here / "both.mcap", ("--map", here / "map.db", "--model", here / "model.onnx", "-o", here / "out.mcap")
    said = refused(capsys, 2, "localize", log, *given)
    assert "beacons and echoes and fuse can make scene_objects" in said
    assert "choose one with --use NAME" in said
    assert call("localize", log, *given, "--use", "echoes") == 0
    assert "echoes ran" in capsys.readouterr().err
    assert "nobody is no stage" in refused(capsys, 2, "localize", log, *given, "--use", "nobody")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("use", "run"),
    [
        ("beacons", ["beacons", "localize"]),
        ("echoes", ["echoes", "localize"]),
        ("fuse", ["cluster", "detect", "fuse", "localize"]),
    ],
)
def test_what_the_user_names_is_chosen(here: Path, use: str, run: list[str]) -> None:
    assert names(localized(here, "both", "out", use)) == run


def test_a_stage_that_is_run_anyway_is_chosen(here: Path) -> None:
    request = Request(here / "both.mcap", files={"map": here / "map.db"})
    run = run_stages(request, here / "out.mcap", ["localize", "echoes"], "run", lacking=True)
    assert names(run) == ["echoes", "localize"]


def test_the_one_whose_results_lie_in_the_log_is_chosen(here: Path) -> None:
    localized(here, "both", "first", "echoes")
    run = localized(here, "first", "second")
    assert {stage.stage: stage.state for stage in run.stages} == {"echoes": "reused", "localize": "reused"}


def test_results_of_another_stage_on_the_same_topic_are_replaced(here: Path) -> None:
    localized(here, "both", "first", "fuse")
    request = Request(here / "first.mcap")
    run = run_stages(request, here / "second.mcap", ["echoes"], "run")
    found = topics(here / "second.mcap")
    assert found[SCENE_OBJECTS.topic] == found[DETECTIONS.topic] == COUNT
    assert MATCH.topic not in found
    assert run.notes == (
        "fuse's results in the log are on topics that echoes writes; they are left out",
        "localize's results in the log were made from results that changed; they are left out",
    )


def test_a_topic_has_one_writer_in_a_run(here: Path) -> None:
    with pytest.raises(UsageError, match=f"beacons and echoes both write {SCENE_OBJECTS.topic}; name one of them"):
        run_stages(Request(here / "both.mcap"), here / "out.mcap", ["beacons", "echoes"], "run")


def test_a_log_without_any_source_is_told_all_of_them(here: Path) -> None:
    with pytest.raises(RecordingError, match=r"no image \(.*\) or scan \(.*\) to make it from"):
        localized(here, "none")


def test_objects_of_a_scan_that_is_not_there_are_fused_without_what_only_a_cloud_adds(here: Path) -> None:
    """A log may bring scan objects of someone else; the clustered cloud beside them is optional."""
    call(
        "run",
        here / "both.mcap",
        "-o",
        here / "made.mcap",
        "--stages",
        "detect,cluster",
        "--model",
        here / "model.onnx",
    )
    brought: dict[str, Connection] = {}
    with open_recording(here / "made.mcap") as made, create_recording(here / "brought.mcap") as writer:
        for raw in made.messages():
            if raw.connection.topic not in {SCAN.topic, CAMERA_IMAGE.topic}:
                plain = dataclasses.replace(raw.connection, metadata={})
                writer.write(raw._replace(connection=brought.setdefault(raw.connection.topic, plain)))
    assert names(localized(here, "brought", "out", "fuse")) == ["fuse", "localize"]
