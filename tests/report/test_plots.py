"""Plots show what there is, and the same input gives the same bytes."""

import io
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from matplotlib.quiver import Quiver
from mcap_landmarks.channels import MAP_MARKERS, MAP_POSE, MATCH, SCENE_OBJECTS, TRUTH_OBJECTS, TRUTH_POSE
from mcap_landmarks.errors import RecordingError
from mcap_landmarks.evaluation.trajectory import Trajectory
from mcap_landmarks.geometry.se2 import compose, transform_points
from mcap_landmarks.maps.database import write_map
from mcap_landmarks.maps.map_markers import markers_from_map
from mcap_landmarks.maps.model import LandmarkMap, MapSource
from mcap_landmarks.messages.poses import PoseStamped
from mcap_landmarks.report.drawing import breaks, gather, waypoints
from mcap_landmarks.report.plots import FORMATS, figure, save

from tests.diff.recordings import LANDMARKS, START_NS, localized_log, localized_messages, write
from tests.maps.examples import small_map

APPENDIX_D = Path(__file__).parents[1] / "data" / "thesis_appendix_d.txt"
MOTION = np.array([30.0, -4.0, 1.0])


def legend(*paths: Path, aligned: bool = False) -> list[str]:
    axes = figure(gather(paths, aligned=aligned)[0]).axes[0]
    return [text.get_text() for text in axes.get_legend().get_texts()]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return localized_log(tmp_path / "run.mcap")


@pytest.fixture
def database(tmp_path: Path) -> Path:
    write_map(tmp_path / "map.db", small_map())
    return tmp_path / "map.db"


def mapped_log(path: Path) -> Path:
    """A log with a mapped path, in another frame than the truth."""
    kept = [entry for entry in localized_messages() if entry[0] in {TRUTH_POSE, SCENE_OBJECTS}]
    path_of_map = [
        (MAP_POSE, time_ns, PoseStamped.planar(time_ns, "map", compose(MOTION, message.pose)))
        for _, time_ns, message in kept
        if isinstance(message, PoseStamped)
    ]
    return write(path, kept + path_of_map)


def test_a_run_shows_positions_errors_and_what_is_false(log: Path) -> None:
    assert legend(log) == [
        "bench",
        "person",
        "suitcase",
        "true object",
        "true path",
        "heading",
        "start",
        "end",
        "position",
        "its error",
        "over 1 m off",
    ]


def test_a_map_shows_regions_and_groups(database: Path) -> None:
    assert legend(database) == ["fire hydrant", "person", "suitcase", "95 % region"]  # its groups share landmarks
    apart = replace(small_map(), groups=small_map().groups[:1])
    write_map(database, apart)
    assert legend(database)[-1] == "robot at a group"


def test_runs_are_told_apart(database: Path, log: Path, tmp_path: Path) -> None:
    shown = legend(database, log, mapped_log(tmp_path / "built.mcap"))
    assert "run: position" in shown
    assert "built: estimated path" in shown
    assert shown[:3] == ["fire hydrant", "person", "suitcase"]  # the first map counts


def test_the_log_that_a_map_was_made_of_shows_its_landmarks(tmp_path: Path) -> None:
    """They are in the log as markers only."""
    there = LandmarkMap.surveyed(LANDMARKS.ids, LANDMARKS.classes, LANDMARKS.positions_xy, MapSource("import", "f"))
    write(tmp_path / "mapped.mcap", [(MAP_MARKERS, START_NS, markers_from_map(there, START_NS))])
    drawing, _ = gather([mapped_log(tmp_path / "path.mcap"), tmp_path / "mapped.mcap"], aligned=False)
    assert drawing.landmarks is not None
    assert drawing.landmarks.classes == LANDMARKS.classes
    np.testing.assert_array_equal(drawing.landmarks.positions_xy, LANDMARKS.positions_xy)
    assert legend(tmp_path / "mapped.mcap") == ["bench", "person", "suitcase"]


def test_start_end_and_headings_of_a_path_are_marked(tmp_path: Path) -> None:
    drawing, _ = gather([mapped_log(tmp_path / "m.mcap")], aligned=True)
    axes = figure(drawing).axes[0]
    marks = {line.get_label(): np.asarray(line.get_xydata()) for line in axes.get_lines()}
    np.testing.assert_allclose(marks["start"], [[1, 2]], atol=1e-9)
    np.testing.assert_allclose(marks["end"], [[5, 2]], atol=1e-9)
    (arrows,) = [entry for entry in axes.collections if isinstance(entry, Quiver)]
    np.testing.assert_allclose(np.arctan2(arrows.V, arrows.U), 0.1, atol=1e-9)


def test_headings_are_marked_evenly_along_the_way() -> None:
    """Where the robot stood for long there is one arrow, and a position without heading has none."""
    x = np.concatenate([np.zeros(50), np.linspace(0, 10, 50)])
    poses = np.column_stack([x, np.zeros((100, 2))])
    poses[70, 2] = np.nan
    found = waypoints(Trajectory.of(np.arange(100), poses), 10)
    assert len(found) == 10
    assert np.diff(found[:, 0]).min() > 0.7
    assert not len(waypoints(Trajectory.of(np.arange(3), np.full((3, 3), np.nan)), 10))
    assert len(waypoints(Trajectory.of(np.arange(3), np.zeros((3, 3))), 10)) == 1


def test_positions_of_the_thesis_stand_alone() -> None:
    assert legend(APPENDIX_D) == ["position", "its error"]
    assert legend(APPENDIX_D, aligned=True) == ["position", "its error"]


def test_many_classes_are_labelled_instead(tmp_path: Path) -> None:
    names = tuple(f"landmark_{i}" for i in range(12))
    positions = np.array([[i % 4, i // 4] for i in range(12)]) * 3.0
    write_map(tmp_path / "m.db", LandmarkMap.surveyed(names, names, positions, MapSource("import", "f")))
    axes = figure(gather([tmp_path / "m.db"], aligned=False)[0]).axes[0]
    assert [text.get_text() for text in axes.texts] == [str(i) for i in range(12)]


def test_alignment_moves_estimates_to_the_truth(tmp_path: Path) -> None:
    drawing, _ = gather([mapped_log(tmp_path / "m.mcap")], aligned=True)
    run = drawing.runs[0]
    assert run.truth is not None
    np.testing.assert_allclose(run.estimate.poses, run.truth.poses, atol=1e-9)


def test_alignment_of_a_map_alone_uses_its_landmarks(tmp_path: Path) -> None:
    there = LandmarkMap.surveyed(
        LANDMARKS.ids, LANDMARKS.classes, transform_points(MOTION, LANDMARKS.positions_xy), MapSource("import", "f")
    )
    write_map(tmp_path / "m.db", there)
    kept = [entry for entry in localized_messages() if entry[0] == TRUTH_POSE]
    truth = write(tmp_path / "t.mcap", [(TRUTH_OBJECTS, START_NS, LANDMARKS), *kept])
    moved = gather([tmp_path / "m.db", truth], aligned=True)[0].landmarks
    assert moved is not None
    np.testing.assert_allclose(moved.positions_xy, LANDMARKS.positions_xy, atol=1e-9)


def test_lines_break_where_time_does() -> None:
    times = np.array([0, 1, 2, 10, 11]) * 10**9
    poses = np.column_stack([np.arange(5.0), np.zeros(5), np.zeros(5)])
    drawn = breaks(Trajectory.of(times, poses))
    assert np.flatnonzero(np.isnan(drawn[:, 0])).tolist() == [3]
    assert not len(breaks(Trajectory.of(times * 10, poses)))


@pytest.mark.slow
@pytest.mark.parametrize("form", list(FORMATS))
def test_same_input_same_bytes(form: str, database: Path, log: Path) -> None:
    pictures = []
    for _ in range(2):
        stream = io.BytesIO()
        save(partial(figure, gather([database, log], aligned=False)[0], "A title"), stream, form)
        pictures.append(stream.getvalue())
    assert pictures[0] == pictures[1]
    assert len(pictures[0]) > 5000
    assert b"202" not in pictures[0][:1000] or form == "png"  # no year


def test_nothing_to_draw(tmp_path: Path) -> None:
    matches = write(tmp_path / "m.mcap", [entry for entry in localized_messages() if entry[0] == MATCH])
    with pytest.raises(RecordingError, match="neither poses nor landmarks to draw"):
        gather([matches], aligned=False)
