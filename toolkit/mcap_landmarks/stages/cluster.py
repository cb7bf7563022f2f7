"""Turn LiDAR scans into objects: where the centre of each one is, for every class that it could be."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mcap_landmarks.channels import (
    BASE_FRAME,
    CLUSTERED_CLOUD,
    ODOMETRY,
    SCAN,
    SCAN_FILTERED,
    SCAN_OBJECTS,
    SECOND_SCAN,
    TF_STATIC,
)
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.estimation.odometry import random_walk
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar import thesis
from mcap_landmarks.lidar.beams import Beams, together
from mcap_landmarks.lidar.clustering import cluster, shapes_of
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.object_tracks import PieceChange, Tracks
from mcap_landmarks.lidar.objects import Hypotheses
from mcap_landmarks.lidar.range_noise import with_noise
from mcap_landmarks.lidar.scan_beams import beams_of, check_level, returns_nothing
from mcap_landmarks.lidar.skew import motion_left, offsets_s, skew_covariances
from mcap_landmarks.lidar.whole_clouds import CloudObject, WholeCloud, points_in_base, whole_cloud
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.boxes import Boxes
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.codec import Message
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.mounting import Mounting
from mcap_landmarks.stage import Bundle, Channel, Omission, Stage, Stamped
from mcap_landmarks.vision.prefetch import in_order

_BASES = (BASE_FRAME, "base_link")
_NOTHING_STANDS = "clouds in which nothing stands on the ground"
_NOTHING_CAME_BACK = "scans in which no beam returned anything"
_NO_ODOMETRY = "scans that could not be de-skewed without odometry; what they show is less sure"
_NO_TIMES = (
    "scans that could not be de-skewed: their beams have no times, and the robot moves; what they show is less sure"
)
_NOISIER = "scans whose ranges scatter by {:.3f} m about what they show, where cluster.sigma_m is {:g}; it is less sure"


def process(
    bundles: Iterable[Bundle], config: ClusterConfig, resources: Mapping[str, Location]
) -> Iterator[Stamped | Omission]:
    """The objects of every scan, none for a scan that shows none; what could not be de-skewed is counted.

    Raises:
        RecordingError: it is not known where the LiDAR sits, or it scans in a plane that is not level.
        UsageError: a point cloud beside a planar scan, and no heights to cut it at, or with the thesis's method, which
            has none.
    """
    mounting = Mounting(resources.get("extrinsics"))
    if config.method == "thesis":
        yield from _as_in_the_thesis(bundles, mounting)
        return
    shapes = shapes_of(config)
    tracks, anew = Tracks(config.gate_m, config.memory_s), PieceChange()
    looks = _looks(bundles, mounting, config)
    for (scan, whole), beams, known in with_noise(looks, shapes, config, _is_large):
        bundle, base = scan.bundle, scan.base
        if anew.at(bundle.odometry.piece if bundle.odometry else None):
            tracks.forget()
        if whole is not None:
            yield from _of_cloud(bundle, base, tracks, whole)
        if beams is None:
            continue
        found, is_skewed = _unsure(bundle, base, mounting, known, cluster(beams, shapes, known))
        places = np.array([one.shares @ one.positions_xy for one in found]).reshape(-1, 2)
        odom_from_base = None if bundle.odometry is None else bundle.odometry.odom_from_base
        names = tracks.names(bundle.stamp_ns, odom_from_base, places)
        yield Stamped(SCAN_OBJECTS, bundle.log_time_ns, _message(bundle.stamp_ns, base, names, found))
        yield from _without_returns(bundle)
        if is_skewed:
            yield Omission(bundle.log_time_ns, _NO_ODOMETRY if bundle.odometry is None else _NO_TIMES)
        if known.sigma_m > config.sigma_m:
            yield Omission(bundle.log_time_ns, _NOISIER.format(known.sigma_m, config.sigma_m))


@dataclass(frozen=True, slots=True, eq=False)
class _Scan:
    """A bundle, its base frame, and its clouds with base_from_lidar (4, 4); none where it counts as a planar scan."""

    bundle: Bundle
    base: str
    clouds: tuple[tuple[PointCloud2, Array], ...]


def _scans(bundles: Iterable[Bundle], mounting: Mounting, config: ClusterConfig) -> Iterator[_Scan]:
    for bundle in bundles:
        base = _base_of(bundle, mounting)
        is_whole = config.slice_m is None and isinstance(bundle.messages[SCAN], PointCloud2)
        yield _Scan(bundle, base, _clouds(bundle, base, mounting) if is_whole else ())


def _looks(
    bundles: Iterable[Bundle], mounting: Mounting, config: ClusterConfig
) -> Iterator[tuple[tuple[_Scan, WholeCloud | None], Beams | None]]:
    """Scans with what clouds show as a whole, and the beams of all others."""
    # While one cloud is clustered, others are read, turned and written.
    for scan, whole in in_order(_scans(bundles, mounting, config), _points, partial(_clustered, config=config)):
        beams = _beams(scan.bundle, scan.base, mounting, config) if whole is None else None
        yield (scan, whole), beams


def _is_large(look: tuple[_Scan, WholeCloud | None]) -> bool:
    """Whether a scan is a cloud, of which only few fit into the memory."""
    return any(isinstance(look[0].bundle.messages.get(channel), PointCloud2) for channel in (SCAN, SECOND_SCAN))


def _clouds(bundle: Bundle, base: str, mounting: Mounting) -> tuple[tuple[PointCloud2, Array], ...]:
    found = []
    for channel in (SCAN, SECOND_SCAN):
        message = bundle.messages.get(channel)
        if message is None:
            continue
        if not isinstance(message, PointCloud2):
            raise UsageError("a planar scan joins a point cloud as a slice of it only: give --slice ZMIN:ZMAX in m")
        found.append((message, mounting.lookup(bundle, base, message.frame_id)))
    return tuple(found)


def _points(scan: _Scan) -> tuple[Array, Array] | None:
    """The points (N, 3) of a scan's clouds in the base frame, and where the first LiDAR is (2,)."""
    bundle = scan.bundle
    moved = None if bundle.odometry is None else partial(bundle.odometry.base_from_then, bundle.stamp_ns)
    parts = [points_in_base(cloud, bundle.stamp_ns, place, moved) for cloud, place in scan.clouds]
    return (np.concatenate(parts), scan.clouds[0][1][:2, 3]) if parts else None


def _clustered(points: tuple[Array, Array] | None, config: ClusterConfig) -> WholeCloud | None:
    return None if points is None else whole_cloud(*points, config)


def _of_cloud(bundle: Bundle, base: str, tracks: Tracks, found: WholeCloud) -> Iterator[Stamped | Omission]:
    """The points above the ground of a bundle's clouds, and a box around each of their clusters."""
    middles = np.array([one.rectangle.centre_xy for one in found.objects]).reshape(-1, 2)
    names = tracks.names(bundle.stamp_ns, None if bundle.odometry is None else bundle.odometry.odom_from_base, middles)
    cloud = ClusteredCloud(bundle.stamp_ns, base, found.points_m, found.heights_m, found.clusters)
    yield Stamped(SCAN_OBJECTS, bundle.log_time_ns, _boxed(bundle.stamp_ns, base, names, found.objects))
    yield Stamped(CLUSTERED_CLOUD, bundle.log_time_ns, cloud)
    if not len(found.clusters):
        yield Omission(bundle.log_time_ns, _NOTHING_STANDS)


def _base_of(bundle: Bundle, mounting: Mounting) -> str:
    """The base frame, which is the LiDAR's own only if the log says so.

    Raises:
        RecordingError: there are no transforms, and the scan is in no base frame.
    """
    message = bundle.messages[SCAN]
    assert isinstance(message, LaserScan | PointCloud2)  # noqa: S101 - the runner reads no other types as scans
    base = mounting.base(bundle, message.frame_id)
    if base == frames.plain(message.frame_id) and base not in _BASES and TF_STATIC not in bundle.messages:
        raise RecordingError(f"nothing says where the LiDAR ({base}) sits on the robot; {frames.REMEDY}")
    return base


def _beams(bundle: Bundle, base: str, mounting: Mounting, config: ClusterConfig) -> Beams:
    """The beams of a bundle's LiDARs."""
    moved = None if bundle.odometry is None else partial(bundle.odometry.base_from_then, bundle.stamp_ns)
    found = []
    for channel in (SCAN, SECOND_SCAN):
        message = bundle.messages.get(channel)
        if isinstance(message, LaserScan | PointCloud2):
            base_from_lidar = mounting.lookup(bundle, base, message.frame_id)
            found.append(beams_of(message, bundle.stamp_ns, base_from_lidar, moved, config))
    return together(found)


def _unsure(
    bundle: Bundle, base: str, mounting: Mounting, config: ClusterConfig, found: list[Hypotheses]
) -> tuple[list[Hypotheses], bool]:
    """The objects of a bundle's scans, as unsure as these are skewed, and whether that is more than ranges are where
    they could not be de-skewed."""
    scans = [one for one in (_measured(bundle, channel) for channel in (SCAN, SECOND_SCAN)) if one is not None]
    left = [motion_left(one, *_odometry(bundle), config) for one in scans]
    if not (found and np.any(left)):
        return found, False
    places = np.concatenate([one.positions_xy for one in found])
    of_each = []
    for scan, (motion, walk) in zip(scans, left, strict=True):
        times_s = offsets_s(scan, bundle.stamp_ns, mounting.lookup(bundle, base, scan.frame_id), places)
        of_each.append(skew_covariances(places, times_s, motion, walk))
    # Two LiDARs show a thing at two times; the one that costs more counts.
    costs = np.trace(np.array(of_each), axis1=2, axis2=3)
    added = np.take_along_axis(np.array(of_each), costs.argmax(axis=0)[None, :, None, None], axis=0)[0]
    parts = np.split(added, np.cumsum([len(one.positions_xy) for one in found])[:-1])
    unsure = [replace(one, covariances=one.covariances + part) for one, part in zip(found, parts, strict=True)]
    skewed = costs[[motion.any() for motion, _ in left]]
    return unsure, bool(skewed.max(initial=0.0) > config.sigma_m**2)


def _odometry(bundle: Bundle) -> tuple[Array | None, Array]:
    """The base's velocity (3,) at a bundle's stamp, and how odometry walks (3, 3) while its scan is measured."""
    odometry = bundle.odometry
    samples = None if odometry is None else odometry.samples
    walk = np.zeros((3, 3)) if samples is None else random_walk(samples.stamps_ns, samples.odom_from_base)
    return None if odometry is None else odometry.velocity, walk


def _without_returns(bundle: Bundle) -> Iterator[Omission]:
    scans = [_measured(bundle, channel) for channel in (SCAN, SECOND_SCAN)]
    for scan in scans:
        if isinstance(scan, LaserScan) and returns_nothing(scan):
            yield Omission(bundle.log_time_ns, _NOTHING_CAME_BACK)


def _measured(bundle: Bundle, channel: Channel[Message]) -> LaserScan | PointCloud2 | None:
    message = bundle.messages.get(channel)
    return message if isinstance(message, LaserScan | PointCloud2) else None


def _as_in_the_thesis(bundles: Iterable[Bundle], mounting: Mounting) -> Iterator[Stamped | Omission]:
    for bundle in bundles:
        scan = bundle.messages[SCAN]
        if not isinstance(scan, LaserScan):
            raise UsageError("the thesis's method needs a LaserScan; choose it with --scan, or take the default method")
        base = _base_of(bundle, mounting)
        base_from_lidar = mounting.lookup(bundle, base, scan.frame_id)
        check_level(scan.frame_id, base_from_lidar)
        filtered, found = thesis.scan_objects(scan, bundle.stamp_ns, base, base_from_lidar)
        yield Stamped(SCAN_FILTERED, bundle.log_time_ns, filtered)
        yield Stamped(SCAN_OBJECTS, bundle.log_time_ns, found)
        yield from _without_returns(bundle)


def _message(stamp_ns: int, base: str, names: tuple[str, ...], found: Sequence[Hypotheses]) -> ScanObjects:
    return ScanObjects(
        stamp_ns,
        base,
        names,
        tuple(tuple(zip(one.names, one.shares.tolist(), strict=True)) for one in found),
        tuple(one.positions_xy for one in found),
        tuple(one.covariances for one in found),
        np.array([one.extent_m for one in found], dtype=np.float64),
    )


def _boxed(stamp_ns: int, base: str, names: tuple[str, ...], found: Sequence[CloudObject]) -> ScanObjects:
    """Objects that could be anything, each in a box."""
    return ScanObjects(
        stamp_ns,
        base,
        names,
        ((("", 1.0),),) * len(found),
        tuple(one.rectangle.centre_xy[None] for one in found),
        tuple(one.rectangle.covariance[None] for one in found),
        np.array([one.rectangle.length_m for one in found], dtype=np.float64),
        Boxes(
            np.array([[*one.rectangle.centre_xy, (one.foot_m + one.top_m) / 2] for one in found]).reshape(-1, 3),
            np.array(
                [[one.rectangle.length_m, one.rectangle.width_m, one.top_m - one.foot_m] for one in found]
            ).reshape(-1, 3),
            np.array([one.rectangle.yaw_rad for one in found], dtype=np.float64),
        ),
    )


STAGE = Stage(
    "cluster",
    reads=(SCAN, SECOND_SCAN, ODOMETRY, TF_STATIC),
    writes=(SCAN_OBJECTS, CLUSTERED_CLOUD, SCAN_FILTERED),
    config=ClusterConfig,
    process=process,
    options=("extrinsics",),
    tolerance={
        "position_m": 1e-3,
        "others.position_m": 1e-3,
        "covariance": 1e-3,
        "others.covariance": 1e-3,
        "score": 1e-2,
        "others.score": 1e-2,
        "size_m": 2e-6,
        "box_offset_m": 1e-3,
    },
)
