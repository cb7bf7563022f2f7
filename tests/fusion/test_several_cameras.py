"""Several cameras beside a planar scan: each box in its own camera's view, each object once."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_INFO, DETECTIONS, SCAN_OBJECTS, TF_STATIC
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.fuser import Fuser
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage
from mcap_landmarks.stage import Bundle, OdometryAt

from tests.fusion.cylinders import SECOND, THREE, Thing, check, fused, moved, scanned
from tests.fusion.turned_cameras import TurnedCamera

LEFT, RIGHT = TurnedCamera("left", 20.0), TurnedCamera("right", -20.0)
SIDE, REAR = TurnedCamera("side", 90.0), TurnedCamera("rear", 180.0)
BOTH = Thing("person", 6.0, -0.2)
AROUND = (Thing("fire hydrant", 5.0, 3.0), BOTH, Thing("suitcase", 4.0, -2.5))
"""What only the left camera sees, what both see, and what only the right one sees."""
STILL = (0.0, 0.0, 0.0)


def outline(thing: Thing) -> Array:
    """The rims (K, 3) of a cylinder."""
    turn = np.linspace(0, 2 * np.pi, 60)
    rim = thing.radius_m * np.column_stack([np.cos(turn), np.sin(turn), 0 * turn]) + [thing.x, thing.y, 0.0]
    return np.concatenate([rim, rim + np.array([0, 0, thing.height_m])])


def seen(camera: TurnedCamera, things: Sequence[Thing], stamp_ns: int = SECOND) -> Detections:
    return camera.detects([thing.name for thing in things], [outline(thing) for thing in things], stamp_ns)


def bundle(
    things: Sequence[Thing],
    detections: Sequence[Detections],
    cameras: Sequence[TurnedCamera] = (LEFT, RIGHT),
    velocity: Sequence[float] = STILL,
    infos: Sequence[CameraInfo] | None = None,
) -> Bundle:
    """A scan of some things, and detections of some cameras beside it."""
    several: dict[Any, Any] = {
        DETECTIONS: tuple(detections),
        CAMERA_INFO: tuple(infos if infos is not None else [camera.info for camera in cameras]),
    }
    messages: dict[Any, Any] = {channel: found[0] for channel, found in several.items() if found}
    messages |= {
        SCAN_OBJECTS: scanned(things, SECOND),
        TF_STATIC: TFMessage(tuple(camera.transform for camera in cameras)),
    }
    odometry = OdometryAt("odom", np.zeros(3), np.zeros((3, 3)), 0.0, 0.0, np.asarray(velocity, dtype=np.float64))
    return Bundle(SECOND, SECOND, messages, odometry, several)


def test_what_two_cameras_see_is_one_object_and_what_one_sees_is_another() -> None:
    images = [seen(LEFT, AROUND), seen(RIGHT, AROUND)]
    assert [[options[0][0] for options in one.hypotheses] for one in images] == [
        ["fire hydrant", "person"],
        ["person", "suitcase"],
    ]
    scenes, left_out = fused([bundle(AROUND, images)])
    check(scenes[0], AROUND)
    assert not left_out


@pytest.mark.parametrize("camera", [SIDE, REAR])
def test_a_camera_that_looks_aside_or_back_sees_what_is_there(camera: TurnedCamera) -> None:
    """Straight behind directions go from half a turn to minus half a turn, in the middle of an object."""
    turned = np.deg2rad(camera.yaw_deg)
    c, s = np.cos(turned), np.sin(turned)
    things = [Thing(thing.name, c * thing.x - s * thing.y, s * thing.x + c * thing.y) for thing in THREE]
    ahead = Thing("person", 5.0, 0.0)
    images = [seen(LEFT, [ahead]), seen(camera, things)]
    scenes, left_out = fused([bundle([ahead, *things], images, (LEFT, camera))])
    check(scenes[0], [ahead, *things])
    assert not left_out


def test_each_image_has_its_own_time() -> None:
    velocity, late_ns = (0.0, 0.0, 0.8), {"left": 120_000_000, "right": -90_000_000}
    images = [
        seen(camera, moved(AROUND, velocity, late_ns[camera.frame] / 1e9), SECOND + late_ns[camera.frame])
        for camera in (LEFT, RIGHT)
    ]
    scenes, left_out = fused([bundle(AROUND, images, velocity=velocity)])
    check(scenes[0], AROUND)
    assert not left_out
    exchanged = [
        Detections(other.stamp_ns, one.frame_id, one.ids, one.hypotheses, one.boxes_xyxy)
        for one, other in zip(images, reversed(images), strict=True)
    ]
    assert fused([bundle(AROUND, exchanged, velocity=velocity)])[1]


def test_one_of_several_cameras_may_have_no_image() -> None:
    scenes, left_out = fused([bundle(AROUND, [seen(LEFT, AROUND)])], FuseConfig(min_objects=1))
    check(scenes[0], AROUND[:2])
    assert not left_out


def test_only_a_camera_that_shows_a_place_says_that_nothing_is_there() -> None:
    """The right camera sees nothing for long, which says nothing of what only the left one shows."""
    full = bundle(AROUND, [seen(LEFT, AROUND), seen(RIGHT, AROUND)])
    blind = bundle(AROUND, [seen(LEFT, AROUND), seen(RIGHT, [])])
    scenes, _ = fused([full] * 3 + [blind] * 40, FuseConfig(min_objects=1))
    assert scenes[2].classes == ("fire hydrant", "person", "suitcase")
    assert scenes[-1].classes == ("fire hydrant", "person")


def probability(images: Sequence[TurnedCamera]) -> float:
    """How sure a new track is of its class after a scan that some cameras see unsure boxes beside."""
    fuser = Fuser(FuseConfig())
    found = [camera.sees([BOTH.name], [outline(BOTH)], 0.3) for camera in images]
    scene, _ = fuser.add(scanned([BOTH], SECOND), found, np.zeros(3))
    (track,) = scanned([BOTH], SECOND).ids
    assert isinstance(scene, SceneObjects)
    return fuser._tracks[track].belief.share(BOTH.name)


def test_a_second_view_from_the_same_place_says_a_little_more() -> None:
    """Images from one place err alike, whichever camera takes them."""
    one, both = probability([LEFT]), probability([LEFT, RIGHT])
    odds = both / (1 - both) / (one / (1 - one))
    assert 1.0 < odds < 2.5
    assert probability([RIGHT, LEFT]) == pytest.approx(both, rel=0.05)


def test_what_is_missing_for_a_camera_is_named() -> None:
    image = [seen(LEFT, AROUND), seen(SIDE, AROUND)]
    with pytest.raises(RecordingError, match="no transforms lead from side to base_footprint"):
        fused([bundle(AROUND, image, (LEFT, RIGHT), infos=[LEFT.info, SIDE.info])])
    with pytest.raises(RecordingError, match=r"is of the frame 'side'.*but of left and right; record.*--image TOPIC"):
        fused([bundle(AROUND, image, (LEFT, RIGHT))])
    with pytest.raises(RecordingError, match=r"is of the frame 'side'.*but of left; record"):
        fused([bundle(AROUND, image, infos=[LEFT.info])])  # never another camera's
    with pytest.raises(UsageError, match="the thesis's method has one camera; choose it with --image TOPIC"):
        fused([bundle(AROUND, image)], FuseConfig(method="thesis"))
