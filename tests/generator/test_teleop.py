"""Driving by hand: what keys do, that the same keys give the same recording, and the picture in text."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.manifest import RUN, is_generated
from mcap_landmarks.messages.scan import LaserScan
from mcap_landmarks.recording.reader import open_recording
from mcap_landmarks.stage import Stamped
from mcap_landmarks_generator.record import record
from mcap_landmarks_generator.teleop import Key, KeySteering
from mcap_landmarks_generator.top_view import echoes, letters, nearest, top_view
from mcap_landmarks_generator.trajectory import Command

from tests.generator.conftest import StageText

POSE = np.zeros(3)
WORLD = """\
objects = [{ class = "suitcase", at = [2.0, 0.5] }, { class = "stop sign", at = [3.0, -1.0] }]
[camera]
width_px = 64
height_px = 48
rate_hz = 5
[robot]
start = [0, 0, 0]
"""


def scan(**ranges_m: float) -> LaserScan:
    """Eight beams, the first ahead; infinite but for some."""
    values = np.full(8, np.inf, np.float32)
    for name, range_m in ranges_m.items():
        values[int(name.removeprefix("beam_"))] = range_m
    return LaserScan(
        0, "base_scan", 0.0, 7 * np.pi / 4, np.pi / 4, 0.0, 0.2, 0.1, 15.0, values, np.zeros(0, np.float32)
    )


class Script(KeySteering):
    """Presses keys at the given numbers of commands."""

    def __init__(self, keys: dict[int, Key]) -> None:
        super().__init__(1.0)
        self.seen = 0
        self._keys, self._count = keys, 0

    def command(self, pose: np.ndarray) -> Command:
        if self._count in self._keys:
            self.press(self._keys[self._count])
        self._count += 1
        return super().command(pose)

    def see(self, _message: Stamped) -> None:
        self.seen += 1


def pressed(keys: Sequence[Key]) -> KeySteering:
    steering = KeySteering(1.0)
    for key in keys:
        steering.press(key)
    return steering


def test_keys_change_what_is_asked_for_by_the_steps_of_the_thesis() -> None:
    assert pressed("wwwx").speed_mps == 0.02
    assert pressed("aad").turn_radps == 0.1
    assert pressed("w" * 100).speed_mps == 0.26
    assert pressed("d" * 100).turn_radps == -1.82
    assert pressed("w" * 100 + "x" * 26).speed_mps == 0.0
    for stop in ("s", " "):
        stopped = pressed(("w", "a", stop))
        assert (stopped.speed_mps, stopped.turn_radps) == (0.0, 0.0)
    assert pressed("q").done
    assert not pressed("w").done


def test_the_robot_stands_once_its_wheels_rest() -> None:
    steering = pressed("www")
    assert not steering.command(POSE).standing
    steering.press("s")
    commands = [steering.command(POSE) for _ in range(10)]
    assert [command.speed_mps for command in commands][-1] == 0.0
    assert not commands[0].standing
    assert commands[-1].standing


@pytest.mark.slow
def test_the_same_keys_give_the_same_recording(stage_text: StageText, tmp_path: Path) -> None:
    keys: dict[int, Key] = {0: "w", 1: "w", 2: "a", 30: "s", 50: "q"}
    scripts = [Script(keys), Script(keys)]
    for number, script in enumerate(scripts, 1):
        summary = record(stage_text(WORLD), tmp_path / f"{number}.mcap", workers=number, by_hand=script)
    assert (tmp_path / "1.mcap").read_bytes() == (tmp_path / "2.mcap").read_bytes()
    assert summary.simulated_s == pytest.approx(50 * 0.016 + 0.004)
    assert scripts[0].seen == sum(summary.messages.values())
    with open_recording(tmp_path / "1.mcap") as log:
        assert is_generated(log.metadata)
        assert json.loads(log.metadata[RUN]["verb"]) == "teleop"
        options = json.loads(log.metadata[RUN]["options"])
    assert options["keys"] == [[number * 16_000_000, key] for number, key in keys.items()]


def test_letters_differ(stage_text: StageText) -> None:
    assert letters(stage_text(WORLD).objects) == {"stop sign": "S", "suitcase": "U"}


def test_the_picture_has_the_robot_in_the_middle() -> None:
    objects = {"S": np.array([[1.0, 0.5], [9.0, 9.0]])}
    assert top_view(np.array([0.0, 0.0, np.pi / 2]), objects, np.array([[-1.0, 0.0]]), 0.5, (9, 3)) == [
        "        S",
        ".   ^",
        "",
    ]


def test_what_the_lidar_sees() -> None:
    one = scan(beam_0=2.0, beam_2=1.0)
    assert nearest(one) == {"ahead": 2.0, "left": 1.0, "behind": np.inf, "right": np.inf}
    np.testing.assert_allclose(echoes(one, np.array([1.0, 0.0, np.pi / 2])), [[1.0, 1.936], [0.0, -0.064]], atol=1e-6)
