"""Several cameras beside a cloud: every object once, wherever views overlap, end or look."""

from collections.abc import Sequence

import numpy as np
import pytest
from mcap_landmarks.fusion.cloud_fuser import CloudFuser
from mcap_landmarks.fusion.cloud_objects import FoundObject
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.object_motions import ObjectMotions
from mcap_landmarks.fusion.several_views import ViewedObject, distinct, objects_in
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.rectangles import Rectangle
from mcap_landmarks.lidar.whole_clouds import whole_cloud
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.scene import SceneObjects

from tests.fusion.turned_cameras import TurnedCamera
from tests.lidar.clouds import ALL_AROUND, Solid, cloud


def camera(frame: str, yaw_deg: float) -> TurnedCamera:
    """One that sees 81 degrees, on a car's roof."""
    return TurnedCamera(frame, yaw_deg, 1.65, 700.0, (1200, 400))


LEFT, RIGHT, SIDE, REAR = camera("left", 25.0), camera("right", -25.0), camera("side", 90.0), camera("rear", 180.0)
AHEAD, ASIDE, BEHIND = (
    Solid(14.0, 0.5, 4.3, 1.75, 1.5, 0.1),
    Solid(1.0, 12.0, 4.3, 1.75, 1.5),
    Solid(-13, 0, 4.3, 1.75, 1.5),
)
PERSON, OTHER = Solid(8.0, 5.0, 0.4, 0.4, 1.7), Solid(9.0, -4.0, 0.4, 0.4, 1.7)
Told = tuple[str, Solid]


def corners(solid: Solid) -> Array:
    """The corners (8, 3) of a solid in the base frame."""
    sides = np.array([[x, y, z] for x in (1, -1) for y in (1, -1) for z in (0, 2)])
    local = sides * [solid.length_m / 2, solid.width_m / 2, solid.height_m / 2]
    c, s = np.cos(solid.yaw_rad), np.sin(solid.yaw_rad)
    return local @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + [solid.x, solid.y, solid.above_m]


def clustered(solids: Sequence[Solid]) -> ClusteredCloud:
    points, _ = cloud(solids, ALL_AROUND)
    found = whole_cloud(points, np.zeros(2), ClusterConfig())
    return ClusteredCloud(10**9, "base_footprint", found.points_m, found.heights_m, found.clusters)


def fused(
    told: Sequence[Told], solids: Sequence[Solid], cameras: Sequence[TurnedCamera], fuser: CloudFuser | None = None
) -> tuple[SceneObjects, int]:
    """The scene of solids that all cameras call the same."""
    images = [one.sees([name for name, _ in told], [corners(solid) for _, solid in told]) for one in cameras]
    return (fuser or CloudFuser(FuseConfig(), ObjectMotions())).add(clustered(solids), images, np.zeros(3))


def check(scene: SceneObjects, told: Sequence[Told], within_m: float = 0.4) -> None:
    """The scene has these and nothing else."""
    left = {i: (scene.classes[i], scene.positions_xy[i]) for i in range(len(scene))}
    for name, solid in told:
        i = min(left, key=lambda one: float(np.hypot(*(left[one][1] - [solid.x, solid.y]))))
        found, place = left.pop(i)
        assert found == name
        assert np.hypot(*(place - [solid.x, solid.y])) < within_m
    assert not left


def test_what_two_cameras_see_is_one_object_and_what_one_sees_is_another() -> None:
    told = [("car", AHEAD), ("person", PERSON), ("person", OTHER)]
    one, _ = fused(told, [AHEAD, PERSON, OTHER], [LEFT])
    assert len(one) == 2
    scene, unexplained = fused(told, [AHEAD, PERSON, OTHER], [LEFT, RIGHT])
    check(scene, told)
    assert unexplained == 0


def test_cameras_all_around_see_all_around() -> None:
    told = [("car", AHEAD), ("car", ASIDE), ("car", BEHIND), ("person", PERSON)]
    scene, unexplained = fused(told, [solid for _, solid in told], [LEFT, RIGHT, SIDE, REAR])
    check(scene, told)
    assert unexplained == 0


@pytest.mark.parametrize("y", [-4.9, -4.4, -3.6, -2.8, 2.8, 3.6, 4.4, 4.9])
def test_what_an_edge_cuts_is_where_the_other_camera_sees_it_whole(y: float) -> None:
    """The left camera's image ends 16 degrees to the right, the right one's 16 degrees to the left."""
    car = Solid(14.0, y, 4.3, 1.75, 1.5)
    scene, unexplained = fused([("car", car)], [car], [LEFT, RIGHT])
    check(scene, [("car", car)], 0.3)
    assert unexplained == 0


def test_neighbours_stay_apart() -> None:
    """Two people beside each other, each seen by both cameras, and two cars, the farther one half hidden."""
    pair = [("person", Solid(9.0, 0.5, 0.4, 0.4, 1.7)), ("person", Solid(9.0, -0.5, 0.4, 0.4, 1.8))]
    scene, unexplained = fused(pair, [solid for _, solid in pair], [LEFT, RIGHT])
    check(scene, pair)
    assert unexplained == 0
    cars = [("car", Solid(12.0, -1.5, 4.3, 1.75, 1.5)), ("car", Solid(18.5, -1.2, 4.3, 1.75, 1.5))]
    scene, _ = fused(cars, [solid for _, solid in cars], [LEFT, RIGHT])
    check(scene, cars, 1.5)  # of the farther one little shows


def test_what_only_cameras_see_is_one_object_as_well() -> None:
    person = Solid(15.0, 0.3, 0.4, 0.4, 1.7)
    scene, unexplained = fused([("person", person)], [Solid(20.0, -12.0, 1.0, 1.0, 2.0)], [LEFT, RIGHT])
    check(scene, [("person", person)], 3.0)
    assert unexplained == 0


def test_the_class_comes_from_all_boxes_of_an_object() -> None:
    """One camera calls it a truck, two call it a car."""
    ahead = camera("ahead", 0.0)
    images = [one.sees([name], [corners(AHEAD)]) for one, name in ((LEFT, "truck"), (RIGHT, "car"), (ahead, "car"))]
    scene, unexplained = CloudFuser(FuseConfig(), ObjectMotions()).add(clustered([AHEAD]), images, np.zeros(3))
    assert (scene.classes, unexplained) == (("car",), 0)
    assert [name for name, _ in scene.hypotheses[0]] == ["car", "truck"]
    np.testing.assert_allclose(scene.hypotheses[0][0][1] / scene.hypotheses[0][1][1], 2.0)


def test_a_box_of_each_camera_at_most_is_of_one_object() -> None:
    """Of one view, a second object in the place of another is none, and its box is left over."""
    image = LEFT.sees(["person", "person"], [corners(PERSON), corners(PERSON) + np.array([0.0, 0.0, 0.02])])
    _, unexplained = CloudFuser(FuseConfig(), ObjectMotions()).add(clustered([PERSON]), [image], np.zeros(3))
    assert unexplained == 1


def test_of_two_objects_in_one_place_the_one_with_points_stays() -> None:
    (seen,) = objects_in(clustered([PERSON]), LEFT.sees(["person"], [corners(PERSON)]), FuseConfig())

    def found(score: float, points: int) -> ViewedObject:
        place = Rectangle(np.array([9.0, 1.0]), 1.0, 1.0, 0.0, np.eye(2))
        return seen._replace(found=FoundObject(0, score, place, np.arange(points)))

    by_camera, weak, strong = found(0.9, 0), found(0.4, 1), found(0.6, 30)
    assert distinct([[by_camera, weak]]) == [[weak]]
    assert distinct([[by_camera, weak, strong]]) == [[strong]]
