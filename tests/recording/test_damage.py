"""Damaged recordings: whatever the damage, a clear error or what can be had, and never a crash."""

import contextlib
from pathlib import Path

import numpy as np
import pytest
from mcap_landmarks.errors import ToolkitError
from mcap_landmarks.recording.reader import open_recording

from tests.recording.test_writer import write_log


@pytest.mark.parametrize("seed", range(40))
def test_random_damage(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "log.mcap"
    write_log(path, 3)
    rng = np.random.default_rng(seed)
    with open_recording(path) as recording:
        whole = {(m.connection.topic, m.log_time_ns, bytes(m.data)) for m in recording.messages()}
    data = bytearray(path.read_bytes())
    for _ in range(rng.integers(1, 6)):
        place = int(rng.integers(8, len(data)))
        data[place : place + int(rng.integers(1, 9))] = rng.bytes(int(rng.integers(0, 9)))
    path.write_bytes(data)
    with contextlib.suppress(ToolkitError), open_recording(path) as recording:
        found = {(m.connection.topic, m.log_time_ns, bytes(m.data)) for m in recording.messages()}
        assert whole <= found or recording.losses
