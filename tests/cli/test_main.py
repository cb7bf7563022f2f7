"""The command itself: quick help, one line per error, exit codes."""

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
