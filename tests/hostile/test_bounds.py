"""Whatever a small file claims: it is refused, or read in bounded memory, and no traceback reaches a user."""

import contextlib
import json
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from mcap_landmarks import memory
from mcap_landmarks.cli.main import run
from mcap_landmarks.errors import MessageError, RecordingError, UsageError
from mcap_landmarks.messages.images import CompressedImage
from mcap_landmarks.messages.layout import Layout
from mcap_landmarks.vision.pixels import rgb_from_message

from tests.cli.calls import refused
from tests.hostile import inputs

MOST_MB = 300
"""Above what the toolkit takes by itself."""


def use_all(paths: list[str]) -> None:
    """Read each path with several verbs, and print the memory that it took, in a process of its own."""
    with contextlib.suppress(SystemExit):
        run(["info", paths[0]])  # imports
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    taken = {}
    for path in paths:
        codes = []
        for words in (["info", "--check", path], ["convert", path, "-o", f"{path}.out.mcap"]):
            try:
                run(words)
            except SystemExit as stop:
                codes.append(stop.code)
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024
        taken[Path(path).name] = [grown, *codes]
    sys.stdout.flush()
    print("\n" + json.dumps(taken))


@pytest.mark.slow
def test_no_small_file_takes_much_memory(tmp_path: Path) -> None:
    paths = [str(make(tmp_path)) for make in inputs.LOGS]
    call = "import sys; from tests.hostile.test_bounds import use_all; use_all(sys.argv[1:])"
    ended = subprocess.run([sys.executable, "-c", call, *paths], capture_output=True, text=True, check=False)
    assert "Traceback" not in ended.stderr
    taken = json.loads(ended.stdout.splitlines()[-1])
    assert len(taken) == len(paths)
    assert {name: grown for name, (grown, *_) in taken.items() if grown > MOST_MB} == {}
    assert {code for _, *codes in taken.values() for code in codes} <= {0, 1, 3}
    for name in ("cut.mcap", "zstd.mcap", "lz4.mcap", "bz2.bag", "lz4.bag", "message.db3", "tables.zip"):
        assert taken[name][2] in {1, 3}, name


def test_an_image_is_measured_before_it_is_decoded() -> None:
    with pytest.raises(MessageError, match=r"30000 x 20000 pixels is not decoded.*--max-memory"):
        rgb_from_message(CompressedImage(0, "camera", "png", inputs.png(30000, 20000, 100)))
    assert rgb_from_message(CompressedImage(0, "camera", "png", inputs.png(64, 48, 48))).shape == (48, 64, 3)


@pytest.mark.parametrize("text", [inputs.growing_text(), "odd/T0[] inner\n"])
def test_definitions_are_measured_before_they_are_expanded(text: str) -> None:
    with pytest.raises(MessageError, match=r"schema cannot be understood .*(more than 20000 fields|holds itself)"):
        Layout("odd/msg/T0", text)


@pytest.mark.parametrize(("text", "size"), [("512M", 512 << 20), ("4G", 4 << 30), ("1.5k", 1536), ("100", 100)])
def test_the_bound_is_set_in_bytes_or_larger_units(text: str, size: int) -> None:
    memory.allow(text)
    try:
        assert memory.bound() == memory.most(1) == size
    finally:
        memory.allow(None)


@pytest.mark.parametrize("text", ["", "0", "4X", "-1", "nan"])
def test_what_is_no_size_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="give a size such as 512M or 4G"):
        memory.allow(text)


def test_claims_are_held_against_the_bound_and_what_they_are_made_of() -> None:
    assert memory.excess(memory.SMALL, 1) is None
    assert memory.excess(memory.SMALL * 2, memory.SMALL) is None
    with pytest.raises(RecordingError, match=r"^a\.bag: it claims 1\.1 GB from 10 bytes; .*--max-memory$"):
        memory.check("a.bag", 1 << 30, 10)


def test_the_user_may_allow_more_or_less(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = inputs.bz2_bag(tmp_path)
    with pytest.raises(SystemExit):
        run(["info", str(bag), "--max-memory", "1M"])
    memory.allow(None)
    assert refused(capsys, 2, "info", bag, "--max-memory", "much") == (
        "error: --max-memory much: give a size such as 512M or 4G"
    )
