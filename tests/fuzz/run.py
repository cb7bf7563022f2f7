"""Fuzz the readers for some minutes: what raises anything but ToolkitError, hangs or takes a gigabyte is kept.

python -m tests.fuzz.run [--target NAME] [--minutes N] [--findings FOLDER] [--replay FILE...]

Needs the extra `fuzz`. Without --target all targets run one after the other, each its share of the minutes, in a
process of its own. Each finding is kept once, by the place where it was raised: its input, and beside it what happened.
"""

import argparse
import contextlib
import io
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path
from types import FrameType

import atheris

MOST_SECONDS = 10
MOST_KB = 1 << 20
_BACKSTOP = 6 << 30
"""Bytes of address space: what would take more becomes a MemoryError, and so a finding."""
_LARGEST_INPUT = 20_000
_IN_MEMORY = Path("/dev/shm")  # noqa: S108 - a folder of its own is made in it
_INSTRUMENTED = ["mcap_landmarks", "rosbags", "mcap"]
TARGETS = ("mcap", "bag", "db3", "rosbag2", "cdr", "definitions", "maps", "databases", "foxglove", "settings")


class _HangError(BaseException):
    """Not to be caught by what hangs."""


def _alarm(_number: int, _frame: FrameType | None) -> None:
    raise _HangError(f"more than {MOST_SECONDS} s")


def _peak_kb() -> int:
    """The most memory since `_forget_peak`."""
    with Path("/proc/self/status").open() as lines:
        return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))


def _forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


class Watched:
    """A target that keeps what should not have happened, and goes on."""

    def __init__(self, name: str, folder: Path, findings: Path) -> None:
        from tests.fuzz import targets  # noqa: PLC0415 - instrumented by then

        targets.load()
        self._name, self._target, self._folder, self._findings = name, targets.TARGETS[name], folder, findings
        self._known = {path.name for path in findings.glob("*.bin")}
        self.calls = 0

    def __call__(self, data: bytes) -> None:
        self.calls += 1
        _forget_peak()
        signal.alarm(MOST_SECONDS)
        try:
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                self._target(data, self._folder)
            signal.alarm(0)
        except (Exception, _HangError) as error:  # noqa: BLE001 - this is what is looked for
            signal.alarm(0)
            self._keep(data, error)
        if (peak := _peak_kb()) > MOST_KB:
            self._keep(data, MemoryError(f"{peak >> 10} MB"))

    def _keep(self, data: bytes, error: BaseException) -> None:
        frames = [f for f in traceback.extract_tb(error.__traceback__) if "/tests/fuzz/" not in f.filename]
        own = [frame for frame in frames if "mcap_landmarks" in frame.filename] or frames
        place = f"{Path(own[-1].filename).stem}_{own[-1].lineno}" if own else "memory"
        name = f"{self._name}-{type(error).__name__.strip('_')}-{place}"
        if f"{name}.bin" not in self._known:
            self._known.add(f"{name}.bin")
            (self._findings / f"{name}.bin").write_bytes(data)
            (self._findings / f"{name}.txt").write_text("".join(traceback.format_exception(error)))
            print(f"FOUND {name}: {error}", flush=True)


def _fuzz(name: str, seconds: int, findings: Path) -> None:
    """Never returns: libFuzzer ends the process."""
    with atheris.instrument_imports(include=_INSTRUMENTED, enable_loader_override=False):
        import tests.fuzz.targets  # noqa: F401, PLC0415
    from tests.fuzz import corpus  # noqa: PLC0415

    folder = Path(tempfile.mkdtemp(prefix="fuzz-", dir=_IN_MEMORY if os.access(_IN_MEMORY, os.W_OK) else None))
    corpus.write(folder / "corpus")
    (folder / "work").mkdir()
    signal.signal(signal.SIGALRM, _alarm)
    resource.setrlimit(resource.RLIMIT_AS, (_BACKSTOP, _BACKSTOP))
    watched = Watched(name, folder / "work", findings)
    words = [
        f"-max_total_time={seconds}", f"-max_len={_LARGEST_INPUT}", "-timeout=60", "-rss_limit_mb=4096",
        f"-artifact_prefix={findings}/{name}-crash-", "-print_final_stats=1", "-handle_alrm=0",
    ]  # fmt: skip
    print(f"TARGET {name}", flush=True)
    atheris.Setup([sys.argv[0], *words, str(folder / "corpus" / name)], watched)
    atheris.Fuzz()


def _replay(name: str, files: list[Path]) -> None:
    """Let what a target raises through."""
    from tests.fuzz import targets  # noqa: PLC0415

    with tempfile.TemporaryDirectory() as folder:
        for file in files:
            start = time.perf_counter()
            targets.TARGETS[name](file.read_bytes(), Path(folder))
            print(f"{file}: {time.perf_counter() - start:.2f} s, {_peak_kb() >> 10} MB")


def main() -> None:
    """Fuzz one target here, or all in processes of their own."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--target", choices=TARGETS)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--findings", type=Path, default=Path("fuzz-findings"))
    parser.add_argument("--replay", type=Path, nargs="+")
    asked = parser.parse_args()
    if asked.replay:
        _replay(asked.target, asked.replay)
        return
    asked.findings.mkdir(parents=True, exist_ok=True)
    if asked.target:
        _fuzz(asked.target, max(1, int(asked.minutes * 60)), asked.findings.resolve())
    with atheris.instrument_imports(include=_INSTRUMENTED, enable_loader_override=False):
        import tests.fuzz.targets  # noqa: F401, PLC0415 - once for all
    for target in TARGETS:
        child = os.fork()
        if child == 0:
            _fuzz(target, max(1, int(asked.minutes * 60 / len(TARGETS))), asked.findings.resolve())
        os.waitpid(child, 0)


if __name__ == "__main__":
    main()
