"""A camera and a cloud: every box becomes one object where its thing stands, or nothing where neither sensor tells."""

from collections.abc import Sequence

import numpy as np
import pytest
from mcap_landmarks.fusion.camera_view import CameraView, SeenImage
from mcap_landmarks.fusion.cloud_fuser import CloudFuser
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.object_motions import ObjectMotions
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.camera import CameraModel
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.whole_clouds import whole_cloud
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.stage import OdometryAt

from tests.lidar.clouds import AHEAD, ALL_AROUND, Solid, cloud

SIZE_PX = (1200, 400)
CAMERA_M = 1.65
CAMERA = CameraModel.of("", SIZE_PX, np.array([[700.0, 0.0, 600.0], [0.0, 700.0, 180.0], [0.0, 0.0, 1.0]]), np.zeros(0))
BASE_FROM_CAMERA = frames.rigid([0.3, 0.0, CAMERA_M], [-0.5, 0.5, -0.5, 0.5])
CAR = Solid(14.0, -2.0, 4.3, 1.75, 1.5, 0.1)
PERSON = Solid(9.0, 3.0, 0.4, 0.4, 1.7)
Told = tuple[str, float, Solid]


def box_of(solid: Solid) -> Array:
    """The box (4,) around a solid in the image."""
    sides = np.array([[x, y, z] for x in (1, -1) for y in (1, -1) for z in (0, 2)])
    local = sides * [solid.length_m / 2, solid.width_m / 2, solid.height_m / 2]
    c, s = np.cos(solid.yaw_rad), np.sin(solid.yaw_rad)
    corners = local @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + [solid.x, solid.y, solid.above_m]
    pixels = CAMERA.project(frames.apply(frames.inverse(BASE_FROM_CAMERA), corners))
    clipped = np.clip(pixels, 0, SIZE_PX)
    return np.concatenate([clipped.min(axis=0), clipped.max(axis=0)])


def detections(told: Sequence[Told]) -> Detections:
    boxes = np.array([box_of(solid) for *_, solid in told]).reshape(-1, 4)
    return Detections(1, "camera", ("",) * len(told), tuple(((name, score),) for name, score, _ in told), boxes)


def clustered(
    solids: Sequence[Solid], stamp_ns: int = 10**9, slope: tuple[float, float] = (0.0, 0.0)
) -> ClusteredCloud:
    points, _ = cloud(solids, AHEAD, slope)
    found = whole_cloud(points, np.zeros(2), ClusterConfig())
    return ClusteredCloud(stamp_ns, "base_link", found.points_m, found.heights_m, found.clusters)


def fused(
    told: Sequence[Told], solids: Sequence[Solid], fuser: CloudFuser | None = None, **odometry: Array
) -> tuple[SceneObjects, int]:
    view = CameraView.at(CAMERA, BASE_FROM_CAMERA, np.zeros(3), 0.0)
    return (fuser or CloudFuser(FuseConfig(), ObjectMotions())).add(
        clustered(solids), [SeenImage(detections(told), view)], odometry.get("odometry")
    )


def test_a_car_and_a_person_stand_where_they_are() -> None:
    scene, unexplained = fused([("car", 0.8, CAR), ("person", 0.7, PERSON)], [CAR, PERSON, Solid(30, 0, 0.5, 40, 4)])
    assert unexplained == 0
    assert scene.classes == ("car", "person")
    np.testing.assert_allclose(scene.positions_xy, [[CAR.x, CAR.y], [PERSON.x, PERSON.y]], atol=0.3)
    for place, spread, solid in zip(scene.positions_xy, scene.covariances, (CAR, PERSON), strict=True):
        off = place - [solid.x, solid.y]
        assert off @ np.linalg.solve(spread, off) < 9.2  # 99 % of two degrees
    assert scene.boxes is not None
    np.testing.assert_allclose(scene.boxes.sizes_m[0], [4.3, 1.75, 1.5], atol=0.4)
    np.testing.assert_allclose(scene.boxes.yaws_rad[0], 0.1, atol=0.1)
    np.testing.assert_allclose(scene.boxes.centres_m[:, 2], [0.75, 0.85], atol=0.15)


def test_a_truck_in_pieces_is_one_object() -> None:
    cab, load = Solid(12.0, 2.5, 2.0, 2.4, 2.6), Solid(17.0, 2.5, 5.0, 2.5, 3.2)
    scene, unexplained = fused([("truck", 0.6, Solid(15.25, 2.5, 8.5, 2.5, 3.2))], [cab, load])
    assert (scene.classes, unexplained) == (("truck",), 0)
    assert np.hypot(*(scene.positions_xy[0] - [15.25, 2.5])) < 1.0


def test_the_nearer_of_two_cars_keeps_its_points() -> None:
    ahead = Solid(22.0, -4.6, 4.3, 1.75, 1.5, 0.1)
    scene, _ = fused([("car", 0.5, ahead), ("car", 0.8, CAR)], [CAR, ahead])
    near, far = sorted(scene.positions_xy.tolist())
    np.testing.assert_allclose(near, [CAR.x, CAR.y], atol=0.4)
    np.testing.assert_allclose(far, [ahead.x, ahead.y], atol=1.0)


@pytest.mark.parametrize("shape", [Solid(10.0, 0.0, 0.3, 7.0, 2.5), Solid(10.0, 0.0, 1.0, 0.8, 0.6)])
def test_a_sure_box_on_many_points_never_ends_as_nothing(shape: Solid) -> None:
    """The fit of a shape weighs, it never vetoes: a wall and a crate are no cars, but the network says so."""
    scene, unexplained = fused([("car", 0.9, shape)], [shape])
    assert (scene.classes, unexplained) == (("car",), 0)


def test_what_the_lidar_does_not_resolve_is_as_far_as_the_camera_says() -> None:
    person = Solid(15.0, 2.0, 0.4, 0.4, 1.7)
    scene, _ = fused([("person", 0.8, person)], [Solid(20.0, -8.0, 1.0, 1.0, 2.0)])
    (place,), (spread,) = scene.positions_xy, scene.covariances
    ahead = np.array([person.x, person.y]) / np.hypot(person.x, person.y)
    along, across = np.sqrt(ahead @ spread @ ahead), np.sqrt(spread[0, 0] + spread[1, 1] - ahead @ spread @ ahead)
    assert np.hypot(*(place - [person.x, person.y])) < 2 * along
    assert 0.5 < along < 3.0
    assert across < along / 2


def test_what_neither_tells_is_left_out_and_counted() -> None:
    far = Solid(70.0, 2.0, 4.2, 1.7, 1.5)
    scene, unexplained = fused([("car", 0.9, far)], [PERSON])
    assert (len(scene), unexplained) == (0, 1)


def test_an_unsure_box_on_nothing_of_its_size_is_left_out() -> None:
    scene, unexplained = fused([("car", 0.3, Solid(8.0, 0.0, 4.0, 1.7, 1.5))], [Solid(40.0, 0.0, 0.5, 60.0, 4.0)])
    assert (len(scene), unexplained) == (0, 1)


def test_a_track_keeps_the_class_that_most_boxes_say() -> None:
    motions, still = ObjectMotions(), np.zeros(3)
    fuser = CloudFuser(FuseConfig(), motions)
    ids, classes = set(), []
    for name in ("car", "car", "truck", "car"):
        scene, _ = fused([(name, 0.7, CAR)], [CAR], fuser, odometry=still)
        motions.add(scene, OdometryAt("odom", still, np.zeros((3, 3)), 0.0, 0.0))
        ids.update(scene.ids)
        classes.append(scene.classes)
        np.testing.assert_allclose(scene.positions_xy, [[CAR.x, CAR.y]], atol=0.4)
    assert ids == {"1"}
    assert classes == [("car",)] * 4


def test_an_object_beside_its_track_is_less_sure_than_alone() -> None:
    """One that stands is not suddenly elsewhere: the points of two were taken for one, or those of its neighbour."""
    motions, still, aside = ObjectMotions(), np.zeros(3), Solid(CAR.x, CAR.y + 0.8, 4.3, 1.75, 1.5, 0.1)
    fuser = CloudFuser(FuseConfig(), motions)
    for _ in range(5):
        scene, _ = fused([("car", 0.7, CAR)], [CAR], fuser, odometry=still)
        motions.add(scene, OdometryAt("odom", still, np.zeros((3, 3)), 0.0, 0.0))
    off, _ = fused([("car", 0.7, aside)], [aside], fuser, odometry=still)
    alone, _ = fused([("car", 0.7, aside)], [aside])
    assert off.ids == scene.ids
    assert np.trace(off.covariances[0]) > 4 * np.trace(alone.covariances[0])


def test_what_the_image_cuts_goes_on_beside_it() -> None:
    """A LiDAR sees all of a car that is driven past; its rear alone could lie any way."""
    beside = Solid(5.0, -4.0, 4.3, 1.75, 1.5)
    assert box_of(beside)[2] == SIZE_PX[0]
    points = cloud([beside], ALL_AROUND)[0]
    found = whole_cloud(points, np.zeros(2), ClusterConfig())
    around = ClusteredCloud(10**9, "base_link", found.points_m, found.heights_m, found.clusters)
    view = CameraView.at(CAMERA, BASE_FROM_CAMERA, np.zeros(3), 0.0)
    scene, _ = CloudFuser(FuseConfig(), ObjectMotions()).add(
        around, [SeenImage(detections([("car", 0.8, beside)]), view)], None
    )
    np.testing.assert_allclose(scene.positions_xy, [[beside.x, beside.y]], atol=0.3)


def test_without_an_image_or_points_the_scene_is_empty() -> None:
    fuser = CloudFuser(FuseConfig(), ObjectMotions())
    scene, unexplained = fuser.add(clustered([CAR]), [], None)
    assert (len(scene), unexplained) == (0, 0)
    nothing = ClusteredCloud(
        1, "base_link", np.zeros((0, 3), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int32)
    )
    view = CameraView.at(CAMERA, BASE_FROM_CAMERA, np.zeros(3), 0.0)
    scene, _ = fuser.add(nothing, [SeenImage(detections([]), view)], None)
    assert len(scene) == 0


def test_lamps_under_the_ceiling_are_nothing() -> None:
    """A network that does not know them calls them boats or cars, which stand on the ground."""
    lamp = Solid(12.0, 1.0, 1.2, 0.3, 0.2, above_m=3.4)
    for name in ("boat", "car"):
        scene, unexplained = fused([(name, 0.45, lamp)], [lamp])
        assert (len(scene), unexplained) == (0, 1)


def test_what_only_the_camera_places_stands_on_the_sloping_ground_as_tall_as_its_class() -> None:
    slope, far = 0.04, Solid(14.0, 2.0, 0.4, 0.4, 1.7, above_m=0.04 * 14.0)
    view = CameraView.at(CAMERA, BASE_FROM_CAMERA, np.zeros(3), 0.0)
    beside = [Solid(24.0, 5.0, 1.0, 1.0, 1.5), Solid(34.0, 3.0, 1.0, 1.0, 1.5), Solid(8.0, 1.9, 0.6, 0.6, 1.0)]
    ground = clustered(beside, slope=(slope, 0.0))
    scene, unexplained = CloudFuser(FuseConfig(), ObjectMotions()).add(
        ground, [SeenImage(detections([("person", 0.8, far)]), view)], None
    )
    assert (scene.classes, unexplained) == (("person",), 0)
    assert scene.boxes is not None
    tall = scene.boxes.sizes_m[0, 2]
    assert tall == pytest.approx(1.725)  # between a person's least and greatest height
    foot = scene.boxes.centres_m[0, 2] - tall / 2
    assert foot == pytest.approx(slope * scene.positions_xy[0, 0], abs=0.1)


def test_something_round_is_surer_across_the_view_than_along_it() -> None:
    scene, _ = fused([("person", 0.7, PERSON)], [PERSON])
    across, along = np.linalg.eigvalsh(scene.covariances[0])
    assert np.sqrt(across) == pytest.approx(0.1)
    assert np.sqrt(along - across) == pytest.approx(scene.radii_m[0] / 2)
