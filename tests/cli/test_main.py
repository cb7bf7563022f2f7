"""The command itself: quick help, one line per error, exit codes."""

import os
import subprocess
import sys

import pytest
from mcap_landmarks.cli.main import run, verbs

HEAVY = ("numpy", "scipy", "rosbags", "matplotlib", "pydantic", "onnxruntime", "cv2", "pybullet", "mcap")


def call(*words: str) -> int:
    with pytest.raises(SystemExit) as stop:
        run(list(words))
    return int(stop.value.code or 0)


def test_help_imports_nothing_heavy() -> None:
    """What keeps `--help` under half a second: the imports wait until their verb runs."""
    script = (
        "import sys\nfrom mcap_landmarks.cli.main import run\n"
        "try:\n    run(['--help'])\nexcept SystemExit as stop:\n    assert not stop.code\n"
        f"print('heavy:', sorted(set({HEAVY!r}) & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip().endswith("heavy: []")
    for verb, short_help in verbs().items():
        assert f" {verb} " in done.stdout
        assert short_help


@pytest.mark.parametrize(("given", "threads"), [({}, 1), ({"OPENBLAS_NUM_THREADS": "2"}, 2)])
def test_products_of_matrices_take_one_thread_where_nothing_else_is_said(given: dict[str, str], threads: int) -> None:
    """Those of more wait for each other in a loop, which takes the cores that other work needs."""
    script = (
        "import os\nfrom mcap_landmarks.cli.main import run\n"
        "try:\n    run(['--version'])\nexcept SystemExit:\n    pass\n"
        "import numpy as np\nnp.ones((500, 500)) @ np.ones((500, 500))\nprint(len(os.listdir('/proc/self/task')))"
    )
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, env={**environment, **given}
    )
    assert int(done.stdout.split()[-1]) == min(threads, len(os.sched_getaffinity(0)))


@pytest.mark.parametrize("verb", sorted(verbs()))
def test_every_verb_has_help(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(verb, "--help") == 0
    shown = capsys.readouterr().out
    assert f" {verb} [OPTIONS]" in shown


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("--version") == 0
    assert capsys.readouterr().out.startswith("mcap-landmarks ")


def test_wrong_usage_is_exit_code_2(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("locate") == 2
    assert call("localize") == 2
    assert call("localize", "log.mcap", "--map", "x.db", "-o", "y.mcap", "--no-such-option") == 2
    assert "no-such-option" in capsys.readouterr().err
