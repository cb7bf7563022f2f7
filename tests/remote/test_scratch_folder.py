"""Copies go with the process that made them, however it ends."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

_MAKE = "from mcap_landmarks.remote.scratch_folder import scratch_folder; (scratch_folder() / 'copy').touch()"
_WORKER = f"""
import multiprocessing

def work():
    {_MAKE}

if __name__ == "__main__":
    process = multiprocessing.get_context("fork").Process(target=work)
    process.start()
    process.join()
"""
_KILLED = f"import os, signal; {_MAKE}; os.kill(os.getpid(), signal.SIGKILL)"


def left_by(code: str, folder: Path, ends_with: int = 0) -> list[Path]:
    """What is left in the folder for temporary files by a process."""
    done = subprocess.run([sys.executable, "-c", code], env=os.environ | {"TMPDIR": str(folder)}, check=False)
    assert done.returncode == ends_with
    return [path for path in folder.rglob("*") if path.is_file() or "copies" in path.name]


@pytest.mark.slow
@pytest.mark.parametrize("code", [_MAKE, _WORKER])
def test_the_folder_ends_with_its_process(code: str, tmp_path: Path) -> None:
    assert left_by(code, tmp_path) == []


@pytest.mark.slow
def test_what_a_killed_process_left_goes_with_the_next(tmp_path: Path) -> None:
    assert left_by(_KILLED, tmp_path, -signal.SIGKILL) != []
    assert left_by(_MAKE, tmp_path) == []
