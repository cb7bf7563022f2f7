"""The verb export for Rerun: what is in the file, as its own reader finds it, is what is in the log."""

import json
import sys
from collections import Counter
from pathlib import Path

import jsonschema
import pytest
from mcap_landmarks.channels import (
    CAMERA_IMAGE,
    MATCH,
    ODOMETRY,
    POSE,
    POSE_COVARIANCE,
    SCAN,
    SCENE_OBJECTS,
    TRUTH_POSE,
)
from mcap_landmarks.cli.console import DONE, PARTIAL
from rerun.chunk import RrdReader

from tests.cli.calls import call, refused, schema_of, topics
from tests.diff.recordings import localized_log

CAMERA, SCANS = "/map/robot/camera_rgb_optical_frame", "/map/robot/base_scan/scan"


def rows(path: Path) -> Counter[str]:
    """Rows by entity."""
    found = Counter[str]()
    for chunk in RrdReader(path).stream():
        found[chunk.entity_path] += chunk.num_rows
    return found


def columns(path: Path, entity: str) -> set[str]:
    """The columns of an entity."""
    chunks = [chunk for chunk in RrdReader(path).stream() if chunk.entity_path == entity]
    return {name for chunk in chunks for name in chunk.to_record_batch().schema.names}


def test_every_message_is_a_row_of_a_typed_entity(
    whole_result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "r.rrd"
    assert call("export", whole_result, "--format", "rerun", "-o", out, "--json") == DONE
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, schema_of("export"))
    found, there = rows(out), topics(whole_result)
    assert {f"/{entity.strip('/')}": count for entity, count in document["entities"].items()} == found
    for entity, topic, always in (
        (f"{CAMERA}/image", CAMERA_IMAGE.topic, 0),
        (f"{CAMERA}/image/detections", "/landmarks/detections", 0),
        (f"{CAMERA}/image/truth", "/ground_truth/detections", 0),
        (SCANS, SCAN.topic, 0),
        ("/map/robot/objects", SCENE_OBJECTS.topic, 0),
        ("/map/robot", POSE.topic, 1),
        ("/map/truth", TRUTH_POSE.topic, 1),
        ("/map/pose_covariance", POSE_COVARIANCE.topic, 0),
        ("/odom/robot", ODOMETRY.topic, 0),
        ("/status/code", MATCH.topic, 0),
        ("/status/text", MATCH.topic, 0),
    ):
        assert found[entity] == there[topic] + always > 0, entity
    for once in ("/", "/map/landmarks", "/map/path", "/map/true_path", "/odom/robot_path", "/map/robot/base_scan"):
        assert found[once] == 1, once
    assert found[CAMERA] == 2  # where it is, and how it projects
    names = columns(out, f"{CAMERA}/image/detections")
    assert {"log_time", "stamp", "Boxes2D:half_sizes", "Boxes2D:class_ids", "Boxes2D:labels"} <= names
    assert "Points3D:positions" in columns(out, SCANS)
    assert "Pinhole:image_from_camera" in columns(out, CAMERA)
    assert "AnnotationContext:context" in columns(out, "/")


def test_what_a_log_lacks_is_left_out(tmp_path: Path) -> None:
    log, out = localized_log(tmp_path / "r.mcap"), tmp_path / "r.rrd"
    assert call("export", log, "--format", "rerun", "-o", out) == DONE
    found = rows(out)
    assert not [entity for entity in found if "image" in entity or "scan" in entity or "odom" in entity]
    assert (found["/map/robot"], found["/status/code"], found["/map/landmarks"]) == (4, 5, 1)


def test_trouble_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = localized_log(tmp_path / "r.mcap"), tmp_path / "r.rrd"
    words = "export", log, "--format", "rerun", "-o"
    assert "use .rrd" in refused(capsys, 2, *words, tmp_path / "r.mcap2")
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "rerun", None)
        assert "pip install 'mcap-landmarks[rerun]'" in refused(capsys, 1, *words, out)
    assert not out.exists()
    log.write_bytes(log.read_bytes()[:-200])
    assert call(*words, out) == PARTIAL
    assert rows(out)


def test_its_own_earlier_result_is_written_again_and_no_other_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, out = localized_log(tmp_path / "r.mcap"), tmp_path / "r.rrd"
    words = "export", log, "--format", "rerun", "-o", out
    assert call(*words) == DONE
    assert call(*words) == DONE
    out.write_bytes(b"RRF2 of another log")
    assert "--overwrite" in refused(capsys, 2, *words)
