"""The verb explain, on logs of scene objects and on one with detections, clusters, image and scan."""

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_IMAGE, DETECTIONS, SCAN, SCAN_OBJECTS, TF_STATIC
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import Image
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.transforms import TFMessage, Transform

from tests.cli.calls import call, schema_of
from tests.diff.recordings import START_NS, localized_log, localized_messages, write

PNG = b"\x89PNG"


def sensed(stamp_ns: int):  # type: ignore[no-untyped-def] # noqa: ANN201 - entries of a log
    """An image with two boxes, a scan and one cluster."""
    boxes = np.array([[10.0, 10, 20, 30], [30, 10, 40, 30]])
    names = ((("person", 0.9),), (("bench", 0.7),))
    ranges = np.full(8, 2.0, dtype=np.float32)
    ranges[0] = np.inf
    step = np.pi / 4
    return [
        (TF_STATIC, stamp_ns, TFMessage((Transform.planar(stamp_ns, ("base_footprint", "scan"), (0.5, 0, 0)),))),
        (CAMERA_IMAGE, stamp_ns, Image(stamp_ns, "cam", 48, 64, "rgb8", False, 192, bytes(48 * 192))),
        (DETECTIONS, stamp_ns, Detections(stamp_ns, "cam", ("0", "1"), names, boxes)),
        (
            SCAN,
            stamp_ns,
            LaserScan(stamp_ns, "scan", 0.0, 7 * step, step, 0.0, 0.0, 0.1, 9.0, ranges, np.zeros(0, np.float32)),
        ),
        (
            SCAN_OBJECTS,
            stamp_ns,
            ScanObjects(
                stamp_ns,
                "base_footprint",
                ("1",),
                ((("person", 0.6), ("", 0.4)),),
                (np.array([[3.0, 0], [2.8, 0]]),),
                (np.array([np.eye(2), np.eye(2)]),),
                np.array([0.4]),
            ),
        ),
    ]


def test_words_document_and_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = write(tmp_path / "r.mcap", [*sensed(START_NS), *localized_messages()])
    assert call("explain", log, "--at", START_NS, "-o", tmp_path / "e.png") == 0
    said = capsys.readouterr().out
    assert said.startswith(f"bundle at {START_NS}: localized")
    assert "detected: person 0.90, bench 0.70, in the image +0 ms beside the scan" in said
    assert "clustered: 1 clusters, 0 of them" in said
    assert "fused: 2 objects; detected, but no object: 1 bench" in said
    assert (tmp_path / "e.png").read_bytes().startswith(PNG)
    assert call("explain", log, "--at", START_NS, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, schema_of("explain"))
    assert (document["clusters"], len(document["detections"]), document["status"]) == (1, 2, "localized")


def test_a_log_of_scene_objects_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = localized_log(tmp_path / "r.mcap")
    assert call("explain", log, "--at", START_NS + 310_000_000, "-o", tmp_path / "e.svg") == 0
    said = capsys.readouterr().out
    assert f"bundle at {START_NS + 300_000_000}: too_few_objects" in said
    assert "FAILS  objects: 1 objects in the bundle, at least 2 needed" in said
    assert "detected: nothing that the log tells" in said
    first = (tmp_path / "e.svg").read_bytes()
    assert call("explain", log, "--at", START_NS + 310_000_000, "-o", tmp_path / "e.svg") == 0
    assert (tmp_path / "e.svg").read_bytes() == first


def test_wrong_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = localized_log(tmp_path / "r.mcap")
    assert call("explain", log, "--at", 5) == 1
    assert "no bundle with scene objects within 3 s of 5" in capsys.readouterr().err
    assert call("explain", log, "--at", START_NS, "-o", tmp_path / "e.gif") == 2
    assert call("explain", log, "--at", "yesterday") == 2
