"""Message definitions as people and tools wrote them, brought into the form that the parser takes."""

import re
from collections.abc import Iterator

_SEPARATOR = "=" * 80 + "\n"
_SECTION = re.compile(r"MSG:\s*(\S+)")
_CONSTANT = re.compile(r"[A-Z](?:_?[A-Z0-9])*")
_NUMBER = re.compile(r"[+-]?(?:0[xX][0-9a-fA-F]+|0b[01]+|\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)")
_EMPTY = frozenset({"", "*"})  # what publishers that do not know their type write


def decoded(data: bytes) -> str:
    """The text of a definition: UTF-8, or else Latin-1, without the mark that some editors put before it."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def is_empty(text: str) -> bool:
    """Whether a definition says nothing at all, not even in a comment."""
    return text.strip() in _EMPTY


def plain(text: str) -> str:
    """A definition with nothing but what matters: fields, constants that can be carried, and nested types.

    Line ends, comments, default values and odd spaces go; separators get the length that the parser wants.
    """
    lines = []
    for line in text.lstrip("\ufeff").splitlines():
        words = line.split("#", 1)[0].split()
        section = _SECTION.match(line.strip())
        if section:
            lines.append(f"{_SEPARATOR}MSG: {section[1]}\n")
        elif words and not _is_rule(words):
            lines.extend(_line(words, line.strip()))
    return "".join(lines)


def parts_of(text: str) -> list[str]:
    """The parts of a .srv or .action, which lines of three dashes tell apart."""
    parts: list[str] = []
    lines: list[str] = []
    for line in text.splitlines():
        if line.split("#", 1)[0].strip() == "---":
            parts.append("\n".join(lines))
            lines = []
        else:
            lines.append(line)
    return [*parts, "\n".join(lines)]


def _is_rule(words: list[str]) -> bool:
    return len(words) == 1 and set(words[0]) == {"="}


def _line(words: list[str], line: str) -> Iterator[str]:
    """A field or a constant; constants that the parser cannot take are left out, since messages do not hold them."""
    kind, rest = words[0], " ".join(words[1:])
    name, equals, value = rest.partition("=")
    if not equals or " " in name.strip() or not name.strip():  # a default value may hold the sign, too
        yield f"{kind} {name.split(' ')[0]}\n"
        return
    name, value = name.strip(), value.strip()
    if kind.startswith("string"):  # all that follows is its value, a # and what comes after it as well
        value = line[len(kind) :].partition("=")[2].strip().strip("\"'")
        value = "" if {"'", '"', "\\"} & {*value} else f"'\"{value}\"'"
    elif not (_NUMBER.fullmatch(value) or value.lower() in {"true", "false"}):
        value = ""
    if value and _CONSTANT.fullmatch(name):
        yield f"{kind} {name}={value}\n"
