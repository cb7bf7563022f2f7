"""Pictures of a drive for a video: the image with its boxes beside the map, and below in words what is known."""

from collections import Counter
from dataclasses import dataclass, replace

import cv2
import numpy as np

from mcap_landmarks.errors import MessageError
from mcap_landmarks.evaluation.metrics import Reference, RunResult
from mcap_landmarks.evaluation.trajectory import Trajectory, interpolated
from mcap_landmarks.geometry.angles import wrap
from mcap_landmarks.geometry.se2 import Array, transform_points
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.match import LandmarkMatch, Status
from mcap_landmarks.messages.scene import SceneObjects
from mcap_landmarks.moments import moment
from mcap_landmarks.report.box_pictures import with_boxes
from mcap_landmarks.report.captions import FAINT, INK, Colour, write_lines
from mcap_landmarks.report.drive_moments import Moment
from mcap_landmarks.report.map_canvas import ESTIMATE, OBJECT, SCAN, STALE, TRUTH, MapCanvas, segments
from mcap_landmarks.vision.pixels import Rgb, rgb_from_message

_GOOD, _UNSURE, _NOTHING = (4, 120, 87), (180, 83, 9), (107, 114, 128)
_PAUSE_NS = 2 * 10**9
"""Poses farther apart are not joined by a line."""
_STALE_NS = 10**9
"""A pose that is older than this is drawn in grey."""
_AROUND_M = 8.0
"""So far around the robot is shown where the log has no place in a map."""
_AHEAD = np.array([0.0, 0.0, np.pi / 2])
"""The robot's pose in that picture: it looks up."""
_GAP_NS = 5 * 10**8
"""The truth is interpolated over gaps up to this, as `evaluate` does by default."""


@dataclass(slots=True)
class DrivePictures:
    """Draws moments of a drive into pictures of `size` W, H pixels; made by `of`."""

    size: tuple[int, int]
    canvas: MapCanvas
    landmarks: SceneObjects | None
    truth: Trajectory | None
    in_map: bool
    split: int
    first_ns: int | None = None
    _trail: Rgb | None = None
    _drawn: int = 0
    _truth_drawn: int = 0
    _image: tuple[tuple[int, int], Rgb] | None = None

    @classmethod
    def of(cls, result: RunResult, reference: Reference, size: tuple[int, int], *, has_image: bool) -> "DrivePictures":
        """Pictures of a result and its truth; without poses and a map they show what is around the robot."""
        landmarks = result.drawn if result.landmarks is None else result.landmarks
        in_map = landmarks is not None or len(result.trajectory) > 0
        truth = reference.trajectory if in_map else None
        split = size[0] // 2 if has_image else 0
        spots = [result.trajectory.poses[:, :2], np.zeros((0, 2)) if truth is None else truth.poses[:, :2]]
        if not in_map:
            spots = [np.array([[-_AROUND_M, -_AROUND_M], [_AROUND_M, _AROUND_M]])]
        below = 0 if has_image else size[1] // 4
        title = "Map [m]" if in_map else "Around the robot [m]"
        moving = {"scan": (SCAN, "."), "object in it": (OBJECT, "o")}
        if in_map:
            moving |= {"estimate": (ESTIMATE, "-"), **({} if truth is None else {"truth": (TRUTH, "-")})}
        canvas = MapCanvas.of(landmarks, np.vstack(spots), (size[0] - split, size[1] - below), title, moving)
        return cls(size, canvas, landmarks, truth, in_map, split)

    def draw(self, now: Moment) -> Rgb:
        """The picture of a moment; moments must come in the order of time."""
        self.first_ns = now.time_ns if self.first_ns is None else self.first_ns
        picture = np.full((self.size[1], self.size[0], 3), 255, np.uint8)
        map_height, map_width, _ = self.canvas.background.shape
        picture[:map_height, self.split : self.split + map_width] = self._map(now)
        top = 0 if self.split else map_height
        if self.split:
            image = self._with_boxes(now)
            picture[: image.shape[0], : image.shape[1]] = image
            top = self._image_height()
        width = self.split or self.size[0]
        picture[top:, :width] = self._words(now, (width, self.size[1] - top))
        return picture

    def _image_height(self) -> int:
        return self.size[1] * 2 // 3

    def _with_boxes(self, now: Moment) -> Rgb:
        """The image, scaled into its place and centred there, with the boxes that are of it."""
        found = now.detections if now.image is not None and _of_image(now.detections, now.image.stamp_ns) else None
        key = (0 if now.image is None else now.image.stamp_ns or id(now.image), 0 if found is None else found.stamp_ns)
        if self._image is None or self._image[0] != key:
            self._image = key, self._image_in_place(now, found)
        return self._image[1]

    def _image_in_place(self, now: Moment, found: Detections | None) -> Rgb:
        place = np.full((self._image_height(), self.split, 3), 24, np.uint8)
        try:
            rgb = None if now.image is None else rgb_from_message(now.image)
        except MessageError:
            rgb = None
        if rgb is None:
            return place
        scale = min(place.shape[1] / rgb.shape[1], place.shape[0] / rgb.shape[0])
        width, height = round(rgb.shape[1] * scale), round(rgb.shape[0] * scale)
        way = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
        scaled = np.asarray(cv2.resize(rgb, (width, height), interpolation=way), np.uint8)
        if found is not None and len(found):
            scaled = with_boxes(scaled, replace(found, boxes_xyxy=found.boxes_xyxy * scale))
        left, top = (place.shape[1] - width) // 2, (place.shape[0] - height) // 2
        place[top : top + height, left : left + width] = scaled
        return place

    def _map(self, now: Moment) -> Rgb:
        picture = self._trails(now).copy()
        pose = now.pose if self.in_map else _AHEAD
        if pose is None:
            return picture
        is_stale = self.in_map and now.time_ns - now.pose_ns > _STALE_NS
        if np.isfinite(pose).all() and not is_stale:
            self._sensed(picture, now, pose)
        if now.covariance is not None and np.isfinite(now.covariance).all() and not is_stale:
            self.canvas.ellipse(picture, pose[:2], now.covariance[:2, :2], ESTIMATE)
        true = self._true_pose(now.time_ns)
        if true is not None:
            self.canvas.robot(picture, true, TRUTH, 10.0)
        self.canvas.robot(picture, pose, STALE if is_stale else ESTIMATE)
        return picture

    def _sensed(self, picture: Rgb, now: Moment, pose: Array) -> None:
        """The scan, the objects in it, and lines to the landmarks that they are, as seen from the pose."""
        is_now = not self.in_map or now.points_ns == now.pose_ns
        if is_now and len(now.points_xy):
            self.canvas.dots(picture, transform_points(pose, now.points_xy), SCAN, 1.7)
        scene = now.scene
        if scene is not None and len(scene) and (not self.in_map or scene.stamp_ns == now.pose_ns):
            seen = transform_points(pose, scene.positions_xy)
            for place in self._matched(now.match, now.pose_ns):
                self.canvas.line(picture, np.stack([pose[:2], place]), (250, 190, 140), 1)
            self.canvas.dots(picture, seen, OBJECT, 8.0, filled=False)

    def _matched(self, match: LandmarkMatch | None, stamp_ns: int) -> Array:
        """Where the landmarks are that a bundle was matched with (K, 2)."""
        if match is None or self.landmarks is None or match.stamp_ns != stamp_ns:
            return np.zeros((0, 2))
        rows = [self.landmarks.ids.index(name) for name in match.landmark_ids if name in self.landmarks.ids]
        found: Array = self.landmarks.positions_xy[rows]
        return found

    def _trails(self, now: Moment) -> Rgb:
        """The background with the paths so far; only what is new is drawn."""
        if self._trail is None:
            self._trail = self.canvas.background.copy()
        if self.truth is not None:
            known = int(np.searchsorted(self.truth.time_ns, now.time_ns, side="right"))
            rows = range(
                max(self._truth_drawn - 1, int(np.searchsorted(self.truth.time_ns, self.first_ns or 0))), known
            )
            steps = [(int(self.truth.time_ns[i]), *self.truth.poses[i, :2].tolist()) for i in rows]
            self._add(steps, TRUTH, 1)
            self._truth_drawn = max(known, self._truth_drawn)
        if self.in_map:
            self._add(now.path[max(self._drawn - 1, 0) :], ESTIMATE, 2)
            self._drawn = len(now.path)
        return self._trail

    def _add(self, steps: list[tuple[int, float, float]], colour: Colour, width: int) -> None:
        assert self._trail is not None  # noqa: S101 - its caller made it
        for piece in segments(steps, _PAUSE_NS):
            self.canvas.line(self._trail, piece, colour, width)

    def _true_pose(self, time_ns: int) -> Array | None:
        if self.truth is None:
            return None
        asked = Trajectory.of(np.array([time_ns]), np.zeros((1, 3)))
        found = interpolated(asked, self.truth, _GAP_NS).reference
        return found[0] if len(found) else None

    def _words(self, now: Moment, size: tuple[int, int]) -> Rgb:
        small = max(round(size[1] * 0.075), 9)
        seconds = (now.time_ns - (self.first_ns or 0)) / 1e9
        lines = [(text, small, INK, False) for text in self._told(now)]
        lines.append((f"{seconds:.1f} s, {moment(now.time_ns)[:21]}Z", small, FAINT, False))
        return write_lines(size, lines, _badge(now) if self.in_map else None)

    def _told(self, now: Moment) -> list[str]:
        """Where the robot is, how sure and how far off, and what it was recognised by."""
        pose, lines = now.pose, list[str]()
        if not self.in_map or pose is None:
            return [] if not self.in_map else ["no pose yet"]
        heading = f", heading {np.degrees(pose[2]):.0f}°" if np.isfinite(pose[2]) else ""
        lines.append(f"x {pose[0]:.2f} m, y {pose[1]:.2f} m{heading}")
        if now.covariance is not None and np.isfinite(now.covariance).all():
            sigma_m = np.sqrt(np.maximum(np.diag(now.covariance)[:2], 0))
            lines.append(f"standard deviation {100 * sigma_m[0]:.1f} cm in x, {100 * sigma_m[1]:.1f} cm in y")
        true = self._true_pose(now.pose_ns)
        if true is not None:
            off = f"{100 * np.hypot(*(pose - true)[:2]):.1f} cm"
            turned = f", {abs(np.degrees(wrap(pose[2] - true[2]))):.1f}°" if np.isfinite(pose[2]) else ""
            lines.append(f"off the truth by {off}{turned}")
        names = self._names(now)
        return [*lines, f"recognised: {names}"] if names else lines

    def _names(self, now: Moment) -> str:
        if now.match is None or self.landmarks is None or now.match.stamp_ns != now.pose_ns:
            return ""
        classes = dict(zip(self.landmarks.ids, self.landmarks.classes, strict=True))
        counts = Counter(classes[name] for name in now.match.landmark_ids if name in classes)
        return ", ".join(f"{count} x {name}" for name, count in sorted(counts.items()))


def _of_image(detections: Detections | None, stamp_ns: int) -> bool:
    return detections is not None and detections.stamp_ns == stamp_ns


def _badge(now: Moment) -> tuple[str, Colour]:
    """The status of the last bundle in words; of the path of a map that it is one."""
    if now.match is not None:
        words = now.match.status.name.lower().replace("_", " ")
        return words, _GOOD if now.match.status is Status.LOCALIZED else _UNSURE
    return ("pose of the map", _GOOD) if now.pose is not None else ("no pose", _NOTHING)
