"""Turn LiDAR scans into objects: where the centre of each one is, for every class that it could be."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from mcap_landmarks.channels import ODOMETRY, SCAN, SCAN_FILTERED, SCAN_OBJECTS, SECOND_SCAN, TF_STATIC
from mcap_landmarks.lidar.beams import Beams
from mcap_landmarks.lidar.cells import Noise
from mcap_landmarks.lidar.object_tracks import Tracks
from mcap_landmarks.lidar.objects import Hypotheses, objects
from mcap_landmarks.lidar.segments import Breaks, near_clusters, segments
from mcap_landmarks.lidar.shapes import Shape
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.mounting import Mounting
from mcap_landmarks.stage import Bundle, Omission, Stage, Stamped
from mcap_landmarks.stages._cluster_beams import base_of, beams_of
from mcap_landmarks.stages._cluster_config import ClusterConfig
from mcap_landmarks.stages._cluster_thesis import objects_as_in_the_thesis

Shapes = Mapping[str, Sequence[Shape]]

_WITHOUT_SHAPES_M = 1.0


def process(
    bundles: Iterable[Bundle], config: ClusterConfig, resources: Mapping[str, Path]
) -> Iterator[Stamped | Omission]:
    """The objects of every scan, none for a scan that shows none; a scan without directions is an omission.

    Raises:
        RecordingError: it is not known where the LiDAR sits.
        UsageError: a point cloud, and no heights to cut it at.
    """
    mounting = Mounting(resources.get("extrinsics"))
    if config.method == "thesis":
        yield from objects_as_in_the_thesis(bundles, mounting)
        return
    shapes = shapes_of(config)
    tracks = Tracks(config.gate_m, config.memory_s)
    for bundle in bundles:
        base = base_of(bundle, mounting)
        beams = beams_of(bundle, base, mounting, config)
        if beams is None:
            yield Omission(bundle.log_time_ns, "a scan does not say in which directions its beams are", lost=True)
            continue
        found = cluster(beams, shapes, config)
        places = np.array([one.shares @ one.positions_xy for one in found]).reshape(-1, 2)
        odom_from_base = None if bundle.odometry is None else bundle.odometry.odom_from_base
        names = tracks.names(bundle.stamp_ns, odom_from_base, places)
        yield Stamped(SCAN_OBJECTS, bundle.log_time_ns, _message(bundle.stamp_ns, base, names, found))


def shapes_of(config: ClusterConfig) -> Shapes:
    """The shapes of every class that has any."""
    return {name: tuple(one.shape() for one in options) for name, options in config.shapes.items() if options}


def cluster(beams: Beams, shapes: Shapes, config: ClusterConfig) -> list[Hypotheses]:
    """The objects of one scan, in the base frame; `shapes` are those of the configuration."""
    reach = max((shape.reach_m for options in shapes.values() for shape in options), default=_WITHOUT_SHAPES_M)
    largest = 2 * reach + 6 * config.sigma_m if config.largest_m is None else config.largest_m
    breaks = Breaks(np.deg2rad(config.incidence_deg), config.sigma_m, config.link_m)
    noise = Noise(config.sigma_m, config.dropout, config.stray)
    return objects(beams, near_clusters(beams, segments(beams, breaks, largest), config.near_m), shapes, noise)


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
