"""Messages on their way to the log: clocks that are off, messages that are lost or late."""

import numpy as np
import pytest
from mcap_landmarks.channels import ODOMETRY, TF_STATIC
from mcap_landmarks_generator.clock import Delivery
from mcap_landmarks_generator.randomness import Stream
from mcap_landmarks_generator.sensor_specs import OdometrySpec
from mcap_landmarks_generator.simulation import Simulation

from tests.generator.conftest import StageText

START_NS = 10**18
SECOND_NS = 10**9


def delivery(**values: float) -> Delivery:
    return Delivery(OdometrySpec(**values), 3, Stream.ODOMETRY_DELIVERY, START_NS)


def test_stamps_are_of_the_sensor_s_clock_and_log_times_of_the_recorder_s() -> None:
    way = delivery(clock_offset_s=-0.2, clock_drift_ppm=50, latency_s=0.01, delay_s=0.002)
    delivered = way.of(100 * SECOND_NS, 10**7)
    assert delivered is not None
    assert delivered.stamp_ns - START_NS == 100 * SECOND_NS - 200_000_000 + 5_000_000 + 10_000_000
    assert delivered.log_time_ns - START_NS == 100 * SECOND_NS + 10_000_000 + 12_000_000


def test_some_are_lost_and_some_are_late() -> None:
    way = delivery(dropped=0.1, late=0.2, late_s=0.5, delay_s=0.0)
    sent = [way.of(i * SECOND_NS) for i in range(2000)]
    arrived = [one for one in sent if one is not None]
    late = np.array([one.log_time_ns - one.stamp_ns for one in arrived]) == SECOND_NS // 2
    assert 1 - len(arrived) / len(sent) == pytest.approx(0.1, abs=0.02)
    assert late.mean() == pytest.approx(0.2, abs=0.03)


@pytest.mark.slow
def test_messages_stay_in_the_order_in_which_they_are_logged(stage_text: StageText) -> None:
    staged = stage_text(
        """\
        [camera]
        when = "never"
        [odometry]
        late = 0.3
        late_s = 0.2
        dropped = 0.2
        [imu]
        rate_hz = 100
        [robot]
        frames_after_s = 0.5
        [trajectory]
        waypoints = [{ at = [0, 0], stop_s = 1.0 }]
        """
    )
    events = list(Simulation(staged).run())
    times = [event.log_time_ns for event in events]
    stamps = [event.message.stamp_ns for event in events if event.channel is ODOMETRY]
    frames = [event.log_time_ns for event in events if event.channel is TF_STATIC]
    assert times == sorted(times)
    assert stamps != sorted(stamps)
    assert len(stamps) < 30
    assert frames == [staged.scenario.start_ns + SECOND_NS // 2]
