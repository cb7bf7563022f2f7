"""What came of showing single objects to a network."""

import numpy as np
import pytest
from mcap_landmarks.evaluation.audition import Audition, Heard, best_on, distances_of, hear
from mcap_landmarks.messages.detections import Detections
from mcap_landmarks.messages.scan import LaserScan

BOX = np.array([10.0, 10.0, 30.0, 50.0])


def boxes(*found: tuple[str, float, tuple[float, float, float, float]]) -> Detections:
    options = tuple(((name, score),) for name, score, _ in found)
    sides = np.array([box for *_, box in found], np.float64).reshape(-1, 4)
    return Detections(0, "", ("",) * len(found), options, sides)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (boxes(), ("", 0.0)),
        (boxes(("person", 0.5, (10, 10, 30, 50))), ("person", 0.5)),
        (boxes(("person", 0.5, (10, 10, 30, 50)), ("bench", 0.6, (10, 10, 30, 50))), ("bench", 0.6)),
        (boxes(("person", 0.5, (10, 10, 30, 30)), ("bench", 0.6, (10, 10, 30, 29))), ("person", 0.5)),  # half: enough
        (boxes(("person", 0.9, (100, 100, 120, 140))), ("", 0.0)),
    ],
)
def test_the_best_box_on_the_object_counts(found: Detections, expected: tuple[str, float]) -> None:
    assert best_on(found, BOX) == expected


def scan_of_disc(distance_m: float, radius_m: float) -> LaserScan:
    """A level scan of one upright cylinder straight ahead."""
    step_rad = np.deg2rad(0.5)
    angles = np.arange(720) * step_rad
    along, aside = distance_m * np.cos(angles), distance_m * np.abs(np.sin(angles))
    meets = (along > 0) & (aside < radius_m)
    ranges = np.where(meets, along - np.sqrt(np.maximum(radius_m**2 - aside**2, 0)), np.inf).astype(np.float32)
    last = float(angles[-1])
    return LaserScan(0, "laser", 0.0, last, float(step_rad), 0.0, 0.1, 0.1, 30.0, ranges, np.zeros(0, np.float32))


def test_a_view_tells_what_network_and_lidar_see() -> None:
    truth, found = boxes(("fire hydrant", 1.0, (10, 10, 30, 50))), boxes(("person", 0.7, (10, 10, 30, 50)))
    heard = hear((4.0, 90), found, truth, scan_of_disc(4.1, 0.15), np.array([-0.1, 0.0, 0.1]))
    assert (heard.distance_m, heard.yaw_deg, heard.found, heard.score) == (4.0, 90, "person", 0.7)
    assert heard.hits == 9  # 2 * asin(0.15 / 4.1) is 4.2 degrees
    assert heard.fits
    bench = hear((4.0, 90), found, boxes(("bench", 1.0, (10, 10, 30, 50))), scan_of_disc(4.1, 0.15), np.zeros(3))
    assert not bench.fits
    person = boxes(("person", 1.0, (10, 10, 30, 50)))  # several shapes are of this class, and each has a share
    assert hear((4.0, 90), found, person, scan_of_disc(4.1, 0.25), np.zeros(3)).fits
    nothing = hear((9.0, 0), boxes(), truth, scan_of_disc(4.1, 0.15), np.zeros(3))
    assert (nothing.found, nothing.fits) == ("", False)


def test_views_add_up() -> None:
    def one(distance_m: float, yaw_deg: int, found: str, hits: int) -> Heard:
        return Heard(distance_m, yaw_deg, found, 0.5 if found else 0.0, hits, fits=hits > 3)

    heard = (one(2, 0, "person", 9), one(2, 90, "bench", 5), one(4, 0, "person", 4), one(4, 90, "", 2))
    audition = Audition("person", "coat", heard)
    assert distances_of([audition]) == [2, 4]
    assert (audition.recognised(2), audition.recognised(4), audition.recognised(6)) == ((1, 2), (1, 2), (0, 0))
    assert (audition.hits(2), audition.hits(4), audition.hits(6)) == (7, 3, 0)
    assert (audition.fits(2), audition.fits(4)) == ((2, 2), (1, 2))
    assert audition.missed_yaws_deg() == [90]
    assert audition.taken_for() == "bench"
    assert Audition("bench", "", heard[1:2]).taken_for() == ""
