"""Objects of a scan by Algorithm 2 of the thesis."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from mcap_landmarks.channels import SCAN, SCAN_FILTERED, SCAN_OBJECTS
from mcap_landmarks.errors import UsageError
from mcap_landmarks.geometry import frames
from mcap_landmarks.lidar import thesis
from mcap_landmarks.lidar.beams import echoes
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.mounting import Mounting
from mcap_landmarks.stage import Bundle, Stamped
from mcap_landmarks.stages._cluster_beams import base_of


def objects_as_in_the_thesis(bundles: Iterable[Bundle], mounting: Mounting) -> Iterator[Stamped]:
    """The filtered scan, and the near surface at every object's middle beam; nobody knows what it is or how exactly.

    Raises:
        RecordingError: it is not known where the LiDAR sits.
        UsageError: a point cloud, of which the thesis has none.
    """
    for bundle in bundles:
        scan = bundle.messages[SCAN]
        if not isinstance(scan, LaserScan):
            raise UsageError("the thesis's method needs a LaserScan; choose it with --scan, or take the default method")
        base = base_of(bundle, mounting)
        base_from_lidar = mounting.lookup(bundle, base, scan.frame_id)
        filtered = thesis.filter_view(echoes(scan.ranges_m, scan.range_min_m, scan.range_max_m))
        beams = thesis.middle_beams(thesis.binary(filtered))
        local = thesis.places(filtered, beams)
        points = frames.apply(base_from_lidar, np.column_stack([local, np.zeros(len(local))]))[:, :2]
        shown = replace(scan, ranges_m=filtered.astype(np.float32), intensities=np.zeros(0, np.float32))
        yield Stamped(SCAN_FILTERED, bundle.log_time_ns, shown)
        message = ScanObjects(
            bundle.stamp_ns,
            base,
            tuple(str(beam) for beam in beams.tolist()),
            ((("", 1.0),),) * len(beams),
            tuple(point[None] for point in points),
            (np.zeros((1, 2, 2)),) * len(beams),
            np.zeros(len(beams)),
        )
        yield Stamped(SCAN_OBJECTS, bundle.log_time_ns, message)
