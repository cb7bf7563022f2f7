"""Bundles: odometry at their stamps, what is held, what is beside them, and what found no partner."""

import numpy as np
import pytest
from mcap_landmarks.channels import CAMERA_INFO, DETECTIONS, SCENE_OBJECTS, TF_STATIC
from mcap_landmarks.geometry import se2
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CameraInfo
from mcap_landmarks.messages.poses import Odometry, PoseStamped
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.recording.odometry_track import odometry_from
from mcap_landmarks.recording.time_association import WINDOW_NS, Association, associate
from mcap_landmarks.stage import Bundle

from tests.recording.tracks import track

SECOND = 10**9


def scene(stamp_ns: int) -> SceneObjects:
    return SceneObjects(stamp_ns, "base", (), (), np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0))


def odometry(stamp_ns: int, *pose: float) -> Odometry:
    return Odometry.planar(stamp_ns, ("odom", "base"), pose, np.eye(3) * stamp_ns)


def bundles(*messages: tuple[int, SceneObjects | Odometry]) -> tuple[list[Bundle], Association]:
    counts = Association()
    stream = [(SCENE_OBJECTS, at, message) for at, message in messages if isinstance(message, SceneObjects)]
    steps = [(message.stamp_ns or at, message) for at, message in messages if isinstance(message, Odometry)]
    return list(associate(stream, SCENE_OBJECTS, counts, odometry=track(steps))), counts


def test_odometry_is_interpolated_on_the_arc() -> None:
    quarter = odometry(2 * SECOND, 1.0, 1.0, np.pi / 2)
    found, counts = bundles((0, odometry(0, 0, 0, 0)), (SECOND, scene(SECOND)), (2 * SECOND, quarter))
    half = np.sqrt(0.5)
    assert found[0].odometry is not None
    np.testing.assert_allclose(found[0].odometry.odom_from_base, [half, 1 - half, np.pi / 4], atol=1e-12)
    np.testing.assert_allclose(found[0].odometry.covariance, 0)
    assert (counts.bundles, counts.without_odometry) == (1, 0)


def test_stamps_count_and_not_log_times() -> None:
    late = (3 * SECOND, scene(SECOND // 2))
    found, _ = bundles((0, odometry(1, 0, 0, 0)), (SECOND, odometry(SECOND, 1, 0, 0)), late)
    assert found[0].odometry is not None
    np.testing.assert_allclose(found[0].odometry.odom_from_base[0], 0.5, atol=1e-8)
    assert found[0].log_time_ns == 3 * SECOND


def test_log_time_stands_in_for_a_stamp_of_zero() -> None:
    found, _ = bundles((5, odometry(0, 0, 0, 0)), (10, scene(0)), (15, odometry(0, 1, 0, 0)))
    assert found[0].stamp_ns == 10
    assert found[0].odometry is not None
    np.testing.assert_allclose(found[0].odometry.odom_from_base[0], 0.5)


def test_without_a_partner_a_bundle_goes_alone() -> None:
    before, beyond = (0, scene(1)), (10 * SECOND, scene(10 * SECOND))
    between = (3 * SECOND, scene(3 * SECOND))
    trail = [(SECOND, odometry(SECOND, 0, 0, 0)), (SECOND + WINDOW_NS * 3, odometry(SECOND + WINDOW_NS * 3, 1, 0, 0))]
    found, counts = bundles(before, trail[0], between, trail[1], beyond)
    assert [bundle.odometry for bundle in found] == [None, None, None]
    assert counts.without_odometry == counts.bundles == 3


def test_nothing_is_known_between_two_pieces() -> None:
    steps = [(at * SECOND, odometry(at * SECOND, at, 0, 0)) for at in (1, 2, 3, 4)]
    scenes = [(SCENE_OBJECTS, at, scene(at)) for at in (3 * SECOND // 2, 5 * SECOND // 2, 7 * SECOND // 2)]
    counts = Association()
    found = list(associate(scenes, SCENE_OBJECTS, counts, odometry=track(steps, [0, 0, 1, 1])))
    assert [bundle.odometry and (bundle.odometry.odom_from_base[0], bundle.odometry.piece) for bundle in found] == [
        (1.5, 0),
        None,
        (3.5, 1),
    ]
    assert counts.without_odometry == 1


@pytest.mark.parametrize("gap", [1, 10 * SECOND])
def test_bundles_keep_their_order(gap: int) -> None:
    found, _ = bundles(*[(i * gap, scene(i * gap + 1)) for i in range(50)])
    assert [bundle.stamp_ns for bundle in found] == [i * gap + 1 for i in range(50)]


def test_a_loop_back_to_the_start_still_counts_as_way() -> None:
    corners = [(0, 0, 0), (1, 0, np.pi / 2), (1, 1, np.pi), (0, 1, -np.pi / 2), (0, 0, 0)]
    trail = [(i, odometry(i * SECOND + 1, *pose)) for i, pose in enumerate(corners)]
    found, _ = bundles(*trail, (9, scene(4 * SECOND + 1)))
    at = found[0].odometry
    assert at is not None
    np.testing.assert_allclose(at.odom_from_base, 0, atol=1e-12)
    np.testing.assert_allclose([at.way_m, at.turned_rad], [4.0, 2 * np.pi], atol=1e-9)


def test_velocity_is_the_bases_own() -> None:
    at = 2 * SECOND
    turning = [odometry(SECOND + 1, 0, 0, np.pi / 2), odometry(at, *exp([0.3, 0.0, 0.4], [0, 0, np.pi / 2]))]
    found, _ = bundles(
        (0, odometry(1, 0, 0, np.pi / 2)), (1, turning[0]), (2, turning[1]), (3, scene(at - SECOND // 2))
    )
    assert found[0].odometry is not None
    np.testing.assert_allclose(found[0].odometry.velocity, [0.3, 0.0, 0.4], atol=1e-6)


def exp(twist: list[float], start: list[float]) -> np.ndarray:
    return se2.compose(start, se2.exp(twist))


def test_held_messages_are_the_latest_so_far_and_transforms_gather() -> None:
    counts = Association()
    messages = [
        (SCENE_OBJECTS, 0, scene(1)),
        (TF_STATIC, 1, mounts(laser=1.0)),
        (TF_STATIC, 2, mounts(camera=2.0)),
        (SCENE_OBJECTS, 3, scene(4)),
        (TF_STATIC, 5, mounts(laser=3.0)),
        (SCENE_OBJECTS, 6, scene(7)),
    ]
    found = list(associate(messages, SCENE_OBJECTS, counts, held=[TF_STATIC]))
    held = [bundle.get(TF_STATIC) for bundle in found]
    assert [heights(message) for message in held] == [
        {"laser": 1.0},  # a bundle waits for the first transforms
        {"laser": 1.0, "camera": 2.0},
        {"laser": 3.0, "camera": 2.0},
    ]
    assert held[1] is not held[2]


def test_a_bundle_that_waits_gets_no_calibration_of_later_ones() -> None:
    """A log of single frames has a camera of its own in each; the first is there for what came before it."""
    infos = [(CAMERA_INFO, at * SECOND, info(at * SECOND)) for at in (20, 40, 60)]
    scenes = [(SCENE_OBJECTS, at * SECOND, scene(at * SECOND)) for at in (10, 20, 40, 60)]
    messages = sorted([*infos, *scenes], key=lambda entry: entry[1])
    found = associate(messages, SCENE_OBJECTS, Association(), held=[CAMERA_INFO])
    held = [bundle.get(CAMERA_INFO) for bundle in found]
    assert [message and message.stamp_ns // SECOND for message in held] == [20, 20, 40, 60]


def info(stamp_ns: int) -> CameraInfo:
    return CameraInfo(stamp_ns, "camera", 480, 640, "", np.zeros(5), np.eye(3), np.eye(3), np.eye(3, 4))


def mounts(**heights_m: float) -> TFMessage:
    level = np.array([0.0, 0.0, 0.0, 1.0])
    steps = [Transform(0, "base", name, np.array([0.0, 0.0, z]), level) for name, z in heights_m.items()]
    return TFMessage(tuple(steps))


def heights(message: TFMessage | None) -> dict[str, float]:
    assert message is not None
    return {step.child_frame_id: float(step.translation_m[2]) for step in message.transforms}


def test_nobody_gets_held_messages_that_never_come() -> None:
    messages = [(SCENE_OBJECTS, i * SECOND, scene(i * SECOND + 1)) for i in range(6)]
    found = list(associate(messages, SCENE_OBJECTS, Association(), held=[TF_STATIC]))
    assert len(found) == 6
    assert all(bundle.get(TF_STATIC) is None for bundle in found)


def beside(scenes_ms: list[int], images_ms: list[int], late_ms: int = 0) -> tuple[list[int | None], Association]:
    """Milliseconds of the image beside each scene; images are logged late."""
    counts = Association()
    messages = [(SCENE_OBJECTS, at, scene(at * 10**6)) for at in scenes_ms]
    messages += [(DETECTIONS, at + late_ms, image(at * 10**6)) for at in images_ms]
    stream = [(channel, at * 10**6, message) for channel, at, message in sorted(messages, key=lambda entry: entry[1])]
    found = associate(stream, SCENE_OBJECTS, counts, beside=[DETECTIONS])
    partners = [bundle.get(DETECTIONS) for bundle in found]
    return [None if partner is None else partner.stamp_ns // 10**6 for partner in partners], counts


def image(stamp_ns: int, frame: str = "camera") -> Detections:
    return Detections(stamp_ns, frame, (), (), np.zeros((0, 4)))


@pytest.mark.parametrize("late_ms", [0, 30, 900])
def test_beside_a_bundle_is_what_is_nearest(late_ms: int) -> None:
    images = [*range(113, 2000, 100)]
    found, counts = beside([*range(100, 2000, 200)], images, late_ms)
    assert found == [113 + 200 * i for i in range(10)]
    assert counts.unpaired == {DETECTIONS.topic: 9}
    assert not counts.alone


def test_an_image_belongs_to_the_bundle_nearest_to_it_only() -> None:
    found, counts = beside([100, 200, 300, 400, 500, 1000], [180, 420])
    assert found == [None, 180, None, 420, None, None]
    assert counts.alone == {DETECTIONS.topic: 4}
    assert counts.unpaired == {DETECTIONS.topic: 0}


def test_an_image_too_far_away_belongs_to_none() -> None:
    found, counts = beside([1000, 2000], [600, 1500, 2249])
    assert found == [None, 2249]
    assert counts.unpaired == {DETECTIONS.topic: 2}


def of_cameras(scenes_ms: list[int], images_ms: dict[str, list[int]], late_ms: int = 0) -> list[dict[str, int]]:
    """Milliseconds of the images beside each scene, by camera; those of the camera `late` are logged late."""
    messages = [(at, SCENE_OBJECTS, scene(at * 10**6)) for at in scenes_ms]
    for frame, times in images_ms.items():
        messages += [(at + late_ms * (frame == "late"), DETECTIONS, image(at * 10**6, frame)) for at in times]
    stream = [(channel, at * 10**6, message) for at, channel, message in sorted(messages, key=lambda entry: entry[0])]
    bundles = associate(stream, SCENE_OBJECTS, Association(), beside=[DETECTIONS], by_frame={DETECTIONS: 1})
    return [{one.frame_id: one.stamp_ns // 10**6 for one in bundle.each(DETECTIONS)} for bundle in bundles]


@pytest.mark.parametrize("late_ms", [0, 150])
def test_of_every_camera_the_nearest_image_is_beside_a_bundle(late_ms: int) -> None:
    images = {"front": [*range(113, 2000, 100)], "late": [*range(80, 2000, 200)]}
    found = of_cameras([*range(100, 2000, 200)], images, late_ms)
    assert found == [{"front": 113 + 200 * i, "late": 80 + 200 * i} for i in range(10)]


def test_a_camera_without_an_image_near_by_keeps_no_other_one_from_its_bundle() -> None:
    found = of_cameras([1000, 1600, 2200], {"front": [1010, 1610, 2210], "rear": [1600]})
    assert found == [{"front": 1010}, {"front": 1610, "rear": 1600}, {"front": 2210}]


def test_what_is_held_of_every_camera_is_awaited() -> None:
    infos = [
        CameraInfo(1, frame, 48, 64, "", np.zeros(0), np.eye(3), np.eye(3), np.eye(3, 4)) for frame in ("front", "rear")
    ]
    stream = [(CAMERA_INFO, 1, infos[0]), (SCENE_OBJECTS, 2, scene(2)), (CAMERA_INFO, SECOND, infos[1])]
    stream += [(SCENE_OBJECTS, 2 * SECOND, scene(2 * SECOND))]
    both, alone = (
        [
            [info.frame_id for info in bundle.each(CAMERA_INFO)]
            for bundle in associate(
                stream,
                SCENE_OBJECTS,
                Association(),
                held=[CAMERA_INFO],
                by_frame={CAMERA_INFO: count},
            )
        ]
        for count in (2, 1)
    )
    assert both == [["front", "rear"]] * 2
    assert alone == [["front"], ["front", "rear"]]


def test_odometry_comes_as_poses_and_as_transforms() -> None:
    pose = PoseStamped.planar(5, "world", (1.0, 2.0, 0.5))
    from_pose = odometry_from(pose)
    steps = [
        Transform.planar(6, ("map", "odom"), (9.0, 9.0, 0.0)),
        Transform.planar(7, ("odom", "trailer"), (8.0, 8.0, 0.0)),
        Transform.planar(8, ("/odom", "/base_link"), (1.0, 2.0, 0.5)),
    ]
    from_transforms = odometry_from(TFMessage(tuple(steps)))
    assert from_pose is not None
    assert from_transforms is not None
    assert (from_pose.stamp_ns, from_pose.frame_id) == (5, "world")
    assert (from_transforms.stamp_ns, from_transforms.frame_id) == (8, "/odom")
    for found in (from_pose, from_transforms):
        np.testing.assert_allclose(found.pose, [1.0, 2.0, 0.5])
    assert odometry_from(TFMessage((steps[0],))) is None
    assert odometry_from(scene(1)) is None
