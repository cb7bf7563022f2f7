"""The README says what is so: its commands exist, its verbs are all there, its files too."""

import re
import shlex
from pathlib import Path

import pytest
from mcap_landmarks.cli.main import build, verbs
from typer.testing import CliRunner

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text()


def test_two_commands_that_set_everything_up() -> None:
    blocks = re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
    assert len(blocks) == 2
    for block in blocks:
        assert len(block.strip().splitlines()) == 1
        assert "requirements.lock" in block
    assert "mcap-landmarks demo" in blocks[0]
    assert "pytest" in blocks[1]


def test_every_verb_is_named() -> None:
    for verb in verbs():
        assert re.search(rf"\bmcap-landmarks {verb}\b", README), f"README does not show {verb}"


@pytest.mark.parametrize("line", re.findall(r"^\$ (mcap-landmarks .*?)(?:\s{2,}#.*)?$", README, re.MULTILINE))
def test_commands_parse(line: str) -> None:
    """Options that a command line of the README uses are options of that verb."""
    _, verb, *words = shlex.split(line)
    assert verb in verbs()
    shown = CliRunner().invoke(build(verb), [*subcommand(verb, words), "--help"], env={"COLUMNS": "200"})
    assert shown.exit_code == 0
    for word in words:
        if word.startswith("-"):
            assert re.search(rf"(?<![\w-]){re.escape(word)}(?![\w-])", shown.output), f"{verb} has no option {word}"


def subcommand(verb: str, words: list[str]) -> list[str]:
    """The verb, and the command below it where it is a group."""
    return [verb, words[0]] if verb == "landmarks" else [verb]


def test_links_of_the_readme_are_absolute_and_their_files_exist() -> None:
    """A package's page shows the README without the files beside it."""
    targets = re.findall(r"\]\(([^)#]+)\)", README)
    assert targets
    for target in targets:
        found = re.fullmatch(
            r"https://(?:github|raw\.githubusercontent)\.com/\w[\w-]*/mcap-landmarks/(?:blob/)?main/(.+)", target
        )
        assert found, target
        assert (ROOT / found[1]).exists(), target


@pytest.mark.parametrize("document", sorted(path.relative_to(ROOT).as_posix() for path in ROOT.glob("docs/*.md")))
def test_linked_files_of_the_documents_exist(document: str) -> None:
    folder = (ROOT / document).parent
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", (ROOT / document).read_text()):
        assert (folder / target).exists(), target


def test_nothing_names_a_registry_or_a_machine() -> None:
    lock = (ROOT / "requirements.lock").read_text()
    assert "://" not in lock
    assert "@" not in lock
    assert all("==" in line for line in lock.splitlines() if line and not line.startswith("#"))
