"""The default fusion: detections assigned to tracks in the scan, each of which keeps the class it has earned."""

from mcap_landmarks.fusion.box_association import assign, candidates, hit_ratio
from mcap_landmarks.fusion.box_geometry import box_geometry
from mcap_landmarks.fusion.camera_view import CameraView
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.inheritance import inherit
from mcap_landmarks.fusion.redundancy import RedundancyCheck
from mcap_landmarks.fusion.scene_building import scene_of
from mcap_landmarks.fusion.track_history import observe
from mcap_landmarks.fusion.tracks import STALE, TrackTable
from mcap_landmarks.fusion.visibility import is_missed, nearness_of
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects


class Fuser:
    """Fuses scan after scan. Its state is what each track in the scan has been taken for so far."""

    def __init__(self, config: FuseConfig) -> None:
        self._tracks = TrackTable(config)
        self._redundancy = RedundancyCheck(self._tracks)

    def add(
        self, objects: ScanObjects, detections: Detections | None, view: CameraView | None, odometry: Array | None
    ) -> tuple[SceneObjects, int]:
        """The scene at a scan, with what an image beside it shows; also the number of boxes that nothing explains.

        `odometry` is odom_from_base (3,); without it nothing is known of a track but what its own id carries on.
        """
        unexplained = 0
        if detections is None or odometry is None:
            self._redundancy.between_images(objects.ids)
        self._tracks.see(objects, alone=odometry is None)
        if odometry is not None:
            inherit(self._tracks, objects, odometry)
        if detections is not None and view is not None:
            unexplained = self._learn(objects, detections, view, odometry)
        if odometry is not None:
            self._tracks.place(objects, odometry)
            if detections is not None:
                self._redundancy.at_image(objects.ids, objects.stamp_ns)
        return scene_of(objects, self._tracks), unexplained

    def _learn(self, objects: ScanObjects, detections: Detections, view: CameraView, odometry: Array | None) -> int:
        """Tell the tracks what an image shows of them, and does not; returns the number of boxes that none explains."""
        tracks, heading_rad = self._tracks, 0.0 if odometry is None else float(odometry[2])
        boxes = box_geometry(view, detections.boxes_xyxy, tracks.config)
        names = [options[0][0] for options in detections.hypotheses]
        found = candidates(objects, tracks, view, boxes, names)
        pairs = assign(found.odds)
        for box, i in pairs:
            name, score = detections.hypotheses[box][0]
            track = tracks[objects.ids[i]]
            fresh = track.freshness(objects.positions_xy[i][-1], heading_rad)
            track.belief.hit(name, hit_ratio(found, pairs, (box, i), score), float(found.aside[box, i]), fresh)
            if odometry is not None and fresh > STALE:
                size = tracks.config.size(name)
                track.history.note(observe(tracks.bundle, name, box, boxes, view, odometry, size))
            if not boxes.cut[box, [0, 2]].any():
                track.belief.measure(name, float(found.radii_m[box, i]))
        nearness = nearness_of(objects, pairs, view, boxes, names, tracks.config)
        for i in sorted({*range(len(objects))} - {i for _, i in pairs}):
            track = tracks[objects.ids[i]]
            if track.belief.log_odds and is_missed(objects, i, tracks, view, boxes, nearness):
                track.belief.miss(track.freshness(objects.positions_xy[i][-1], heading_rad))
        return len(detections) - len(pairs)
