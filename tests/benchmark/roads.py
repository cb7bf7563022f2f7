"""How well camera and 3-D LiDAR on roads become scene objects: KITTI frames of the development set, stock YOLOv5n.

python -m tests.benchmark.roads [--json] [--quick]
"""

import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from tests.benchmark.rows import Row, main
from tests.real import roads
from tests.real.roads_judge import Judged, judge_frames
from tests.real.street import NEAR_M, THERE_M, Street, drive_street
from tests.shared import data_folder

BANDS_M = ((0, 10), (10, 20), (20, 30), (30, 1000))
GOALS = {"became": 50 / 60, "median": 0.22, "within": 42 / 60, "wrong": 0.20}
"""What step 8 asks of other frames of KITTI, there of single ones."""


def measure(quick: bool) -> Iterator[Row]:
    """All rows: what was developed on, then what was held back."""
    data = data_folder()
    if data is None:
        raise SystemExit("no data at ../shared/data; set MCAP_LANDMARKS_DATA to where it lies")
    held = [number for number in roads.SINGLE if number not in roads.DEVELOPED_ON]
    step = 6 if quick else 2
    for label, numbers, drive in (
        ("developed on", roads.DEVELOPED_ON, roads.DRIVE[::step]),
        ("held back", held, roads.DRIVE[1::step]),
    ):
        single = judge_frames(data, roads.single_frames(data / "roads" / "kitti_object", numbers))
        yield from rows(f"{label}, single frames", single, GOALS)
        street = judge_frames(data, roads.drive_frames(data / "roads" / "kitti_tracking_0001", drive))
        yield from rows(f"{label}, a street", street, {})
    with tempfile.TemporaryDirectory() as folder:
        yield from street_rows(drive_street(data, Path(folder)))


def street_rows(street: Street) -> Iterator[Row]:
    """The figures of the street whose even frames are mapped and whose odd ones are localized."""
    cars, frames = len(street.cars_off_m), street.frames
    found, there = int((street.cars_off_m <= NEAR_M).sum()), int((street.poses_off_m <= THERE_M).sum())
    yield Row("street map: parked cars within 0.35 m", found / cars, "", 10 / 14, cases=cars)
    yield Row("street map: farthest landmark from any car", float(street.landmarks_off_m.max()), "m", at_most=2.0)
    yield Row("street positions: within 0.2 m", there / frames, "", 0.8, cases=frames)
    yield Row("street positions: median off", float(np.median(street.poses_off_m)), "m", cases=frames)
    yield Row("street positions: NEES / 3", float(np.mean(street.poses_nees)) / 3, at_most=2.0, cases=frames)


def rows(label: str, judged: Judged, goals: Mapping[str, float]) -> Iterator[Row]:
    """The figures of some frames, altogether and by range."""
    yield from _band(f"{label}, all", judged, goals)
    for low, high in BANDS_M:
        name = f"{label}, {low} to {high} m" if high < 1000 else f"{label}, over {low} m"
        yield from _band(name, judged.between(low, high), {})
    wrong = len(judged.wrong) / max(judged.objects, 1)
    yield Row(f"{label}, wrong share", wrong, at_most=goals.get("wrong"), cases=judged.objects)
    yield Row(f"{label}, NEES / 2", judged.nees / 2, cases=len(judged.errors_m))


def _band(label: str, judged: Judged, goals: Mapping[str, float]) -> Iterator[Row]:
    errors, detected = judged.errors_m, len(judged.cases)
    peers = {"became": float(len(errors)), "wrong": float(len(judged.wrong))}
    share = len(errors) / detected if detected else np.nan
    within = judged.within(0.5) / detected if detected else np.nan
    median = float(np.median(errors)) if len(errors) else np.nan
    yield Row(f"{label}: detected that became objects", share, "", goals.get("became"), cases=detected, peers=peers)
    yield Row(f"{label}: median off", median, "m", at_most=goals.get("median"), cases=len(errors))
    yield Row(f"{label}: detected within 0.5 m", within, "", goals.get("within"), cases=detected)


if __name__ == "__main__":
    sys.exit(main(measure, "How well camera and 3-D LiDAR on roads become scene objects."))
