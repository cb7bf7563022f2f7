"""Clustering from the command line: channels, choices of topics, point clouds, and refusals."""

import json
from collections.abc import Sequence
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from mcap_landmarks.channels import ODOMETRY, SCAN, SCAN_FILTERED, SCAN_OBJECTS, TF_STATIC
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.resources import resource
from mcap_landmarks.stage import Channel, Stamped

from tests.cli.calls import call, topics
from tests.cli.logs import write
from tests.lidar.scans import disc, ranges
from tests.stages.test_cluster import mounting, scan

SCHEMA = json.loads(resource("schemas", "json/cluster.schema.json").read_text())
SECOND = 10**9
CLOUD = Channel("/points", PointCloud2)


def content(topics: Sequence[str] = (SCAN.topic,), count: int = 3) -> list[Stamped]:
    """A robot that stands before a hydrant, with a LiDAR per topic."""
    found = [Stamped(TF_STATIC, 1, TFMessage((mounting(),)))]
    distances = ranges([disc(3.0, 0.5, 0.15)], np.random.default_rng(1))
    for k in range(1, count + 1):
        now = k * SECOND
        for i in range(3):
            at = now + (i - 1) * SECOND // 10
            still = Odometry.planar(at, ("odom", "base_footprint"), np.zeros(3), np.zeros((3, 3)))
            found.append(Stamped(ODOMETRY, at, still))
        found += [Stamped(Channel(topic, LaserScan), now, scan(distances, now)) for topic in topics]
    return sorted(found, key=lambda stamped: stamped.log_time_ns)


def cloud() -> Stamped:
    angles = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    distances = ranges([disc(3.0, 0.5, 0.15)], angles=angles)
    seen = np.isfinite(distances)
    ring = distances[seen, None] * np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])[seen]
    return Stamped(CLOUD, SECOND, PointCloud2(SECOND, "laser", ring.astype(np.float32)))


def objects(path: Path) -> list[ScanObjects]:
    with open_recording(path) as recording:
        return [decode(ScanObjects, raw.data) for raw in recording.messages(recording.connections(SCAN_OBJECTS.topic))]


def test_the_output_has_objects_beside_the_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = write(tmp_path / "log.mcap", content()), tmp_path / "out.mcap"
    assert call("cluster", log, "-o", out, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, SCHEMA)
    assert (document["scans"], document["objects"]) == (3, 3)
    assert document["shapes"] == {"known": 3, "unknown": 0}
    assert topics(out) == {SCAN.topic: 3, ODOMETRY.topic: 9, TF_STATIC.topic: 1, SCAN_OBJECTS.topic: 3}
    assert [found.ids for found in objects(out)] == [("1",)] * 3
    assert call("cluster", log, "-o", tmp_path / "again.mcap") == 0
    assert (tmp_path / "again.mcap").read_bytes() == out.read_bytes()


def test_the_thesis_s_method_writes_the_filtered_scan(tmp_path: Path) -> None:
    log, out = write(tmp_path / "log.mcap", content()), tmp_path / "out.mcap"
    assert call("cluster", log, "-o", out, "--method", "thesis", "--results-only") == 0
    assert topics(out) == {SCAN_OBJECTS.topic: 3, SCAN_FILTERED.topic: 3}


def test_one_of_two_scans_or_both(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = write(tmp_path / "log.mcap", content(("/front", "/rear"))), tmp_path / "out.mcap"
    assert call("cluster", log, "-o", out) == 2
    assert "/front and /rear could be the scan; choose with --scan TOPIC" in capsys.readouterr().err
    assert call("cluster", log, "-o", out, "--scan", "/front") == 0
    (one, *_) = objects(out)
    assert call("cluster", log, "-o", out, "--scan", "/front", "--scan", "/rear") == 0
    (both, *_) = objects(out)
    assert (len(one), len(both)) == (1, 1)
    assert np.linalg.det(both.covariances[0][0]) < np.linalg.det(one.covariances[0][0])
    assert call("cluster", log, "-o", out, "--scan", "/front", "--scan", "/rear", "--scan", "/top") == 2
    assert "two are the most" in capsys.readouterr().err


def test_a_second_scan_that_is_missing_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    late = [
        stamped for i, stamped in enumerate(content(("/front", "/rear"))) if stamped.channel.topic != "/rear" or i > 9
    ]
    log, out = write(tmp_path / "log.mcap", late), tmp_path / "out.mcap"
    assert call("cluster", log, "-o", out, "--scan", "/front", "--scan", "/rear") == 0
    assert " bundles without /rear at their time" in capsys.readouterr().err


def test_a_slice_of_a_point_cloud(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = write(tmp_path / "log.mcap", [*content((), 2), cloud()]), tmp_path / "out.mcap"
    assert call("cluster", log, "-o", out, "--scan-from", "/points", "--slice", "0.1:0.3") == 0
    (found,) = objects(out)
    np.testing.assert_allclose(found.positions_xy[0][0], [3.0, 0.5], atol=0.03)
    for code, said, words in (
        (1, "there is no scan", ()),
        (2, "--slice 0.3:0.1: give two heights", ("--scan-from", "/points", "--slice", "0.3:0.1")),
        (2, "--slice low: give two heights", ("--scan-from", "/points", "--slice", "low")),
        (2, "--scan-from takes the place of --scan", ("--scan-from", "/points", "--scan", "/points")),
        (2, "there is no topic /cloud", ("--scan-from", "/cloud", "--slice", "0:1")),
    ):
        capsys.readouterr()
        assert call("cluster", log, "-o", tmp_path / "no.mcap", *words) == code, said
        assert said in capsys.readouterr().err
        assert not (tmp_path / "no.mcap").exists()


def test_where_the_lidar_sits_must_be_known(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bare = [stamped for stamped in content() if stamped.channel != TF_STATIC]
    log, out = write(tmp_path / "log.mcap", bare), tmp_path / "out.mcap"
    assert call("cluster", log, "-o", out) == 1
    assert "record /tf_static, or give --extrinsics FILE" in capsys.readouterr().err
    known = tmp_path / "mounting.toml"
    known.write_text('[[transforms]]\nparent = "base_footprint"\nchild = "laser"\nxyz = [0.0, 0.0, 0.2]\n')
    assert call("cluster", log, "-o", out, "--extrinsics", known) == 0
    assert topics(out)[SCAN_OBJECTS.topic] == 3
