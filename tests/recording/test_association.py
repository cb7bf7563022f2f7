"""Bundles: odometry at their stamps, and what found no partner."""

import numpy as np
import pytest

from toolkit.channels import ODOMETRY, SCENE_OBJECTS
from toolkit.messages.poses import Odometry
from toolkit.messages.scene import SceneObjects
from toolkit.recording.association import WINDOW_NS, Association, associate
from toolkit.stage import Bundle

SECOND = 10**9


def scene(stamp_ns: int) -> SceneObjects:
    return SceneObjects(stamp_ns, "base", (), (), np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0))


def odometry(stamp_ns: int, *pose: float) -> Odometry:
    return Odometry.planar(stamp_ns, ("odom", "base"), pose, np.eye(3) * stamp_ns)


def bundles(*messages: tuple[int, SceneObjects | Odometry]) -> tuple[list[Bundle], Association]:
    counts = Association()
    stream = (
        (SCENE_OBJECTS if isinstance(message, SceneObjects) else ODOMETRY, log_time, message)
        for log_time, message in messages
    )
    return list(associate(stream, SCENE_OBJECTS, counts)), counts


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


def test_odometry_that_goes_backwards_or_is_not_finite_is_counted() -> None:
    found, counts = bundles(
        (0, odometry(1, 0, 0, 0)),
        (1, odometry(SECOND, 1, 0, 0)),
        (2, odometry(SECOND // 2, 9, 9, 9)),
        (3, odometry(2 * SECOND, np.nan, 0, 0)),
        (4, scene(SECOND)),
    )
    assert (counts.odometry_out_of_order, counts.odometry_not_finite) == (1, 1)
    assert found[0].odometry is not None
    np.testing.assert_allclose(found[0].odometry.odom_from_base, [1, 0, 0])


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
