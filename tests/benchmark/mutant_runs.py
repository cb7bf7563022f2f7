"""Tests run against mutants, each in a private copy of the sources, those first that execute what was changed."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import cache_from_source
from pathlib import Path

from coverage import CoverageData

from tests.benchmark.covered_first import ORDER, SECONDS, TAKEN
from tests.benchmark.kept import ROOT
from tests.benchmark.mutation import Mutant
from tests.shared import data_folder

SOURCES = "toolkit/mcap_landmarks"
# Of processor time, which other work on the machine does not change; a process that sleeps gets some times as much.
LIMIT_S = 90
_ASLEEP = 4
KILLED, TIMED_OUT, SURVIVED = "killed", "timed out", "survived"

_COPIED = ("toolkit", "generator", "schemas", "recordings", "tests", "pyproject.toml")
# pytest's exit codes of a wrong call and of no tests: nothing that a mutant may cause.
_NOT_RUN = (4, 5)


@dataclass(frozen=True, slots=True)
class Suite:
    """The quick tests of one package, as they run without a mutant.

    `seconds` of processor time in all, `durations` by test, `executing` the tests by file and line.
    """

    package: str
    seconds: float
    durations: dict[str, float]
    executing: dict[str, dict[int, set[str]]]

    def likeliest_first(self, mutant: Mutant) -> list[str]:
        """All tests: those that execute a changed line first, then those that execute its file, quick ones first."""
        by_line = self.executing.get(mutant.file, {})
        of_lines = set().union(*(by_line.get(line, ()) for line in range(mutant.first, mutant.last + 1)))
        of_file = set().union(*by_line.values())
        return sorted(
            self.durations, key=lambda name: (name not in of_lines, name not in of_file, self.durations[name])
        )


@dataclass(frozen=True, slots=True)
class Copy:
    """A copy of the sources, their tests and what these read; one process at a time works in it."""

    folder: Path

    @classmethod
    def at(cls, folder: Path) -> "Copy":
        """Copy the checkout."""
        for name in _COPIED:
            source = ROOT / name
            if source.is_dir():
                shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__", ".*"))
            else:
                folder.mkdir(parents=True, exist_ok=True)
                shutil.copy2(source, folder / name)
        return cls(folder)

    def run_unchanged(self, package: str) -> Suite:
        """The quick tests of a package, every line that they execute written down.

        Raises:
            RuntimeError: they do not pass, take longer than a mutant's may, or execute nothing of this copy.
        """
        taken, covered = self.folder / "taken.json", self.folder / f"covered_{package}"
        measured = [f"--cov={SOURCES}/{package}", "--cov-context=test", "--cov-report="]
        # The tracer in C is the one that knows contexts on every version of Python.
        files = {TAKEN: str(taken), "COVERAGE_FILE": str(covered), "COVERAGE_CORE": "ctrace"}
        code, output = self._pytest(package, measured, files, LIMIT_S)
        if code != 0:
            ended = f"ended with {code}" if code is not None else f"took over {LIMIT_S} s"
            raise RuntimeError(f"tests/{package} {ended} without any mutant:\n{output[-2000:]}")
        executing = self._executing(covered)
        if not any(executing.values()):
            raise RuntimeError(f"tests/{package} execute nothing of {self.folder / SOURCES / package}")
        seconds = json.loads(taken.read_text())
        return Suite(package, seconds["all"], seconds["each"], executing)

    def _executing(self, covered: Path) -> dict[str, dict[int, set[str]]]:
        data = CoverageData(str(covered))
        data.read()
        return {
            Path(file).relative_to(self.folder / SOURCES).as_posix(): {
                line: {context.rpartition("|")[0] for context in contexts if context}
                for line, contexts in data.contexts_by_lineno(file).items()
            }
            for file in data.measured_files()
        }

    def run(self, mutant: Mutant, tests: Suite) -> str:
        """What became of a mutant: killed, timed out, or survived all quick tests of its package."""
        order = self.folder / "order.json"
        order.write_text(json.dumps(tests.likeliest_first(mutant)))
        # Much longer than the tests take is as good as forever.
        limit_s = min(LIMIT_S, 10 + int(5 * tests.seconds))
        with self._changed(mutant):
            code, output = self._pytest(tests.package, ["-x", "-p", "no:pytest_cov"], {ORDER: str(order)}, limit_s)
        if code in _NOT_RUN:
            raise RuntimeError(f"pytest ended with {code} for {mutant}:\n{output[-2000:]}")
        return TIMED_OUT if code is None else KILLED if code else SURVIVED

    @contextmanager
    def _changed(self, mutant: Mutant) -> Iterator[None]:
        path = self.folder / SOURCES / mutant.file
        source = path.read_text()
        # Byte code is told from stale one by time and size only, and both may be those of another mutant.
        bytecode = Path(cache_from_source(str(path)))
        bytecode.unlink(missing_ok=True)
        path.write_text(mutant.applied_to(source))
        try:
            yield
        finally:
            path.write_text(source)
            bytecode.unlink(missing_ok=True)

    def _pytest(
        self, package: str, options: list[str], variables: dict[str, str], limit_s: int
    ) -> tuple[int | None, str]:
        """Exit code, None after the limit, and output of the quick tests of a package."""
        command = [sys.executable, "-m", "pytest", "-q", "-m", "not slow", "-p", "tests.benchmark.covered_first"]
        path = os.pathsep.join(str(self.folder / name) for name in ("toolkit", "generator"))
        given: dict[str, str] = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        given["PYTHONDONTWRITEBYTECODE"] = ""  # else every start compiles everything
        data = data_folder()
        if data is not None:
            given["MCAP_LANDMARKS_DATA"] = str(data)
        with subprocess.Popen(
            [*command, *options, f"tests/{package}"],
            cwd=self.folder,
            env={**os.environ, **given, **variables, SECONDS: str(limit_s), "PYTHONPATH": path},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        ) as child:
            try:
                output, _ = child.communicate(timeout=_ASLEEP * limit_s)
            except subprocess.TimeoutExpired:
                return None, ""
            finally:
                if child.poll() is None:
                    os.killpg(child.pid, signal.SIGKILL)
        return None if child.returncode == -signal.SIGXCPU else child.returncode, output
