"""Any scan becomes the same rays: direction of turning, mounting, sentinels, motion, slices of clouds."""

import numpy as np
import pytest
from mcap_landmarks.geometry.se2 import Array, exp
from mcap_landmarks.lidar.beams import Beams, Limits, echoes, sweep, together
from mcap_landmarks.lidar.clouds import in_slice, slice_beams
from numpy.typing import NDArray

from tests.lidar.scans import ANGLES_RAD, disc, ranges

THINGS = [disc(3.0, 0.4, 0.15), disc(-2.0, 2.0, 0.25)]
UPSIDE_DOWN = np.diag([1.0, -1.0, -1.0, 1.0])


def hits(beams: Beams) -> Array:
    points = beams.points_at(np.flatnonzero(np.isfinite(beams.ranges_m)))
    return points[np.lexsort(points.T)]


def mounted(x: float, y: float, yaw: float) -> Array:
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    matrix[:2, 3] = x, y
    return matrix


def test_rays_end_on_the_things() -> None:
    beams = sweep(ANGLES_RAD, ranges(THINGS), np.eye(4))
    points = hits(beams)
    assert len(points) > 15
    off = [np.abs(np.hypot(*(points - pose[:2]).T) - size[0]) for pose, size in THINGS]
    np.testing.assert_allclose(np.min(off, axis=0), 0.0, atol=1e-9)
    assert beams.is_closed == (True,)
    assert (np.diff(beams.angles_rad) > 0).sum() >= len(beams.angles_rad) - 2


def test_a_scan_that_turns_the_other_way_or_hangs_upside_down_is_the_same() -> None:
    distances = ranges(THINGS)
    expected = hits(sweep(ANGLES_RAD, distances, np.eye(4)))
    backwards = sweep(ANGLES_RAD[::-1], distances[::-1], np.eye(4))
    inverted = sweep(-ANGLES_RAD, distances, UPSIDE_DOWN)
    np.testing.assert_allclose(hits(backwards), expected, atol=1e-12)
    np.testing.assert_allclose(hits(inverted), expected, atol=1e-12)


def test_a_mounting_moves_and_turns_the_rays() -> None:
    pose = np.array([0.3, -0.2, 2.0])
    beams = sweep(ANGLES_RAD, ranges(THINGS, base_from_lidar=pose), mounted(*pose))
    points = hits(beams)
    off = [np.abs(np.hypot(*(points - thing[:2]).T) - size[0]) for thing, size in THINGS]
    np.testing.assert_allclose(np.min(off, axis=0), 0.0, atol=1e-9)


def test_beams_leave_from_where_the_lidar_was() -> None:
    """A robot that drives and turns under the scan sees round things; taken as standing, they are off by cm."""
    then = exp(np.linspace(0.0, 0.2, len(ANGLES_RAD))[:, None] * np.array([1.0, 0.0, 2.0]))
    distances = ranges(THINGS, base_from_lidar=then)

    def worst(beams: Beams) -> float:
        points = hits(beams)
        off = [np.abs(np.hypot(*(points - pose[:2]).T) - size[0]) for pose, size in THINGS]
        return float(np.min(off, axis=0).max())

    assert worst(sweep(ANGLES_RAD, distances, np.eye(4), then)) < 1e-9
    assert worst(sweep(ANGLES_RAD, distances, np.eye(4))) > 0.05


@pytest.mark.parametrize(
    ("values", "limits"),
    [
        ([1.0, 0.0, np.nan, np.inf, -np.inf, -1.0, 65.535, 12.0], (0.1, 12.0)),
        ([1.0, 0.05, 0.0, 12.1, 1e9, np.nan, 11.9999, 12.0], (0.1, 12.0)),
    ],
)
def test_sentinels_are_nothing(values: list[float], limits: tuple[float, float]) -> None:
    seen = echoes(np.array(values, dtype=np.float32), *limits)
    assert seen[0] == 1.0
    assert np.isinf(seen[1:]).all()


@pytest.mark.parametrize("limits", [(0.0, 0.0), (0.0, np.inf), (np.nan, np.nan), (0.0, -1.0)])
def test_limits_that_make_no_sense_are_none(limits: tuple[float, float]) -> None:
    far: NDArray[np.float32] = np.array([40.0, np.inf], dtype=np.float32)
    if np.isnan(limits[0]):
        assert np.isinf(echoes(far, *limits)).all()  # nothing is known to be in front of such a limit
    else:
        assert echoes(far, *limits).tolist() == [40.0, np.inf]


def test_limits_of_range_and_view() -> None:
    everything = sweep(ANGLES_RAD, ranges(THINGS), np.eye(4))
    ahead = sweep(ANGLES_RAD, ranges(THINGS), np.eye(4), limits=Limits(view_rad=(-0.5, 0.5)))
    assert len(ahead.ranges_m) == pytest.approx(360 / (2 * np.pi), abs=2)
    assert ahead.is_closed == (False,)
    assert ahead.angles_rad.min() >= -0.5
    assert (np.diff(ahead.angles_rad) > 0).all()
    near = sweep(ANGLES_RAD, ranges(THINGS), np.eye(4), limits=Limits(range_m=(0.0, 2.9)))
    assert 0 < np.isfinite(near.ranges_m).sum() < np.isfinite(everything.ranges_m).sum()
    assert len(near.ranges_m) == len(everything.ranges_m)


def test_two_lidars_keep_their_own_rays() -> None:
    poses = np.array([[0.2, 0.0, 0.0], [-0.2, 0.0, 3.0]])
    one, other = (sweep(ANGLES_RAD, ranges(THINGS, base_from_lidar=pose), mounted(*pose)) for pose in poses)
    both = together([one, other])
    assert both.starts == (0, 360, 720)
    np.testing.assert_array_equal(both.origins_xy[360:], other.origins_xy)


def test_a_slice_of_a_cloud_is_the_nearest_return_of_each_direction() -> None:
    angles = np.linspace(-np.pi, np.pi, 720, endpoint=False) + 1e-3
    distances = ranges(THINGS, angles=angles, base_from_lidar=np.array([0.1, 0.0, 0.0]))
    ring = np.column_stack([0.1 + distances * np.cos(angles), distances * np.sin(angles), np.full(720, 0.2)])
    behind = ring + 0.5 * (ring - [0.1, 0.0, 0.2])
    ceiling = np.column_stack([ring[:, :2] * 0.5, np.full(720, 2.0)])
    cloud = np.concatenate([behind, ceiling, ring, np.full((3, 3), np.nan)])
    inside, origin = in_slice(cloud, (0.1, 0.3)), np.array([0.1, 0.0])
    beams = slice_beams(cloud[inside, :2], origin, np.deg2rad(0.5))
    assert len(beams.ranges_m) == 720
    expected = ring[np.isfinite(distances), :2]
    np.testing.assert_allclose(hits(beams), expected[np.lexsort(expected.T)], atol=1e-9)
    assert not in_slice(cloud, (5.0, 6.0)).any()
    nothing = slice_beams(np.zeros((0, 2)), origin, 0.1)
    assert np.isinf(nothing.ranges_m).all()
    np.testing.assert_array_equal(nothing.origins_xy, np.broadcast_to(origin, (63, 2)))


def test_what_a_sparse_cloud_leaves_out_is_not_taken_for_free() -> None:
    distances = ranges(THINGS)
    seen = np.isfinite(distances)
    points = distances[seen, None] * np.column_stack([np.cos(ANGLES_RAD[seen]), np.sin(ANGLES_RAD[seen])])
    beams = slice_beams(points, np.zeros(2), np.deg2rad(0.25))
    expected = sweep(ANGLES_RAD, distances, np.eye(4))
    np.testing.assert_allclose(hits(beams), hits(expected), atol=1e-9)
    np.testing.assert_allclose(np.diff(np.sort(beams.angles_rad)), expected.spacing_rad[0], rtol=0.01)


def test_a_slice_of_a_cloud_leaves_from_where_the_lidar_was() -> None:
    """The same points with their times, and the beams that a scan with the same times has."""
    then = exp(np.linspace(-0.1, 0.1, len(ANGLES_RAD))[:, None] * np.array([1.0, 0.0, 2.0]))
    distances = ranges(THINGS, base_from_lidar=then)
    seen = np.isfinite(distances)
    points = distances[seen, None] * np.column_stack([np.cos(ANGLES_RAD[seen]), np.sin(ANGLES_RAD[seen])])
    expected = sweep(ANGLES_RAD, distances, np.eye(4), then)
    beams = slice_beams(points, np.zeros(2), 1e-3, then[seen])
    np.testing.assert_allclose(hits(beams), hits(expected), atol=1e-9)
    off = [np.abs(np.hypot(*(hits(beams) - pose[:2]).T) - size[0]) for pose, size in THINGS]
    np.testing.assert_allclose(np.min(off, axis=0), 0.0, atol=1e-9)
    by_angle, seen_too = np.argsort(expected.angles_rad), np.isfinite(beams.ranges_m)
    for i in np.flatnonzero(seen_too):
        nearest = by_angle[np.argmin(np.abs(expected.angles_rad[by_angle] - beams.angles_rad[i]))]
        np.testing.assert_allclose(beams.origins_xy[i], expected.origins_xy[nearest], atol=1e-9)
    # Beams that met nothing leave from where those beside them do, not from where the LiDAR is now.
    beside = np.flatnonzero(seen_too[:-1] & ~seen_too[1:])
    np.testing.assert_array_equal(beams.origins_xy[beside + 1], beams.origins_xy[beside])
