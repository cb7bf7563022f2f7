"""Turn LiDAR scans into objects: where the centre of each one is, for every class that it could be."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
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
from mcap_landmarks.geometry import frames
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.lidar import thesis
from mcap_landmarks.lidar.beams import Beams, together
from mcap_landmarks.lidar.clustering import cluster, shapes_of
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.object_tracks import PieceChange, Tracks
from mcap_landmarks.lidar.objects import Hypotheses
from mcap_landmarks.lidar.scan_beams import beams_of
from mcap_landmarks.lidar.whole_clouds import CloudObject, WholeCloud, points_in_base, whole_cloud
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.boxes import Boxes
from mcap_landmarks.messages.clustered_cloud import ClusteredCloud
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.mounting import Mounting
from mcap_landmarks.stage import Bundle, Omission, Stage, Stamped
from mcap_landmarks.vision.prefetch import in_order

_BASES = (BASE_FRAME, "base_link")
_NOTHING_STANDS = "clouds in which nothing stands on the ground"


def process(
    bundles: Iterable[Bundle], config: ClusterConfig, resources: Mapping[str, Location]
) -> Iterator[Stamped | Omission]:
    """The objects of every scan, none for a scan that shows none; a scan without directions is an omission.

    Raises:
        RecordingError: it is not known where the LiDAR sits.
        UsageError: a point cloud beside a planar scan, and no heights to cut it at, or with the thesis's method, which
            has none.
    """
    mounting = Mounting(resources.get("extrinsics"))
    if config.method == "thesis":
        yield from _as_in_the_thesis(bundles, mounting)
        return
    shapes = shapes_of(config)
    tracks, anew = Tracks(config.gate_m, config.memory_s), PieceChange()
    # While one cloud is clustered, others are read, turned and written.
    for scan, whole in in_order(_scans(bundles, mounting, config), _points, partial(_clustered, config=config)):
        bundle, base = scan.bundle, scan.base
        if anew.at(bundle.odometry.piece if bundle.odometry else None):
            tracks.forget()
        if whole is not None:
            yield from _of_cloud(bundle, base, tracks, whole)
            if not len(whole.clusters):
                yield Omission(bundle.log_time_ns, _NOTHING_STANDS)
            continue
        beams = _beams(bundle, base, mounting, config)
        if beams is None:
            yield Omission(bundle.log_time_ns, "a scan does not say in which directions its beams are", lost=True)
            continue
        found = cluster(beams, shapes, config)
        places = np.array([one.shares @ one.positions_xy for one in found]).reshape(-1, 2)
        odom_from_base = None if bundle.odometry is None else bundle.odometry.odom_from_base
        names = tracks.names(bundle.stamp_ns, odom_from_base, places)
        yield Stamped(SCAN_OBJECTS, bundle.log_time_ns, _message(bundle.stamp_ns, base, names, found))


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


def _of_cloud(bundle: Bundle, base: str, tracks: Tracks, found: WholeCloud) -> Iterator[Stamped]:
    """The points above the ground of a bundle's clouds, and a box around each of their clusters."""
    middles = np.array([one.rectangle.centre_xy for one in found.objects]).reshape(-1, 2)
    names = tracks.names(bundle.stamp_ns, None if bundle.odometry is None else bundle.odometry.odom_from_base, middles)
    cloud = ClusteredCloud(bundle.stamp_ns, base, found.points_m, found.heights_m, found.clusters)
    yield Stamped(SCAN_OBJECTS, bundle.log_time_ns, _boxed(bundle.stamp_ns, base, names, found.objects))
    yield Stamped(CLUSTERED_CLOUD, bundle.log_time_ns, cloud)


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


def _beams(bundle: Bundle, base: str, mounting: Mounting, config: ClusterConfig) -> Beams | None:
    """The beams of a bundle's LiDARs, None if none of them makes sense."""
    moved = None if bundle.odometry is None else partial(bundle.odometry.base_from_then, bundle.stamp_ns)
    found = []
    for channel in (SCAN, SECOND_SCAN):
        message = bundle.messages.get(channel)
        if isinstance(message, LaserScan | PointCloud2):
            base_from_lidar = mounting.lookup(bundle, base, message.frame_id)
            found.append(beams_of(message, bundle.stamp_ns, base_from_lidar, moved, config))
    usable = [beams for beams in found if beams is not None]
    return together(usable) if usable else None


def _as_in_the_thesis(bundles: Iterable[Bundle], mounting: Mounting) -> Iterator[Stamped]:
    for bundle in bundles:
        scan = bundle.messages[SCAN]
        if not isinstance(scan, LaserScan):
            raise UsageError("the thesis's method needs a LaserScan; choose it with --scan, or take the default method")
        base = _base_of(bundle, mounting)
        filtered, found = thesis.scan_objects(scan, bundle.stamp_ns, base, mounting.lookup(bundle, base, scan.frame_id))
        yield Stamped(SCAN_FILTERED, bundle.log_time_ns, filtered)
        yield Stamped(SCAN_OBJECTS, bundle.log_time_ns, found)


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
