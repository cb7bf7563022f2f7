"""The cluster stage: what it makes of scans, whoever recorded them, and what it refuses."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_landmarks.channels import SCAN, SCAN_FILTERED, SCAN_OBJECTS, SECOND_SCAN, TF_STATIC
from mcap_landmarks.config import stage_config
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.geometry.se2 import Array, compose, exp, transform_points
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.messages.codec import Message, decode, encode
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.transforms import TFMessage, Transform
from mcap_landmarks.recording.time_association import Association, associate
from mcap_landmarks.stage import Bundle, Channel, Omission
from mcap_landmarks.stages.cluster import process

from tests.lidar.scans import ANGLES_RAD, Thing, box, disc, ranges
from tests.recording.tracks import track

SECOND = 10**9
THINGS = [disc(3.0, 0.6, 0.15), box(2.5, -1.0, 0.4, 0.5, 0.28)]
UPRIGHT, OVERHEAD = np.array([0.0, 0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0, 0.0])


def mounting(
    frame: str = "laser", x: float = 0.0, rotation: Array = UPRIGHT, base: str = "base_footprint"
) -> Transform:
    return Transform(0, base, frame, np.array([x, 0.0, 0.2]), rotation)


def scan(
    distances: Array, stamp_ns: int = SECOND, frame: str = "laser", turn_s: float = 0.0, step: float = 6.28 / 359
) -> LaserScan:
    empty = np.zeros(0, np.float32)
    values = np.asarray(distances, dtype=np.float32)
    increment_s = turn_s / len(values)
    return LaserScan(stamp_ns, frame, 0.0, step * 359, step, increment_s, turn_s, 0.12, 15.0, values, empty)


def bundle(message: Message, *transforms: Transform, second: Message | None = None) -> Bundle:
    found: dict[object, Message] = {SCAN: message}
    if transforms:
        found[TF_STATIC] = TFMessage(transforms)
    if second is not None:
        found[SECOND_SCAN] = second
    return Bundle(SECOND, SECOND + 5, found)  # type: ignore[arg-type]


def results(bundles: Sequence[Bundle], config: ClusterConfig | None = None, **files: Path) -> list[ScanObjects]:
    made = list(process(bundles, config or ClusterConfig(), files))
    found = [one.message for one in made if not isinstance(one, Omission) and one.channel == SCAN_OBJECTS]
    assert all(isinstance(one, ScanObjects) for one in found)
    return found  # type: ignore[return-value]


def places(found: ScanObjects, *names: str) -> Array:
    """The centre under each class, of the object that is most likely of it."""
    chosen = []
    for name in names:
        shares = [max((s for n, s in options if n == name), default=0.0) for options in found.hypotheses]
        best = int(np.argmax(shares))
        chosen.append(found.positions_xy[best][[n for n, _ in found.hypotheses[best]].index(name)])
    return np.array(chosen)


def test_objects_are_in_the_base_frame_at_the_scan_s_time() -> None:
    distances = ranges(THINGS, np.random.default_rng(0), base_from_lidar=np.array([-0.1, 0.0, 0.0]))
    (made,) = process([bundle(scan(distances), mounting(x=-0.1))], ClusterConfig(), {})
    assert not isinstance(made, Omission)
    assert made.log_time_ns == SECOND + 5
    found = made.message
    assert isinstance(found, ScanObjects)
    assert (found.stamp_ns, found.frame_id, len(found)) == (SECOND, "base_footprint", 2)
    np.testing.assert_allclose(places(found, "fire hydrant", "suitcase"), [[3.0, 0.6], [2.5, -1.0]], atol=0.025)
    for options in found.hypotheses:
        assert sum(share for _, share in options) == pytest.approx(1.0)
        assert options[-1][0] == ""
    again = decode(ScanObjects, encode(found))
    assert again.hypotheses == found.hypotheses


def test_other_mountings_and_scanners_find_the_same() -> None:
    pose = np.array([0.2, 0.0, 0.0])
    distances = ranges(THINGS, base_from_lidar=pose)
    (usual,) = results([bundle(scan(distances), mounting(x=0.2))])
    clockwise = ranges(THINGS, angles=-2 * np.pi / 360 * np.arange(360), base_from_lidar=pose)
    upside_down = ranges(THINGS, angles=-ANGLES_RAD, base_from_lidar=pose)
    sentinels = np.where(np.isfinite(distances), distances, 15.0)
    sentinels[::3] = np.where(np.isfinite(distances[::3]), distances[::3], 0.0)
    sentinels[1::3] = np.where(np.isfinite(distances[1::3]), distances[1::3], np.nan)
    backwards = scan(clockwise, step=-2 * np.pi / 360)
    others = [
        bundle(backwards, mounting(x=0.2)),
        bundle(scan(upside_down), mounting(x=0.2, rotation=OVERHEAD)),
        bundle(scan(sentinels), mounting(x=0.2)),
        bundle(scan(distances, frame="/laser"), mounting(x=0.2)),
    ]
    for found in results(others):
        assert len(found) == len(usual)
        np.testing.assert_allclose(
            places(found, "fire hydrant", "suitcase"), places(usual, "fire hydrant", "suitcase"), atol=0.012
        )


def test_two_lidars_are_merged_at_the_first_one_s_time() -> None:
    rng = np.random.default_rng(1)
    front, back = (ranges(THINGS, rng, base_from_lidar=np.array([x, 0.0, 0.0])) for x in (0.3, -0.3))
    mounts = mounting("front", 0.3), mounting("back", -0.3)
    both = bundle(scan(front, frame="front"), *mounts, second=scan(back, SECOND + 10**7, "back"))
    (found,) = results([both])
    assert len(found) == 2
    np.testing.assert_allclose(places(found, "fire hydrant", "suitcase"), [[3.0, 0.6], [2.5, -1.0]], atol=0.02)


def test_a_slice_of_a_cloud_is_a_scan() -> None:
    angles = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    distances = ranges(THINGS, angles=angles)
    seen = np.isfinite(distances)
    ahead = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(720)])
    ring = distances[seen, None] * ahead[seen]
    cloud = PointCloud2(SECOND, "laser", np.concatenate([ring, ring * [0.5, 0.5, 1] + [0, 0, 1.5]]).astype(np.float32))
    (found,) = results([bundle(cloud, mounting())], ClusterConfig(slice_m=(0.1, 0.3)))
    np.testing.assert_allclose(places(found, "fire hydrant", "suitcase"), [[3.0, 0.6], [2.5, -1.0]], atol=0.02)
    with pytest.raises(UsageError, match="--slice ZMIN:ZMAX"):
        results([bundle(cloud, mounting(), second=scan(distances))])
    with pytest.raises(UsageError, match="--slice ZMIN:ZMAX"):
        results([bundle(scan(distances), mounting(), second=cloud)])


def drive(
    velocity: Array,
    count: int,
    rng: np.random.Generator,
    turn_s: float = 0.2,
    stamped_s: float | None = None,
    is_stamped: bool = True,
    slip: Array | None = None,
) -> list[Bundle]:
    """Scans of a robot that drives and turns, each beam at its time, associated with odometry.

    With `stamped_s` they are clouds, stamped so long after the first of their points. `slip` (3,) are standard
    deviations of each step of odometry.
    """
    rate = 30
    driven, frames, pose = [], ("odom", "base_footprint"), np.zeros(3)
    for i in range(rate * (count + 2)):
        at = SECOND + i * SECOND // rate
        driven.append((at, Odometry.planar(at, frames, pose, np.zeros((3, 3)))))
        pose = compose(pose, exp(velocity / rate + (0.0 if slip is None else slip * rng.normal(size=3))))
    messages: list[tuple[Channel[Message], int, Message]] = []
    for k in range(count):
        start = SECOND + SECOND // 3 + k * SECOND
        times = (start - SECOND) / 1e9 + turn_s * np.arange(360) / 360
        poses = exp(times[:, None] * velocity)
        distances = ranges(THINGS, rng, base_from_lidar=poses)
        message: Message = scan(distances, start if is_stamped else 0, turn_s=turn_s)
        if stamped_s is not None:
            message = cloud_of(distances, start + round(stamped_s * SECOND), turn_s, stamped_s)
        messages.append((SCAN, start + int(turn_s * SECOND), message))
    messages.append((TF_STATIC, 0, TFMessage((mounting(),))))
    messages.sort(key=lambda entry: entry[1])
    return list(associate(messages, SCAN, Association(), odometry=track(driven), held=[TF_STATIC]))


def cloud_of(distances: Array, stamp_ns: int, turn_s: float, stamped_s: float) -> PointCloud2:
    places = np.column_stack([np.cos(ANGLES_RAD), np.sin(ANGLES_RAD), np.zeros(360)])
    seen = np.isfinite(distances)
    times_ns = np.round((turn_s * np.arange(360) / 360 - stamped_s) * SECOND).astype(np.int64)
    points = distances[seen, None] * places[seen]
    return PointCloud2(stamp_ns, "laser", points.astype(np.float32), times_ns[seen])


@pytest.mark.parametrize("stamped_s", [None, 0.0, 0.1, 0.2])
def test_motion_under_a_scan_or_cloud_is_taken_out(stamped_s: float | None) -> None:
    velocity, config = np.array([0.3, 0.0, 1.2]), ClusterConfig(slice_m=(0.1, 0.3), slice_beam_deg=1.0)
    for one in drive(velocity, 3, np.random.default_rng(1), stamped_s=stamped_s):
        (found,) = results([one], config)
        pose = exp(velocity * (one.stamp_ns - SECOND) / 1e9)
        truth = transform_points(compose(exp(-velocity * (one.stamp_ns - SECOND) / 1e9), np.zeros(3)), [3.0, 0.6])
        np.testing.assert_allclose(transform_points(pose, truth), [3.0, 0.6], atol=1e-9)
        np.testing.assert_allclose(places(found, "fire hydrant")[0], truth, atol=0.03)


def test_wheels_that_slip_make_objects_less_sure() -> None:
    """Of 20 scans: squared errors over their variances, two of which add up to 2 where covariances are honest."""
    velocity, apart = np.array([0.02, 0.0, 0.0]), []
    for one in drive(velocity, 20, np.random.default_rng(3), slip=np.array([0.005, 0.0, 0.01])):
        (found,) = results([one])
        shares = [max((s for n, s in options if n == "suitcase"), default=0.0) for options in found.hypotheses]
        best = int(np.argmax(shares))
        row = [n for n, _ in found.hypotheses[best]].index("suitcase")
        truth = transform_points(exp(-velocity * (one.stamp_ns - SECOND) / 1e9), [2.5, -1.0])
        off = found.positions_xy[best][row] - truth
        apart.append(off @ np.linalg.inv(found.covariances[best][row]) @ off)
    assert np.mean(apart) < 4.0  # 405 if slip does not count


def test_a_scan_without_a_stamp_was_logged_after_its_turn() -> None:
    velocity = np.array([0.3, 0.0, 1.2])
    for one in drive(velocity, 3, np.random.default_rng(1), is_stamped=False):
        (found,) = results([one])
        truth = transform_points(exp(-velocity * (one.stamp_ns - SECOND) / 1e9), [3.0, 0.6])
        np.testing.assert_allclose(places(found, "fire hydrant")[0], truth, atol=0.03)


@pytest.mark.slow
def test_ids_follow_objects_all_around() -> None:
    velocity = np.array([0.1, 0.0, 1.0])
    found = results(drive(velocity, 7, np.random.default_rng(2)))
    assert len(found) == 7
    assert {frozenset(one.ids) for one in found} == {frozenset(("1", "2"))}


def test_without_odometry_nobody_is_recognised() -> None:
    one = bundle(scan(ranges(THINGS)), mounting())
    assert [found.ids for found in results([one, one])] == [("1", "2"), ("3", "4")]


def test_shapes_of_the_configuration_lie_over_the_usual_ones() -> None:
    config = stage_config(
        ClusterConfig, "cluster", {"shapes": {"pillar": [{"kind": "disc", "radius_m": 0.4}], "car": []}}
    )
    (found,) = results([bundle(scan(ranges([disc(3.0, 1.0, 0.4)])), mounting())], config)
    assert found.hypotheses[0][0][0] == "pillar"
    assert "car" not in dict(found.hypotheses[0])
    assert config.shapes["suitcase"] == ClusterConfig().shapes["suitcase"]
    with pytest.raises(UsageError, match="shapes"):
        stage_config(ClusterConfig, "cluster", {"shapes": {"pillar": [{"kind": "disc"}]}})


def test_limits_of_range_and_view() -> None:
    one = bundle(scan(ranges(THINGS)), mounting())
    (left,) = results([one], ClusterConfig(view_deg=(0.0, 90.0)))
    (near,) = results([one], ClusterConfig(range_m=(0.0, 2.8)))
    assert [len(found) for found in (left, near)] == [1, 1]
    assert left.positions_xy[0][-1][1] > 0 > near.positions_xy[0][-1][1]
    (one_way,), (other_way,) = (results([one], ClusterConfig(view_deg=view)) for view in ((330.0, 5.0), (-30.0, 5.0)))
    assert len(one_way) == len(other_way) == 1
    np.testing.assert_array_equal(one_way.positions_xy[0], other_way.positions_xy[0])
    np.testing.assert_allclose(places(one_way, "suitcase"), [[2.5, -1.0]], atol=0.02)


def test_a_scan_of_nothing_is_a_message_of_nothing() -> None:
    (found,) = results([bundle(scan(np.full(360, np.inf)), mounting())])
    assert len(found) == 0


def test_nobody_guesses_where_the_lidar_is(tmp_path: Path) -> None:
    distances = ranges(THINGS, base_from_lidar=np.array([0.4, 0.0, 0.0]))
    with pytest.raises(RecordingError, match=r"nothing says where the LiDAR \(laser\) sits.*--extrinsics FILE"):
        results([bundle(scan(distances))])
    with pytest.raises(RecordingError, match="from laser to base_footprint"):
        results([bundle(scan(distances), mounting("camera"))])
    known = tmp_path / "mounting.toml"
    known.write_text('[[transforms]]\nparent = "base_link"\nchild = "laser"\nxyz = [0.4, 0.0, 0.2]\n')
    (found,) = results([bundle(scan(distances))], extrinsics=known)
    assert found.frame_id == "base_link"
    np.testing.assert_allclose(places(found, "fire hydrant")[0], [3.0, 0.6], atol=0.02)
    (found,) = results([bundle(scan(ranges(THINGS), frame="base_link"))])
    assert found.frame_id == "base_link"


def test_the_thesis_s_method() -> None:
    things: list[Thing] = [disc(3.0, 0.6, 0.15), disc(4.0, -1.0, 0.15), disc(0.5, 3.0, 0.15)]
    one = bundle(scan(ranges(things)), mounting())
    made = list(process([one], ClusterConfig(method="thesis"), {}))
    channels = [entry.channel for entry in made if not isinstance(entry, Omission)]
    assert channels == [SCAN_FILTERED, SCAN_OBJECTS]
    (found,) = results([one], ClusterConfig(method="thesis"))
    assert found.hypotheses == ((("", 1.0),),) * 2
    assert found.positions_xy[0][0, 1] > found.positions_xy[1][0, 1]  # from left to right
    off = np.hypot(*(found.positions_xy[0][0] - [3.0, 0.6]))
    assert off == pytest.approx(0.15, abs=0.03)  # the near surface, not the centre
    cloud = PointCloud2(SECOND, "laser", np.zeros((1, 3), np.float32))
    with pytest.raises(UsageError, match="LaserScan"):
        results([bundle(cloud, mounting())], ClusterConfig(method="thesis"))


@settings(max_examples=25)
@given(st.lists(st.one_of(st.floats(0.2, 14.0), st.sampled_from([0.0, np.inf, np.nan, 15.0])), min_size=2, max_size=60))
def test_any_scan_gives_sound_objects(values: list[float]) -> None:
    (found,) = results([bundle(scan(np.array(values), step=2 * np.pi / len(values)), mounting())])
    for options, points, spreads in zip(found.hypotheses, found.positions_xy, found.covariances, strict=True):
        assert sum(share for _, share in options) == pytest.approx(1.0)
        assert np.isfinite(points).all()
        assert (np.linalg.eigvalsh(spreads) > 0).all()


def test_scans_that_scatter_more_than_assumed_are_counted() -> None:
    rng = np.random.default_rng(2)
    exact = ranges([*THINGS, disc(-2.0, 0.5, 0.15), box(-1.5, -2.0, 1.0, 0.5, 0.28)])
    bundles = [bundle(scan(exact + rng.normal(0.0, 0.03, len(exact))), mounting()) for _ in range(12)]
    left_out = [one for one in process(bundles, ClusterConfig(), {}) if isinstance(one, Omission)]
    assert len(left_out) == 12
    assert {one.reason for one in left_out} == {
        "scans whose ranges scatter by 0.028 m about what they show, where cluster.sigma_m is 0.01; it is less sure"
    }
    assert not any(one.lost for one in left_out)
    assert not [one for one in process(bundles, ClusterConfig(sigma_m=0.03), {}) if isinstance(one, Omission)]
