"""Writes docs/verbs/, a page per verb, from what `--help` shows and what the documents do: `python docs/verbs.py`."""

import inspect
import os
import re
from collections.abc import Iterator
from pathlib import Path

import typer.main
from mcap_landmarks.cli.main import build, verbs
from typer._click.core import Context
from typer.core import TyperArgument, TyperCommand, TyperOption

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "verbs"
SHOWN = re.compile(r"^\$ (?:pip install .*? && )?(mcap-landmarks (\S+).*?)(?:\s{2,}#.*)?$", re.MULTILINE)


def pages() -> dict[str, str]:
    """What each file of docs/verbs/ has to say, by its name."""
    examples = _examples()
    written = {f"{verb}.md": _page(verb, examples.get(verb, {})) for verb in verbs()}
    lines = [
        "# The verbs",
        "",
        "A page for each, as `mcap-landmarks VERB --help` tells it; [the guide](../guide.md) has what they share.",
        "",
        *(f"- [`{verb}`]({verb}.md): {short}" for verb, short in verbs().items()),
    ]
    return written | {"README.md": "\n".join(lines) + "\n"}


def _examples() -> dict[str, dict[str, Path]]:
    """The command lines that README and docs show, by their verb, and the document that shows them first."""
    found: dict[str, dict[str, Path]] = {}
    for path in [ROOT / "README.md", *sorted(ROOT.glob("docs/*.md"))]:
        for line, verb in SHOWN.findall(path.read_text()):
            found.setdefault(verb, {}).setdefault(line, path)
    return found


def _page(verb: str, examples: dict[str, Path]) -> str:
    command = typer.main.get_command(build(verb)).commands[verb]
    below = getattr(command, "commands", {})
    lines = [f"# `mcap-landmarks {verb}`", ""]
    if below:
        lines += [verbs()[verb], ""]
    for name, one in below.items() if below else [("", command)]:
        lines += [f"## `{verb} {name}`", ""] if name else []
        lines += _command(f"{verb} {name}".strip(), one)
    if examples:
        shown = ", ".join(
            f"[{path.name}]({os.path.relpath(path, FOLDER)})" for path in dict.fromkeys(examples.values())
        )
        lines += [f"As in {shown}:", "", "```console", *(f"$ {line}" for line in examples), "```"]
    return "\n".join(lines).rstrip() + "\n"


def _command(name: str, command: TyperCommand) -> Iterator[str]:
    given = [one for one in command.params if isinstance(one, TyperArgument)]
    options = [one for one in command.params if isinstance(one, TyperOption) and not one.hidden]
    words = [name, *(one.display_name_raw for one in given), *(_option(one) for one in options if one.required)]
    yield from ("```", f"mcap-landmarks {' '.join(words)} [OPTIONS]", "```", "")
    yield from (inspect.cleandoc(command.help or ""), "")
    if given or options:
        yield from ("| | |", "|---|---|")
        yield from (f"| `{_cell(one.display_name_raw)}` | {_cell(one.help)} |" for one in given)
        yield from (f"| `{_cell(_option(one))}` | {_cell(one.help)}{_default(one)} |" for one in options)
        yield ""


def _option(option: TyperOption) -> str:
    value = option.display_type_rich(Context(TyperCommand("of", callback=None))) or ""
    return " ".join([", ".join(option.opts), value.strip("<>")]).strip()


def _default(option: TyperOption) -> str:
    if option.required:
        return " Required."
    return "" if option.default in {None, False} else f" Default: `{_cell(str(option.default))}`."


def _cell(text: str | None) -> str:
    return " ".join((text or "").split()).replace("|", "\\|")


def main() -> None:
    """Write what is not as it should be, and take away pages of verbs that are gone."""
    FOLDER.mkdir(exist_ok=True)
    written = pages()
    for path in FOLDER.glob("*.md"):
        if path.name not in written:
            path.unlink()
    for name, text in written.items():
        (FOLDER / name).write_text(text)
    print(f"{FOLDER}: {len(written)} pages")


if __name__ == "__main__":
    main()
