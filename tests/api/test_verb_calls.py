"""Verbs that are called: what they give, and that options are those of the command line."""

from pathlib import Path
from typing import get_type_hints

import mcap_landmarks as ml
import mcap_landmarks.diff.comparison
import numpy as np
import pytest
from mcap_landmarks.channels import ODOMETRY, SCENE_OBJECTS, TF_STATIC
from mcap_landmarks.cli.option_groups import ImageOptions, LogOptions, ScanOptions
from mcap_landmarks.manifest import RUN
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.resources import resource
from mcap_landmarks.stage import Stamped

from tests.diff.recordings import localized_log

GOLDEN = Path(__file__).parents[1] / "golden"
DEMO = resource("recordings", "demo_map.mcap")
UNTIL = {"start": "2026-01-01T00:00:00Z", "end": "2026-01-01T00:00:01Z"}


def test_options_are_those_of_the_command_line() -> None:
    groups = {name for group in (LogOptions, ImageOptions, ScanOptions) for name in get_type_hints(group)}
    of_python = {"config": "config_file"}
    named = {of_python.get(name, name) for name in ml.Options.__annotations__}
    of_some_verbs = {"names", "extrinsics", "use", "lenient"}
    assert named - of_some_verbs == groups - {"json"}


def test_a_stage_runs_as_it_does_for_the_command_line(tmp_path: Path) -> None:
    output = tmp_path / "out.mcap"
    found = ml.run(DEMO, "cluster", output, settings={"cluster.range_m": [0.1, 3.0]}, remap={"/x": "/y"}, **UNTIL)
    assert [(stage.stage, stage.state) for stage in found.stages] == [("cluster", "ran")]
    assert repr(found) == f"<LogRun of {DEMO}: {output}; cluster ran>"
    assert found.losses == ()
    with open_recording(output) as recording:
        manifest = recording.metadata[RUN]
    assert manifest["verb"] == '"run"'
    assert '"range_m": [0.1, 3.0]' in manifest["config"]
    again = ml.run(DEMO, ["cluster"], output, settings={"cluster.range_m": [0.1, 3.0]}, remap={"/x": "/y"}, **UNTIL)
    assert again.stages[0].state == "reused"
    ml.run(DEMO, "cluster", output, heights=(0.1, 0.3), method="thesis", force=True, lenient=True, **UNTIL)


def test_what_is_wrong_is_said_as_by_the_command_line(tmp_path: Path) -> None:
    output = tmp_path / "out.mcap"
    with pytest.raises(ml.UsageError, match="rnge_m is no setting of cluster; did you mean range_m"):
        ml.run(DEMO, "cluster", output, settings={"cluster.rnge_m": 3})
    with pytest.raises(TypeError, match="ends is no option; there are config, end, every"):
        ml.run(DEMO, "cluster", output, ends=3)  # type: ignore[call-arg] # that is what is refused
    with pytest.raises(ml.UsageError, match="no stage is named"):
        ml.run(DEMO, [], output)
    with pytest.raises(ml.ToolkitError, match=r"none\.db: cannot be read"):
        ml.localize(DEMO, tmp_path / "none.db", output, **UNTIL)
    landmark_map = ml.LandmarkMap.read(GOLDEN / "map.db")
    with pytest.raises(ml.UsageError, match="map_file is of type LandmarkMap; give the path"):
        ml.localize(DEMO, landmark_map, output)  # type: ignore[arg-type] # that is what is refused
    with pytest.raises(ml.UsageError, match="logs is of type int"):
        ml.build_map([3], output)  # type: ignore[list-item] # that is what is refused
    assert not output.exists()


def test_a_map_is_written_to_names_that_tell_the_format(tmp_path: Path) -> None:
    with pytest.raises(ml.UsageError, match=r"one of \.db, \.txt, \.csv, \.json"):
        ml.LandmarkMap.read(GOLDEN / "map.db").write(tmp_path / "map.foo")
    assert not list(tmp_path.iterdir())


def test_a_map_is_built_of_what_logs_hold_and_localized_in(tmp_path: Path) -> None:
    whole, database = tmp_path / "whole.mcap", tmp_path / "map.db"
    log = with_results(whole)
    found = ml.build_map(log, database, output=tmp_path / "mapped.mcap", overwrite=True)
    assert found.losses == ()
    assert repr(found).startswith("<MapRun of 1 log: <LandmarkMap of ")
    landmark_map = ml.LandmarkMap.read(database)
    assert landmark_map.ids == found.landmark_map.ids
    assert "person" in landmark_map.classes
    assert (tmp_path / "mapped.mcap").exists()
    extended = ml.build_map([log], tmp_path / "more.db", prior=database)
    assert len(extended.landmark_map) == len(landmark_map)
    lasting = ml.build_map(log, tmp_path / "lasting.db", fixed=True).landmark_map
    assert "person" not in lasting.classes  # they walk


def with_results(path: Path) -> Path:
    """The bundled log with the golden scene objects in it."""
    with create_recording(path) as writer:
        for source, channels in ((DEMO, (TF_STATIC, ODOMETRY)), (GOLDEN / "map.mcap", (SCENE_OBJECTS,))):
            with open_recording(source) as recording:
                by_topic = {channel.topic: channel for channel in channels}
                wanted = [one for topic in by_topic for one in recording.connections(topic)]
                for raw in recording.messages(wanted, end_ns=recording.start_ns + 3 * 10**9):
                    channel = by_topic[raw.connection.topic]
                    writer.add(Stamped(channel, raw.log_time_ns, decode(channel.message, raw.data)))
    return path


def test_errors_come_pose_by_pose_beside_the_figures(tmp_path: Path) -> None:
    result = ml.evaluate(localized_log(tmp_path / "log.mcap"))
    assert repr(result) == "<EvaluationResult: 3 localized, 3 scored, RMSE 1.156 m>"
    np.testing.assert_allclose(result.errors["error_x_m"], [0.1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(result.errors["error_y_m"], [0, 0, 2], atol=1e-9)
    rmse_m = np.sqrt(np.mean(result.errors["distance_m"] ** 2))
    assert result.figures["position"]["rmse_m"] == pytest.approx(rmse_m)
    assert result.errors["time"].dtype == "datetime64[ns]"


def test_a_diff_has_the_document_of_the_verb(tmp_path: Path) -> None:
    log = localized_log(tmp_path / "log.mcap")
    same = ml.diff(log, log)
    assert (same.document["verdict"], same.fails) == ("same", False)
    found = ml.diff(GOLDEN / "map.db", GOLDEN / "map.db", fail_on="channels.landmarks.same > 0")
    assert found.fails
    assert (
        ml.diff(log, log, tolerance={"/landmarks/pose.position_m": 0.01, "/landmarks/pose.stamp_ns": "0+1%"}).losses
        == []
    )


def test_folders_and_drives_are_compared_as_diff_compares_them(tmp_path: Path) -> None:
    for folder in ("before", "after"):
        (tmp_path / folder).mkdir()
        localized_log(tmp_path / folder / "a.mcap")
    document = ml.diff_folders(tmp_path / "before", tmp_path / "after")
    assert [log["log"] for log in document["logs"]] == ["a"]
    assert not document["fails"]
    with pytest.raises(ml.UsageError, match="before holds several logs; compare such with diff_folders"):
        ml.diff(tmp_path / "before", tmp_path / "after")
    drives = ml.diff_drives(tmp_path / "before" / "a.mcap", tmp_path / "after" / "a.mcap")
    assert drives.document["verdict"] == "two drives"
    assert drives.fails
    (tmp_path / "empty").mkdir()
    with pytest.raises(ml.UsageError):
        ml.diff_folders(tmp_path / "before", tmp_path / "empty")
