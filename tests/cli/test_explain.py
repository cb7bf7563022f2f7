"""The verb explain, on logs of scene objects and on one with detections, clusters, image and scan."""

import json
import re
from dataclasses import replace
from pathlib import Path

import cv2
import jsonschema
import numpy as np
import pytest
from mcap_landmarks.channels import (
    CAMERA_IMAGE,
    CAMERA_INFO,
    CLUSTERED_CLOUD,
    DETECTIONS,
    MATCH,
    POSE,
    SCAN,
    SCAN_OBJECTS,
    SCENE_OBJECTS,
    SCENE_VELOCITIES,
    TF_STATIC,
)
from mcap_landmarks.fusion.cloud_fuser import CloudFuser
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.object_motions import ObjectMotions
from mcap_landmarks.localization.config import LocalizeConfig
from mcap_landmarks.manifest import RUN, Manifest, StageRecord
from mcap_landmarks.messages.codec import Message, decode
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo, CompressedImage, Image
from mcap_landmarks.messages.match import Status
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.messages.velocities import SceneVelocities
from mcap_landmarks.moments import moment
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.report.explain_reading import read_situation
from mcap_landmarks.stage import Bundle, Channel, Stamped

from tests.cli.calls import call, schema_of
from tests.diff.recordings import START_NS, localized_log, localized_messages, write
from tests.fusion.test_cloud_fuser import BASE_FROM_CAMERA, CAMERA, CAR, clustered, detections, fused
from tests.fusion.test_several_views import clustered as all_around
from tests.fusion.test_several_views import corners
from tests.fusion.turned_cameras import TurnedCamera
from tests.lidar.clouds import Solid
from tests.localization.logs import bundles, localized, unique_classes, write_log
from tests.stages.test_localize_one_kind import AROUND, located, poses, scene

PNG = b"\x89PNG"
GOLDEN = Path(__file__).parents[1] / "golden" / "localize.mcap"
BEFORE_CONDITIONS = Path(__file__).parents[1] / "data" / "localize_without_conditions.mcap"


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


@pytest.mark.slow
def test_words_document_and_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = write(tmp_path / "r.mcap", [*sensed(START_NS), *localized_messages()])
    assert call("explain", log, "--at", START_NS, "-o", tmp_path / "e.png") == 0
    said = capsys.readouterr().out
    assert said.startswith(f"bundle at {moment(START_NS)}: localized")
    assert "detected: person 0.90, bench 0.70, in the image at the scan's time" in said
    assert "clustered: 1 clusters, 0 of them" in said
    assert "fused: 2 objects; detected, but no object: 1 bench" in said
    assert (tmp_path / "e.png").read_bytes().startswith(PNG)
    assert call("explain", log, "--at", START_NS, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, schema_of("explain"))
    assert (document["clusters"], len(document["detections"]), document["status"]) == (1, 2, "localized")


@pytest.mark.slow
def test_a_log_of_scene_objects_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = localized_log(tmp_path / "r.mcap")
    assert call("explain", log, "--at", START_NS + 310_000_000, "-o", tmp_path / "e.svg") == 0
    said = capsys.readouterr().out
    assert f"bundle at {moment(START_NS + 300_000_000)}: too_few_objects" in said
    assert "FAILS  objects: 1 objects in the bundle, at least 2 needed" in said
    assert "detected: nothing that the log tells" in said
    first = (tmp_path / "e.svg").read_bytes()
    assert call("explain", log, "--at", START_NS + 310_000_000, "-o", tmp_path / "e.svg") == 0
    assert (tmp_path / "e.svg").read_bytes() == first


def test_wrong_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = localized_log(tmp_path / "r.mcap")
    assert call("explain", log, "--at", 5) == 1
    assert "no bundle with scene objects within 3 s of 1970-01-01T00:00:00.000000005Z" in capsys.readouterr().err
    assert call("explain", log, "--at", START_NS, "-o", tmp_path / "e.gif") == 2
    assert call("explain", log, "--at", "yesterday") == 2


def read(log: Path, channel):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN201 - of the channel's type
    """The messages of one channel by their time."""
    with open_recording(log) as recording:
        raws = list(recording.messages(recording.connections(channel.topic)))
        return {raw.log_time_ns: decode(channel.message, raw.data, raw.connection.schema.decode()) for raw in raws}


def explained(log: Path, time_ns: int, capsys: pytest.CaptureFixture[str]):  # type: ignore[no-untyped-def] # noqa: ANN201
    capsys.readouterr()
    assert call("explain", log, "--at", time_ns, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, schema_of("explain"))
    return document


def agrees(log: Path, capsys: pytest.CaptureFixture[str], every: int = 1) -> set[str]:
    """Hold what localize published against its conditions, and explanations of it; the statuses that were met."""
    matches, poses, statuses = read(log, MATCH), read(log, POSE), set()
    for match in matches.values():
        assert match.conditions
        assert (match.status is Status.LOCALIZED) is all(one.held for one in match.conditions)
    for time_ns, match in list(matches.items())[::every]:
        document = explained(log, match.stamp_ns, capsys)
        statuses.add(document["status"])
        assert document["status"] == match.status.name.lower()
        assert (document["status"] == "localized") is all(one["holds"] for one in document["conditions"])
        asked = [(one["name"], one["value"], one["limit"], one["holds"]) for one in document["conditions"]]
        assert asked == [tuple(one) for one in match.conditions]
        told = {one["id"]: (one["landmark"], one["residual_m"]) for one in document["objects"]}
        for name, landmark, residual_m in zip(match.object_ids, match.landmark_ids, match.residual_m, strict=True):
            assert told[name] == (landmark, residual_m)
        if time_ns in poses:
            x, y, heading = poses[time_ns].pose.tolist()
            shown = document["places"][0]["pose"]
            assert (shown["x_m"], shown["y_m"], shown["heading_deg"]) == (x, y, pytest.approx(np.degrees(heading)))
            (sigma_m,) = [one.value for one in match.conditions if one.name == "position_sigma_m"]
            assert document["places"][0]["sigma_m"] == pytest.approx(sigma_m)
    return statuses


@pytest.mark.slow
def test_the_explanation_is_what_localize_decided(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert agrees(GOLDEN, capsys, every=8) == {"localized"}
    world = unique_classes()
    seen = bundles(*world)
    results = localized(tmp_path, *world, seen, LocalizeConfig(max_sigma_m=0.03, max_sigma_deg=0.3))
    log = write_log(tmp_path / "unique.mcap", seen, results)
    assert agrees(log, capsys) == {"localized", "too_few_objects", "inconsistent", "weak_geometry"}


@pytest.mark.slow
def test_a_log_from_before_conditions_were_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of one with the definition that LandmarkMatch had then, all is told but for what it does not hold."""
    matches = read(BEFORE_CONDITIONS, MATCH)
    assert len(matches) == 9
    for match in matches.values():
        assert match.conditions == ()
        document = explained(BEFORE_CONDITIONS, match.stamp_ns, capsys)
        assert (document["status"], document["conditions"]) == ("localized", None)
        assert document["places"][0]["landmarks"] == list(match.landmark_ids)
    assert call("explain", BEFORE_CONDITIONS, "--at", match.stamp_ns, "-o", tmp_path / "e.png") == 0
    said = capsys.readouterr().out
    assert "The log does not tell the conditions of its matches; run localize on it again." in said
    assert "holds" not in said


def test_a_log_without_matches(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bare = [entry for entry in localized_messages() if entry[0] not in {MATCH, POSE}]
    assert call("explain", write(tmp_path / "r.mcap", bare), "--at", START_NS) == 0
    assert "There is no match to explain; run localize on the log." in capsys.readouterr().out


@pytest.mark.slow
def test_a_position_without_heading(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ranges alone leave the heading open: none is told or drawn."""
    results = located(tmp_path, AROUND, 3, ranges=True)
    rng = np.random.default_rng(5)
    scenes = [scene(i + 1, pose, AROUND, rng, ranges=True) for i, pose in enumerate(poses(3))]
    seen = [Bundle(one.stamp_ns, one.stamp_ns, {SCENE_OBJECTS: one}, None) for one in scenes]
    log = write_log(tmp_path / "ranges.mcap", seen, results)
    (place,) = explained(log, 2, capsys)["places"]
    assert place["pose"]["heading_deg"] is None
    np.testing.assert_allclose([place["pose"]["x_m"], place["pose"]["y_m"]], poses(3)[1, :2], atol=0.15)
    assert call("explain", log, "--at", 2, "-o", tmp_path / "e.svg") == 0
    assert "heading unknown" in (tmp_path / "e.svg").read_text()
    assert "holds  mirror_odds: 0 odds of the mirror image" in capsys.readouterr().out


def of_a_cloud():  # type: ignore[no-untyped-def] # noqa: ANN201 - entries of a log
    """A car that is an object and one that is none, an image, a cloud, and no map yet."""
    far = Solid(70.0, 2.0, 4.2, 1.7, 1.5)
    told = [("car", 0.8, CAR), ("car", 0.6, far)]
    objects, _ = fused(told, [CAR, Solid(40.0, 0.0, 0.5, 60.0, 4.0)])
    stamp_ns, (width, height) = objects.stamp_ns, CAMERA.size_px
    mount = Transform(stamp_ns, "base_link", "camera", BASE_FROM_CAMERA[:3, 3], np.array([-0.5, 0.5, -0.5, 0.5]))
    k, projection = CAMERA.intrinsics, np.column_stack([CAMERA.intrinsics, np.zeros(3)])
    info = CameraInfo(stamp_ns, "camera", height, width, "", np.zeros(5), k, np.eye(3), projection)
    picture = cv2.imencode(".png", np.zeros((height, width, 3), np.uint8))[1].tobytes()
    return [
        (TF_STATIC, stamp_ns, TFMessage((mount,))),
        (CAMERA_INFO, stamp_ns, info),
        (CAMERA_IMAGE, stamp_ns, CompressedImage(stamp_ns, "camera", "png", picture)),
        (DETECTIONS, stamp_ns, replace(detections(told), stamp_ns=stamp_ns)),
        (CLUSTERED_CLOUD, stamp_ns, clustered([CAR, Solid(40.0, 0.0, 0.5, 60.0, 4.0)])),
        (SCENE_OBJECTS, stamp_ns, objects),
        (SCENE_VELOCITIES, stamp_ns, moving(objects)),
    ]


def moving(objects: SceneObjects) -> SceneVelocities:
    velocities, spread = np.array([[3.0, 0.0]]), np.eye(2)[None]
    return SceneVelocities(objects.stamp_ns, objects.frame_id, objects.ids, velocities, spread, np.array([0.9]))


@pytest.mark.slow
def test_a_cloud_that_was_not_localized_yet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = write(tmp_path / "r.mcap", of_a_cloud())
    assert call("explain", log, "--at", 10**9, "-o", tmp_path / "e.svg") == 0
    said = capsys.readouterr().out
    assert said.startswith(f"bundle at {moment(10**9)}: not matched yet")
    assert re.search(r"clustered: \d+ points above the ground, in 2 clusters\n", said)
    assert "fused: 1 objects; detected, but no object: 1, as follows\n  car 0.60 about pixel " in said
    drawn = (tmp_path / "e.svg").read_text()
    for text in ("detections that are no object (red, dashed)", "1  car 0.", "edge of the image", "moves, in a second"):
        assert text in drawn
    document = explained(log, 10**9, capsys)
    (one,), (missed,) = document["objects"], document["lost"]
    assert one["size_m"] == pytest.approx([4.3, 1.75, 1.5], abs=0.4)
    assert one["yaw_deg"] == pytest.approx(np.degrees(0.1), abs=6)
    assert (missed["class"], missed["confidence"]) == ("car", 0.6)
    assert "points fit no car well enough" in missed["reason"]


def test_a_cloud_whose_camera_nobody_knows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What became of its boxes is told by the number of objects of their class, and drawn without boxes in space."""
    bare = [entry for entry in of_a_cloud() if entry[0] not in {CAMERA_INFO, CAMERA_IMAGE}]
    log = write(tmp_path / "r.mcap", bare)
    assert call("explain", log, "--at", 10**9, "-o", tmp_path / "e.png") == 0
    assert "fused: 1 objects; detected, but no object: 1 car" in capsys.readouterr().out
    assert (tmp_path / "e.png").read_bytes().startswith(PNG)
    assert explained(log, 10**9, capsys)["lost"] is None


FRONT, SIDE = TurnedCamera("front", 0.0, 1.65, 700.0, (1200, 400)), TurnedCamera("side", 90.0, 1.65, 700.0, (600, 400))


@pytest.fixture
def two_cameras_beside_a_cloud(tmp_path: Path) -> Path:
    """A car ahead and a person on the left, which are objects, and beyond the person a car that no beam meets."""
    person, far = Solid(1.0, 8.0, 0.4, 0.4, 1.7), Solid(3.0, 70.0, 4.2, 1.7, 1.5)
    told = [("car", corners(CAR)), ("person", corners(person)), ("car", corners(far))]
    names, outlines = zip(*told, strict=True)
    beside = all_around([CAR, person])
    fuser = CloudFuser(FuseConfig(), ObjectMotions())
    objects, _ = fuser.add(beside, [one.sees(names, outlines) for one in (FRONT, SIDE)], None)
    at, entries = 10**9, list[tuple[Channel[Message], int, Message]]()
    for one in (FRONT, SIDE):
        width, height = one.size_px
        picture = cv2.imencode(".png", np.zeros((height, width, 3), np.uint8))[1].tobytes()
        image = CompressedImage(at, one.frame, "png", picture)
        entries += [
            (Channel(f"/{one.frame}/image_raw/compressed", CompressedImage), at, image),
            (Channel(f"/{one.frame}/camera_info", CameraInfo), at, one.info),
            (DETECTIONS, at, one.detects(names, outlines, at)),
        ]
    mounts = TFMessage(tuple(one.transform for one in (FRONT, SIDE)))
    detected = StageRecord("detect", "", {}, {}, {}, {"images": ["all"]})
    with create_recording(tmp_path / "r.mcap", {RUN: Manifest("run", stages=(detected,)).entries()}) as writer:
        for entry in [(TF_STATIC, at, mounts), *entries, (CLUSTERED_CLOUD, at, beside), (SCENE_OBJECTS, at, objects)]:
            writer.add(Stamped(entry[0], entry[1], entry[2]))
    return tmp_path / "r.mcap"


@pytest.mark.slow
def test_several_cameras_beside_a_cloud(
    two_cameras_beside_a_cloud: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A panel for each, with its own boxes and what they came to; the view from above once, with all that they show."""
    log = two_cameras_beside_a_cloud
    assert call("explain", log, "--at", 10**9, "-o", tmp_path / "e.svg") == 0
    said = capsys.readouterr().out
    assert "detected: car 0.80, in the image of front at the scan's time; person 0.80, car 0.80, in the" in said
    assert re.search(r"  car 0.80 about pixel \d+, \d+ of side is no object: the LiDAR meets nothing of it", said)
    drawn = (tmp_path / "e.svg").read_text()
    for text in ("front, at the scan's time", "side, at the scan's time", "from above", "edge of an image"):
        assert drawn.count(f">{text}") + drawn.count(f"<!-- {text}") == 1
    document = explained(log, 10**9, capsys)
    assert [one["camera"] for one in document["detections"]] == ["front", "side", "side"]
    (missed,) = document["lost"]
    assert (missed["class"], missed["camera"]) == ("car", "side")
    assert sorted(one["class"] for one in document["objects"]) == ["car", "person"]


def test_each_camera_has_its_own_boxes_in_space(two_cameras_beside_a_cloud: Path) -> None:
    """Through the calibration of its own frame; what one camera lost is none of another's."""
    situation, view = read_situation(two_cameras_beside_a_cloud, 10**9)
    assert [None if one.detections is None else one.detections.frame_id for one in view.pictures] == ["front", "side"]
    assert [seen.camera.size_px for seen in view.views] == [FRONT.size_px, SIDE.size_px]
    for seen, one in zip(view.views, (FRONT, SIDE), strict=True):
        np.testing.assert_allclose(seen.base_from_camera, one.base_from_camera, atol=1e-9)
    assert [len(one.lost or ()) for one in view.pictures] == [0, 1]
    assert [one.pixels.shape[1] for one in view.pictures if one.pixels is not None] == [1200, 600]
    assert len(situation.detections) == 2
