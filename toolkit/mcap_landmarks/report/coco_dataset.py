"""Boxes of a log as a dataset in COCO's format (Lin et al. 2014): images, annotations, categories.

Images and categories have the same numbers whichever boxes are written, so that those of the truth and those of a
detector can be held against each other with COCO's own tools.
"""

import contextlib
import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from mcap_landmarks.channels import DETECTIONS, TRUTH_DETECTIONS
from mcap_landmarks.coco import NAMES
from mcap_landmarks.errors import MessageError, RecordingError, UsageError
from mcap_landmarks.geometry.frames import plain
from mcap_landmarks.inspection.cameras import IMAGES
from mcap_landmarks.inspection.topic_roles import Choice
from mcap_landmarks.locations import Location
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.images import CompressedImage, Image
from mcap_landmarks.progress import Progress
from mcap_landmarks.recording.layered_log import Layer, LayeredLog
from mcap_landmarks.recording.reader import Recording, open_recording
from mcap_landmarks.report.viewed_log import ViewedLog
from mcap_landmarks.runs.bundles import Span
from mcap_landmarks.runs.recorded_log import RecordedLog
from mcap_landmarks.stage import Connection
from mcap_landmarks.vision.image_size import image_size
from mcap_landmarks.vision.pixels import rgb_from_message

Entry = dict[str, object]
_NO_NUMBERS = frozenset({12, 26, 29, 30, 45, 66, 68, 69, 71, 83})
"""Numbers between 1 and 90 that no category of COCO 2017 has."""
_NUMBERS = [number for number in range(1, 91) if number not in _NO_NUMBERS]
_FIRST_OTHER = 1001
"""Classes that COCO does not have count from here on."""
_JPEG, _PNG = b"\xff\xd8", b"\x89PNG"


@dataclass(frozen=True, slots=True)
class CocoDataset:
    """The document, how many entries it has by kind, the topic of its boxes, why boxes or images are left out, and what
    could not be read.
    """

    document: Mapping[str, object]
    counts: Mapping[str, int]
    topic: str
    left_out: Mapping[str, int]
    losses: tuple[str, ...]


def read_coco(
    path: Location, topic: str | None, folder: Path | None, progress: Progress, about: str = ""
) -> CocoDataset:
    """The boxes of a topic, by default those of `detect`, else the truth; the images are written into `folder`, too.

    The document says `about` itself.

    Raises:
        UsageError: the topic has no boxes.
        RecordingError: the log cannot be read, or has no images or no boxes.
    """
    with open_recording(path) as recording:
        view = ViewedLog(recording)
        boxes = _boxes(recording, view, topic)
        images = [camera.image.topic for camera in view.cameras]
        if not images:
            raise RecordingError(f"{path}: has no images, of which COCO wants the sizes; name a log with its images")
        choice = Choice({"image": images[0]}) if len(images) == 1 else Choice(images=tuple(images))
        log = RecordedLog(recording, Span(choice)).layered([Layer(recording, recording.channels)])
        left_out = Counter[str]()
        entries, numbers = _numbered(_decoded(log, images, left_out, progress), folder)
        categories = _categories(recording, view)
        annotations = _annotations(recording, boxes, (entries, numbers), categories, left_out)
        document: dict[str, object] = {
            "info": {"description": about},
            "images": entries,
            "annotations": annotations,
            "categories": [{"id": number, "name": name} for name, number in categories.items()],
        }
        counts = {"images": len(entries), "annotations": len(annotations), "categories": len(categories)}
        return CocoDataset(document, counts, boxes.topic, left_out, tuple(log.losses))


def images_of(place: Location) -> frozenset[str]:
    """The names of the images' files in a document that `read_coco` made; none where it is damaged."""
    with contextlib.suppress(ValueError, KeyError, TypeError), place.open("rb") as stream:
        return frozenset(str(entry["file_name"]) for entry in json.load(stream)["images"])
    return frozenset()


def _boxes(recording: Recording, view: ViewedLog, topic: str | None) -> Connection:
    if topic is None:
        found = next((one for each in (DETECTIONS, TRUTH_DETECTIONS) if (one := view.on(each.topic))), None)
        if found is None:
            raise RecordingError(f"{recording.path}: has neither detections nor the truth of them; run detect first")
        return found
    found = view.on(topic)
    if found is None or found.read_as != Detections.ROS_TYPE:
        raise UsageError(f"{recording.path}: {topic} has no boxes in images; mcap-landmarks info lists the topics")
    return found


def _numbered(
    images: Iterator[tuple[int, str, int, CompressedImage | Image, tuple[int, int]]], folder: Path | None
) -> tuple[list[Entry], dict[tuple[str, int], int]]:
    entries, numbers = list[Entry](), dict[tuple[str, int], int]()
    for number, (camera, prefix, stamp_ns, message, (width, height)) in enumerate(images, 1):
        is_file = isinstance(message, CompressedImage) and bytes(message.data[:4]).startswith((_JPEG, _PNG))
        suffix = "jpg" if is_file and bytes(message.data[:2]) == _JPEG else "png"
        name = f"{prefix}{stamp_ns}.{suffix}"
        entries.append({"id": number, "file_name": name, "width": width, "height": height})
        numbers.setdefault((plain(message.frame_id), stamp_ns), number)
        if camera == 0:  # boxes that name no camera are of the first one
            numbers.setdefault(("", stamp_ns), number)
        if folder is not None:
            data = bytes(message.data) if is_file else _png(message)
            (folder / name).write_bytes(data)
    return entries, numbers


def _decoded(
    log: LayeredLog, topics: list[str], left_out: Counter[str], progress: Progress
) -> Iterator[tuple[int, str, int, CompressedImage | Image, tuple[int, int]]]:
    """The camera's number, the beginning of the file's name, stamp, image and its width and height."""
    cameras = {
        entry.connection: topics.index(entry.connection.topic)
        for entry in log.channels
        if _is_of(entry.connection, topics)
    }
    for raw in log.messages(cameras, progress=progress):
        try:
            message = decode(IMAGES[raw.connection.message_type], raw.data)
            size = image_size(message)
        except MessageError:
            size = None
        if size is None:
            left_out["images that are no pictures"] += 1
            continue
        camera = cameras[raw.connection]
        prefix = f"camera{camera + 1}_" if len(topics) > 1 else ""
        yield camera, prefix, message.stamp_ns or raw.log_time_ns, message, size


def _is_of(connection: Connection, topics: list[str]) -> bool:
    return connection.topic in topics and connection.read_as in IMAGES


def _png(message: CompressedImage | Image) -> bytes:
    rgb = rgb_from_message(message)
    return bytes(cv2.imencode(".png", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))[1].tobytes())


def _categories(recording: Recording, view: ViewedLog) -> dict[str, int]:
    """The classes of all boxes of the log with their numbers: COCO's own where it has them."""
    names = {
        name
        for connection in view.of(Detections)
        for _, found in _read(recording, connection, Counter())
        for options in found.hypotheses
        for name, _ in options[:1]
    }
    known = dict(zip(NAMES, _NUMBERS, strict=True))
    others = {name: number for number, name in enumerate(sorted(names - known.keys()), _FIRST_OTHER)}
    numbers = {name: known.get(name) or others[name] for name in names}
    return dict(sorted(numbers.items(), key=lambda item: item[1]))


def _read(recording: Recording, connection: Connection, left_out: Counter[str]) -> Iterator[tuple[int, Detections]]:
    for raw in recording.messages([connection]):
        try:
            yield raw.log_time_ns, decode(Detections, raw.data)
        except MessageError:
            left_out["messages of boxes that cannot be decoded"] += 1


def _annotations(
    recording: Recording,
    boxes: Connection,
    images: tuple[list[Entry], Mapping[tuple[str, int], int]],
    categories: Mapping[str, int],
    left_out: Counter[str],
) -> list[Entry]:
    """An entry for each box, cut to its image; those without an image, a class or an area are counted."""
    entries, numbers = images
    annotations = list[Entry]()
    for log_time_ns, found in _read(recording, boxes, left_out):
        stamp_ns = found.stamp_ns or log_time_ns
        image_id = numbers.get((plain(found.frame_id), stamp_ns)) or numbers.get(("", stamp_ns))
        if image_id is None:
            left_out["boxes without an image"] += len(found)
            continue
        image = entries[image_id - 1]
        limits = np.array([image["width"], image["height"]] * 2, np.float64)
        for box, options in zip(np.clip(found.boxes_xyxy, 0, limits), found.hypotheses, strict=True):
            left, top, right, bottom = box.tolist()
            if not options or not (right > left and bottom > top):
                left_out["boxes without a class or an area in the image"] += 1
                continue
            name, score = options[0]
            annotations.append({
                "id": len(annotations) + 1,
                "image_id": image_id,
                "category_id": categories[name],
                "bbox": [left, top, right - left, bottom - top],
                "area": (right - left) * (bottom - top),
                "iscrowd": 0,
                "score": float(score),
            })  # fmt: skip
    return annotations
