"""Driving by hand through a pseudo-terminal, with real key presses; however it ends, the recording is whole."""

import fcntl
import json
import os
import pty
import signal
import struct
import sys
import termios
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap_landmarks.channels import ODOMETRY
from mcap_landmarks.manifest import RUN
from mcap_landmarks.messages.codec import decode
from mcap_landmarks.messages.poses import Odometry
from mcap_landmarks.recording.reader import open_recording

from tests.cli.calls import refused

pytest.importorskip("pybullet")
SCENARIO = """\
objects = [{ class = "suitcase", at = [2.0, 0.0] }]
[camera]
when = "never"
[robot]
start = [0, 0, 0]
"""
PATIENCE_S = 90.0


class Drive:
    """`teleop` in a process whose terminal is ours."""

    def __init__(self, folder: Path) -> None:
        (folder / "room.toml").write_text(SCENARIO)
        words = ["teleop", folder / "room.toml", "-o", folder / "log.mcap", "--workers", "1"]
        self.pid, self.terminal = pty.fork()
        if self.pid == 0:
            command = [sys.executable, "-m", "mcap_landmarks", *map(str, words)]
            os.execv(sys.executable, command)  # noqa: S606 - its terminal is ours
        fcntl.ioctl(self.terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 100, 0, 0))
        self.shown = ""

    def await_text(self, text: str) -> None:
        """Read until the screen has shown a text since the last one."""
        until = time.monotonic() + PATIENCE_S
        while text not in self.shown:
            assert time.monotonic() < until, self.shown[-2000:]
            try:
                self.shown += os.read(self.terminal, 65536).decode()
            except OSError:
                pytest.fail(f"it ended: {self.shown[-2000:]}")
        self.shown = self.shown.partition(text)[2]

    def press(self, keys: str) -> None:
        os.write(self.terminal, keys.encode())

    def exit_code(self) -> int:
        """Once it has ended; what it still shows is read, as long as there is a terminal."""
        try:
            while os.read(self.terminal, 65536):
                pass
        except OSError:
            pass
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


def quit_by_key(drive: Drive) -> None:
    drive.press("q")


def interrupt(drive: Drive) -> None:
    drive.press("\x03")


def terminate(drive: Drive) -> None:
    os.kill(drive.pid, signal.SIGTERM)


def lose_the_terminal(drive: Drive) -> None:
    os.close(drive.terminal)


@pytest.mark.slow
@pytest.mark.parametrize("end", [quit_by_key, interrupt, terminate, lose_the_terminal])
def test_keys_drive_and_the_recording_is_whole(tmp_path: Path, end: Callable[[Drive], None]) -> None:
    drive = Drive(tmp_path)
    drive.await_text("linear velocity 0.00   angular velocity 0.0")
    drive.press("www" + "a")
    drive.await_text("linear velocity 0.03   angular velocity 0.1")
    drive.await_text("LiDAR:   ahead ")
    drive.press("s")
    drive.await_text("linear velocity 0.00   angular velocity 0.0")
    end(drive)
    code = drive.exit_code()
    assert code == (1 if end is lose_the_terminal else 0)  # there is nowhere to print the summary
    assert sorted(path.name for path in tmp_path.iterdir()) == ["log.mcap", "room.toml"]
    with open_recording(tmp_path / "log.mcap") as log:
        assert log.losses == []
        keys = [key for _, key in json.loads(log.metadata[RUN]["options"])["keys"]]
        last = [decode(Odometry, raw.data) for raw in log.messages(log.connections(ODOMETRY.topic))][-1]
    assert keys == [*"wwwas", *("q" if end is quit_by_key else "")]
    assert last.position_m[0] > 0
    assert last.orientation_xyzw[2] > 0


def test_without_a_terminal_it_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "ssh -t" in refused(capsys, 2, "teleop", "small", "-o", tmp_path / "log.mcap")
    assert list(tmp_path.iterdir()) == []


def test_a_drive_by_hand_is_not_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "log.mcap").write_text("precious")
    assert "--overwrite" in refused(capsys, 2, "teleop", "small", "-o", tmp_path / "log.mcap")
