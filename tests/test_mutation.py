"""Mutants change what they say and nothing else, are drawn by their seed, and meet the tests that may kill them."""

import textwrap
from pathlib import Path

import pytest

from tests.benchmark import mutant_runs
from tests.benchmark.kept import ROOT
from tests.benchmark.mutant_runs import KILLED, SOURCES, SURVIVED, TIMED_OUT, Copy, Suite
from tests.benchmark.mutants import Sample
from tests.benchmark.mutation import Mutant, mutants_of


def changes(source: str) -> set[str]:
    return {f"{mutant.before} -> {mutant.after}" for mutant in mutants_of(textwrap.dedent(source), "x.py")}


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("a < b", {"a < b -> a >= b"}),
        ("len(a) < b", {"len(a) < b -> len(a) >= b", "len(a) < b -> len(a) <= b"}),
        ("a is None", {"a is None -> a is not None"}),
        ("a - b", {"a - b -> a + b", "a - b -> a"}),
        ("a * b", {"a * b -> a / b"}),
        ("a + 1e-9", {"a + 1e-09 -> a - 1e-09"}),
        ("near & far", {"near & far -> near | far"}),
        ("a and b", {"a and b -> a or b", "a and b -> a", "a and b -> b"}),
        ("-a", {"-a -> a"}),
        ("not a", {"not a -> a"}),
        ("b if near(a) else c", {"near(a) -> not near(a)"}),
        ("[a for a in b if a]", {"a -> not a"}),
        ("if a and b: c", {"a and b -> " + other for other in ("a or b", "a", "b", "not (a and b)")}),
        ("x = 3", {"3 -> 4"}),
        ("x = 50", {"50 -> 100"}),
        ("x = 0.25", {"0.25 -> 0.5"}),
        ("x = 0.0", {"0.0 -> 1.0"}),
        ("x = True", {"True -> False"}),
        ("a[:, 1]", {"1 -> 0"}),
        ("def f(iterations=30): ...", {"30 -> 1"}),
        ("x = a.sum(axis=1)", {"axis=1 -> axis=0"}),
        ("x = np.argmin(a)", {"np.argmin(a) -> np.argmax(a)"}),
        ("x = np.where(a, b, c)", {"np.where(a, b, c) -> np.where(a, c, b)"}),
        ("x = wrap(a)", {"wrap(a) -> a"}),
        ("for a in b: continue", {"continue -> break"}),
        ("a += b", {"a += b -> a -= b", "a += b -> pass"}),
    ],
)
def test_operators(source: str, expected: set[str]) -> None:
    assert changes(source) == expected


def test_a_call_for_its_effect_is_left_out() -> None:
    assert changes("self._limit()") == {"self._limit() -> pass"}


@pytest.mark.parametrize(
    "source",
    [
        '"""A text of 1 line."""',
        "a: int | None",
        "def f(a: Literal[1] = b) -> Literal[2]: ...",
        "@dataclass(frozen=True)\nclass A: ...",
        "if TYPE_CHECKING:\n    a = 1",
        "raise ValueError(f'{1 + a} of', 2)",
        "f'{a + 1}'",
        "'of ' + a",
        "[a] * b",
        "Names = Text | None",
        "x = 1e-12",
        "x = 1e9",
        "def f(a, seed=0): ...",
        "x = zip(a, b, strict=True)",
        "x = a.reshape(-1, 3)",
        "_CHUNK = 24",
        "_ROUNDS = 1",
    ],
)
def test_what_could_not_matter_stays(source: str) -> None:
    assert changes(source) == set()


def test_only_the_named_place_changes() -> None:
    source = '# Entfernung größer als 1\ny = "ä" if a < b else c[(1,\n    2)] * (d - e)\nz = a < b\n'
    changed = [mutant for mutant in mutants_of(source, "x.py") if mutant.before == "d - e"]
    assert [mutant.applied_to(source) for mutant in changed] == [
        source.replace("d - e", "(d + e)"),
        source.replace("d - e", "(d)"),
    ]
    assert {(mutant.first, mutant.last) for mutant in changed} == {(3, 3)}


def test_every_mutant_of_a_module_is_another_valid_module() -> None:
    source = (ROOT / SOURCES / "estimation/robust.py").read_text()
    every = [mutant.applied_to(source) for mutant in mutants_of(source, "estimation/robust.py")]
    assert len(every) > 20
    assert len({source, *every}) == len(every) + 1
    for changed in every:
        compile(changed, "robust.py", "exec")


def test_a_sample_is_drawn_by_its_seed() -> None:
    one, again, other = (Sample.of_package("fusion", 30, seed) for seed in (1, 1, 2))
    assert one.drawn == again.drawn
    assert one.drawn != other.drawn
    assert len(set(one.drawn)) == 30 < one.of
    with pytest.raises(ValueError, match="no package"):
        Sample.of_package("fusions", 30, 1)


def test_tests_that_execute_the_change_come_first() -> None:
    durations = {"long": 2.0, "elsewhere": 0.1, "same file": 1.0, "short": 0.5, "quick": 0.01}
    tests = Suite("p", 3.6, durations, {"p/a.py": {4: {"long"}, 5: {"short"}, 9: {"same file"}}})
    mutant = Mutant("p/a.py", 4, 5, 0, 0, "", "", "", "")
    assert tests.likeliest_first(mutant) == ["short", "long", "same file", "quick", "elsewhere"]


MODULE = """
def count(most):
    found = 0
    while found < most:
        found += 1
    return found


def unknown(a):
    return a + 1
"""
TESTS = """
import pytest
from mcap_landmarks.small.counting import count

def test_count():
    assert count(3) == 3

@pytest.mark.slow
def test_what_takes_long():
    raise RuntimeError
"""


@pytest.fixture
def small(tmp_path: Path) -> Copy:
    """A copy of a project of one module and one quick test."""
    package, tests = tmp_path / SOURCES / "small", tmp_path / "tests/small"
    package.mkdir(parents=True)
    tests.mkdir(parents=True)
    for folder in (package.parent, package, tests.parent, tests):
        (folder / "__init__.py").touch()
    (package / "counting.py").write_text(MODULE)
    (tests / "test_counting.py").write_text(TESTS)
    (tests.parent / "benchmark").mkdir()
    plugin = "benchmark/covered_first.py"
    (tests.parent / plugin).write_text((ROOT / "tests" / plugin).read_text())
    (tmp_path / "pyproject.toml").write_text('[tool.pytest.ini_options]\nmarkers = ["slow"]\n')
    return Copy(tmp_path)


@pytest.mark.slow
def test_outcomes(small: Copy, monkeypatch: pytest.MonkeyPatch) -> None:
    tests = small.run_unchanged("small")
    assert list(tests.durations) == ["tests/small/test_counting.py::test_count"]
    assert tests.executing["small/counting.py"][3] == {*tests.durations}
    by_change = {mutant.after: mutant for mutant in mutants_of(MODULE, "small/counting.py")}
    assert small.run(by_change["found >= most"], tests) == KILLED
    assert small.run(by_change["a - 1"], tests) == SURVIVED
    monkeypatch.setattr(mutant_runs, "LIMIT_S", 3)
    assert small.run(by_change["found -= 1"], tests) == TIMED_OUT
    assert (small.folder / SOURCES / "small/counting.py").read_text() == MODULE


@pytest.mark.slow
def test_tests_must_pass_without_a_mutant(small: Copy) -> None:
    (small.folder / "tests/small/test_counting.py").write_text(TESTS.replace("== 3", "== 4"))
    with pytest.raises(RuntimeError, match="tests/small ended with 1 without any mutant"):
        small.run_unchanged("small")
