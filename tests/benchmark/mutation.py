"""Single changes of a Python source that its tests should notice: where they can be made, and the changed text.

The operators are the usual ones of mutation testing (Offutt et al. 1996; Jia and Harman 2011): relations, arithmetic
and logic replaced, constants nudged, operands, conditions and statements left out, and calls for their opposites.
Annotations, decorators, texts, imports and what is raised stay as they are.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass

from tests.benchmark.mutation_operators import alternatives

_CLOSED_FIELDS = {"annotation", "returns", "decorator_list"}
_CLOSED_NODES = (ast.Raise, ast.JoinedStr, ast.Import, ast.ImportFrom)


@dataclass(frozen=True, slots=True)
class Mutant:
    """A change of one file: bytes `start` to `stop`, in lines `first` to `last`, become `text`; `line` is the first."""

    file: str
    first: int
    last: int
    start: int
    stop: int
    before: str
    after: str
    text: str
    line: str

    def __str__(self) -> str:
        return f"{self.file}:{self.first}  {self.before} -> {self.after}  in  {self.line}"

    @property
    def key(self) -> str:
        """A name that no other mutant of the same sources has."""
        return f"{self.file}:{self.start}:{self.stop}:{self.text}"

    def applied_to(self, source: str) -> str:
        """The source with this change."""
        raw = source.encode()
        return (raw[: self.start] + self.text.encode() + raw[self.stop :]).decode()


def mutants_of(source: str, file: str) -> list[Mutant]:
    """Every single change of a source, from its start to its end."""
    lines = source.encode().split(b"\n")
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line) + 1)
    found = []
    for node, above in _open_nodes(ast.parse(source), ()):
        for other in alternatives(node, above):
            text = ast.unparse(other)
            found.append(
                Mutant(
                    file,
                    node.lineno,
                    node.end_lineno or node.lineno,
                    starts[node.lineno - 1] + node.col_offset,
                    starts[(node.end_lineno or node.lineno) - 1] + (node.end_col_offset or 0),
                    ast.unparse(node),
                    text,
                    f"({text})" if isinstance(other, ast.expr) else text,
                    lines[node.lineno - 1].decode().strip(),
                )
            )
    return sorted(found, key=lambda mutant: (mutant.start, mutant.stop, mutant.text))


def _open_nodes(
    node: ast.AST, above: tuple[ast.AST, ...]
) -> Iterator[tuple[ast.stmt | ast.expr | ast.keyword, tuple[ast.AST, ...]]]:
    """What may be changed, each with the nodes around it, the nearest first."""
    if isinstance(node, _CLOSED_NODES) or _is_type_checking(node):
        return
    if isinstance(node, ast.stmt | ast.expr | ast.keyword):
        yield node, above
    for field, value in ast.iter_fields(node):
        if field not in _CLOSED_FIELDS:
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from _open_nodes(child, (node, *above))


def _is_type_checking(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
