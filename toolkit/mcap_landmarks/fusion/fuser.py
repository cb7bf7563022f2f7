"""The default fusion: detections assigned to tracks in the scan, each of which keeps the class it has earned."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from mcap_landmarks.fusion.box_association import BoxCandidates, Pair, assign, candidates, hit_ratio
from mcap_landmarks.fusion.box_geometry import BoxGeometry, box_geometry
from mcap_landmarks.fusion.camera_view import SeenImage
from mcap_landmarks.fusion.config import FuseConfig
from mcap_landmarks.fusion.inheritance import inherit
from mcap_landmarks.fusion.redundancy import RedundancyCheck
from mcap_landmarks.fusion.scene_building import scene_of
from mcap_landmarks.fusion.track_history import observe
from mcap_landmarks.fusion.tracks import STALE, TrackTable
from mcap_landmarks.fusion.visibility import is_missed, nearness_of
from mcap_landmarks.geometry.se2 import Array
from mcap_landmarks.messages.scan_objects import ScanObjects
from mcap_landmarks.messages.scene import SceneObjects


class Fuser:
    """Fuses scan after scan. Its state is what each track in the scan has been taken for so far."""

    def __init__(self, config: FuseConfig) -> None:
        self._tracks = TrackTable(config)
        self._redundancy = RedundancyCheck(self._tracks)

    def add(
        self, objects: ScanObjects, images: Sequence[SeenImage], odometry: Array | None
    ) -> tuple[SceneObjects, int]:
        """The scene at a scan, with what the images beside it show; also the number of boxes that nothing explains.

        There is one image of each camera at most. `odometry` is odom_from_base (3,); without it nothing is known of a
        track but what its own id carries on.
        """
        if not images or odometry is None:
            self._redundancy.between_images(objects.ids)
        self._tracks.see(objects, alone=odometry is None)
        if odometry is not None:
            inherit(self._tracks, objects, odometry)
        unexplained = self._learn(objects, images, odometry)
        if odometry is not None:
            self._tracks.place(objects, odometry)
            if images:
                self._redundancy.at_image(objects.ids, objects.stamp_ns)
        return scene_of(objects, self._tracks), unexplained

    def _learn(self, objects: ScanObjects, images: Sequence[SeenImage], odometry: Array | None) -> int:
        """Tell the tracks what images show of them, and do not; returns the number of boxes that none explains.

        What one camera shows counts before what another one does not, and the second look from the same place little.
        """
        tracks = self._tracks
        looks = [_Look.at(image, objects, tracks) for image in images]
        shown = [(look.ratio(pair), look, pair) for look in looks for pair in look.pairs]
        for ratio, look, (box, i) in sorted(shown, key=lambda one: -one[0]):
            name, track = look.names[box], tracks[objects.ids[i]]
            fresh = self._freshness(objects, i, odometry)
            track.belief.hit(name, ratio, float(look.found.aside[box, i]), fresh)
            if odometry is not None and fresh > STALE:
                size = tracks.config.size(name)
                seen = observe(tracks.bundle, name, box, look.boxes, look.image.view, odometry, size)
                track.history.note(replace(seen, frame_id=look.image.detections.frame_id))
            if not look.boxes.cut[box, [0, 2]].any():
                track.belief.measure(name, float(look.found.radii_m[box, i]))
        for look in looks:
            for i in look.missed(objects, tracks):
                tracks[objects.ids[i]].belief.miss(self._freshness(objects, i, odometry))
        return sum(len(look.names) - len(look.pairs) for look in looks)

    def _freshness(self, objects: ScanObjects, i: int, odometry: Array | None) -> float:
        heading_rad = 0.0 if odometry is None else float(odometry[2])
        return self._tracks[objects.ids[i]].freshness(objects.positions_xy[i][-1], heading_rad)


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    """An image and which of its boxes are of which objects of the scan, by what was believed of them before it."""

    image: SeenImage
    boxes: BoxGeometry
    names: list[str]
    found: BoxCandidates
    pairs: list[Pair]

    @classmethod
    def at(cls, image: SeenImage, objects: ScanObjects, tracks: TrackTable) -> Self:
        """What an image shows of a scan."""
        boxes = box_geometry(image.view, image.detections.boxes_xyxy, tracks.config)
        names = [options[0][0] for options in image.detections.hypotheses]
        found = candidates(objects, tracks, image.view, boxes, names)
        return cls(image, boxes, names, found, assign(found.odds))

    def ratio(self, pair: Pair) -> float:
        """How much likelier a box is if it is of its object than if not."""
        return hit_ratio(self.found, self.pairs, pair, self.image.detections.hypotheses[pair[0]][0][1])

    def missed(self, objects: ScanObjects, tracks: TrackTable) -> list[int]:
        """The objects of a known class that the image would show and has no box of."""
        nearness = nearness_of(objects, self.pairs, self.image.view, self.boxes, self.names, tracks.config)
        others = sorted({*range(len(objects))} - {i for _, i in self.pairs})
        known = [i for i in others if tracks[objects.ids[i]].belief.log_odds]
        return [i for i in known if is_missed(objects, i, tracks, self.image.view, self.boxes, nearness)]
