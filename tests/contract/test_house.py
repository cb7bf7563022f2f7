"""The house rules that no linter holds: sizes, complexity, types, and one name for one thing."""

import ast
import re
import statistics
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from radon.complexity import cc_visit
from radon.visitors import Class

ROOT = Path(__file__).parents[2]
TOOLKIT, GENERATOR = ROOT / "toolkit" / "mcap_landmarks", ROOT / "generator" / "mcap_landmarks_generator"
FILES = sorted(path for folder in (TOOLKIT, GENERATOR) for path in folder.rglob("*.py"))

MEDIAN_LINES, MOST_LINES = 110, 300
MOST_FUNCTION_LINES = 60
MOST_COMPLEXITY = 12
"""As ruff's C901, but by radon, which counts comprehensions, boolean operators and conditional expressions too."""
MOST_ANY = 4 / 1000

SAME_MEANING = ("config", "thesis")
"""File names that mean the same in every package: what can be set of it, and the thesis's own algorithm for it."""
FOLDERS_OF_VERBS = ("cli", "stages", "runs", "inspection", "evaluation")
"""Where the file of a verb, that of its stage and that of its work have the verb's name."""


@cache
def text_of(path: Path) -> str:
    return path.read_text()


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(text_of(path))


def name_of(path: Path) -> str:
    """A file's place in its package."""
    return str(path.relative_to(TOOLKIT if path.is_relative_to(TOOLKIT) else GENERATOR))


def lines_of(path: Path) -> int:
    return len(text_of(path).splitlines())


def test_files_are_rooms_not_halls() -> None:
    assert {name_of(path): lines_of(path) for path in FILES if lines_of(path) > MOST_LINES} == {}
    assert statistics.median(lines_of(path) for path in FILES) <= MEDIAN_LINES


def test_functions_fit_a_screen() -> None:
    long = {
        f"{name_of(path)} {node.name}": node.end_lineno - node.lineno + 1
        for path in FILES
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and node.end_lineno is not None
        and node.end_lineno - node.lineno >= MOST_FUNCTION_LINES
    }
    assert long == {}


def complexities(path: Path) -> Iterator[tuple[str, int]]:
    """Functions and methods of a file, with their complexity as radon counts it."""
    for block in cc_visit(text_of(path)):
        if not isinstance(block, Class):  # its methods stand beside it
            yield block.fullname, block.complexity


@pytest.mark.slow
def test_functions_have_few_ways_through() -> None:
    found = {f"{name_of(path)} {name}": ways for path in FILES for name, ways in complexities(path)}
    assert {name: ways for name, ways in found.items() if ways > MOST_COMPLEXITY} == {}


def test_every_file_says_what_it_is_for() -> None:
    assert [name_of(path) for path in FILES if not ast.get_docstring(tree_of(path))] == []


def test_types_are_said() -> None:
    """`Any` only where no type can be: four times in a thousand lines, counted as words, imports included."""
    found = {name_of(path): len(re.findall(r"\bAny\b", text_of(path))) for path in FILES}
    share = sum(found.values()) / sum(lines_of(path) for path in FILES)
    assert share <= MOST_ANY, sorted(((count, name) for name, count in found.items() if count), reverse=True)


def test_a_file_name_means_one_thing() -> None:
    """A verb's file and its stage's are named as the verb is, and so is the file that does their work; a file of
    `messages` is named as the messages are, and so may the one be that makes them.
    """
    verbs = {path.stem for folder in ("cli", "stages") for path in (TOOLKIT / folder).glob("*.py")}
    places = defaultdict(set)
    for path in TOOLKIT.rglob("*.py"):
        of_messages = path.parent.name == "messages" and "ROS_TYPE: ClassVar" in text_of(path)
        if path.stem not in {"__init__", *SAME_MEANING} and not of_messages:
            of_the_verb = path.stem in verbs and path.parent.name in FOLDERS_OF_VERBS
            places[path.stem].add("of the verb" if of_the_verb else name_of(path))
    assert {stem: sorted(found) for stem, found in places.items() if len(found) > 1} == {}


def test_a_class_name_means_one_thing() -> None:
    places = defaultdict(list)
    for path in TOOLKIT.rglob("*.py"):
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(name_of(path))
    assert {name: sorted(found) for name, found in places.items() if len(found) > 1} == {}
