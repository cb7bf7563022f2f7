"""The inertial measurement unit: what a standing, a turning and a starting robot feels."""

import numpy as np
import pytest
from mcap_landmarks.messages.codec import decode, encode
from mcap_landmarks_generator.history import History
from mcap_landmarks_generator.imu import ImuSensor, true_motion
from mcap_landmarks_generator.imu_message import Imu
from mcap_landmarks_generator.robot import RobotState
from mcap_landmarks_generator.sensor_specs import ImuSpec
from mcap_landmarks_generator.world import STEP_NS

RATE_RADPS, SPEED_MPS = 0.7, 2.0


def driven(steps: int = 1000) -> History:
    """A circle to the left at constant speed."""
    history = History()
    for step in range(steps):
        heading = RATE_RADPS * step * STEP_NS / 1e9
        radius = SPEED_MPS / RATE_RADPS
        position = np.array([radius * np.sin(heading), radius * (1 - np.cos(heading)), 0.0])
        quaternion = np.array([0.0, 0.0, np.sin(heading / 2), np.cos(heading / 2)])
        history.append(RobotState(position, quaternion, np.zeros(2)), standing=False)
    return history


def messages(spec: ImuSpec, history: History) -> list[Imu]:
    found = [stamped.message for stamped in ImuSensor(spec, 4, 0).measure(history)]
    assert all(isinstance(message, Imu) for message in found)
    return found


def test_a_circle_is_felt_as_turn_gravity_and_pull_to_its_middle() -> None:
    turn, force = true_motion(driven(), 10**9)
    assert turn == pytest.approx([0.0, 0.0, RATE_RADPS], abs=1e-4)
    assert force == pytest.approx([0.0, SPEED_MPS * RATE_RADPS, 9.81], abs=1e-2)


def test_nothing_is_told_before_its_motion_is_known() -> None:
    sensor, history, found = ImuSensor(ImuSpec(), 4, 0), History(), []
    whole = driven(40)
    for step in range(40):
        at = np.array([step * STEP_NS])
        history.append(RobotState(whole.positions(at)[0], whole.orientations(at)[0], np.zeros(2)), standing=False)
        found += [stamped.message for stamped in sensor.measure(history)]
    assert len(found) == 14
    assert all(np.isfinite([message.turn_radps, message.force_mps2]).all() for message in found)


def test_noise_and_biases_are_as_said() -> None:
    exact = ImuSpec(turn_sigma_dps=0, turn_bias_dps=0, force_sigma_mps2=0, force_bias_mps2=0, jitter_s=0)
    plain = messages(exact, driven())
    assert len(plain) == 398  # of 3.996 s at 100 Hz, all that have motion before and after them
    assert plain[0].stamp_ns == 0
    assert plain[100].turn_radps == pytest.approx([0, 0, RATE_RADPS], abs=1e-4)
    noisy = messages(ImuSpec(turn_bias_dps=2.0, force_bias_mps2=0.3), driven())
    errors = np.rad2deg([message.turn_radps - [0, 0, RATE_RADPS] for message in noisy])
    assert errors.std(axis=0) == pytest.approx(np.full(3, 0.1), rel=0.15)
    assert np.abs(errors.mean(axis=0)).max() > 0.5
    assert noisy[0].turn_variance == pytest.approx(np.deg2rad(0.1) ** 2)


def test_the_message_is_read_back() -> None:
    (first, *_) = messages(ImuSpec(), driven(100))
    again = decode(Imu, encode(first))
    assert again.turn_radps == pytest.approx(first.turn_radps)
    assert again.force_mps2 == pytest.approx(first.force_mps2)
    assert (again.frame_id, again.force_variance) == ("imu_link", first.force_variance)
