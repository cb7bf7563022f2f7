"""Turn LiDAR scans into objects: where the centre of each one is, for every class that it could be."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from mcap_landmarks.channels import BASE_FRAME, ODOMETRY, SCAN, SCAN_FILTERED, SCAN_OBJECTS, SECOND_SCAN, TF_STATIC
from mcap_landmarks.errors import RecordingError, UsageError
from mcap_landmarks.geometry import frames
from mcap_landmarks.lidar import thesis
from mcap_landmarks.lidar.beams import Beams, together
from mcap_landmarks.lidar.clustering import cluster, shapes_of
from mcap_landmarks.lidar.config import ClusterConfig
from mcap_landmarks.lidar.object_tracks import Tracks
from mcap_landmarks.lidar.objects import Hypotheses
from mcap_landmarks.lidar.scan_beams import beams_of
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.points import PointCloud2
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.mounting import Mounting
from mcap_landmarks.stage import Bundle, Omission, Stage, Stamped

_BASES = (BASE_FRAME, "base_link")


def process(
    bundles: Iterable[Bundle], config: ClusterConfig, resources: Mapping[str, Location]
) -> Iterator[Stamped | Omission]:
    """The objects of every scan, none for a scan that shows none; a scan without directions is an omission.

    Raises:
        RecordingError: it is not known where the LiDAR sits.
        UsageError: a point cloud, and no heights to cut it at, or the thesis's method, which has none.
    """
    mounting = Mounting(resources.get("extrinsics"))
    if config.method == "thesis":
        yield from _as_in_the_thesis(bundles, mounting)
        return
    shapes = shapes_of(config)
    tracks = Tracks(config.gate_m, config.memory_s)
    for bundle in bundles:
        base = _base_of(bundle, mounting)
        beams = _beams(bundle, base, mounting, config)
        if beams is None:
            yield Omission(bundle.log_time_ns, "a scan does not say in which directions its beams are", lost=True)
            continue
        found = cluster(beams, shapes, config)
        places = np.array([one.shares @ one.positions_xy for one in found]).reshape(-1, 2)
        odom_from_base = None if bundle.odometry is None else bundle.odometry.odom_from_base
        names = tracks.names(bundle.stamp_ns, odom_from_base, places)
        yield Stamped(SCAN_OBJECTS, bundle.log_time_ns, _message(bundle.stamp_ns, base, names, found))


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


STAGE = Stage(
    "cluster",
    reads=(SCAN, SECOND_SCAN, ODOMETRY, TF_STATIC),
    writes=(SCAN_OBJECTS, SCAN_FILTERED),
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
