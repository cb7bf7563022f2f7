"""Detections of a log against its true ones, image by image."""

from pathlib import Path

import numpy as np
from mcap_landmarks.channels import DETECTIONS, TRUTH_DETECTIONS
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.recording.writer import create_recording
from mcap_landmarks.report.page.detector_statistics import detector_statistics
from mcap_landmarks.stage import Stamped


def seen(frame: str, left_px: float) -> Detections:
    """One person, 40 pixels wide, in the camera of a frame."""
    return Detections(5, frame, ("a",), ((("person", 0.9),),), np.array([[left_px, 20.0, left_px + 40.0, 100.0]]))


def test_images_of_one_stamp_are_told_apart_by_their_frames(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with create_recording(path) as writer:
        for channel in (TRUTH_DETECTIONS, DETECTIONS):
            for frame, left_px in (("front", 10.0), ("left", 300.0)):
                writer.add(Stamped(channel, 5, seen(frame, left_px)))
    with open_recording(path) as recording:
        found = detector_statistics(recording)
    assert found is not None
    assert (found.images, found.with_truth) == (2, 2)
    (person,) = found.classes
    assert (person.judged, person.true, person.missed) == (2, 2, 0)
