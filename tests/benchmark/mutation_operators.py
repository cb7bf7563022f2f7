"""What each kind of syntax is replaced by in a mutant, and which replacements could not matter."""

import ast
import copy
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

Above = tuple[ast.AST, ...]
Changed = ast.expr | ast.stmt | ast.keyword

_COMPARED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
# Only where whole numbers are compared: of two floats one is hardly ever the other.
_BOUNDARY: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
}
_ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
_OPPOSITES = [
    ("min", "max"),
    ("minimum", "maximum"),
    ("argmin", "argmax"),
    ("nanmin", "nanmax"),
    ("nanargmin", "nanargmax"),
    ("any", "all"),
    ("floor", "ceil"),
    ("sin", "cos"),
]
_OPPOSITE = dict(_OPPOSITES) | {second: first for first, second in _OPPOSITES}
# Functions of one number that a formula could have forgotten, and those that bound their first argument.
_LEFT_OUT = {"abs", "fabs", "sqrt", "log", "log1p", "log2", "exp", "expm1", "square", "wrap", "clip"}
# Where a number is a shape, another one is only an error that any test meets.
_SHAPED = {"reshape", "zeros", "ones", "empty", "eye", "transpose", "moveaxis", "swapaxes", "einsum", "tile", "slice"}
# Arguments and constants that say how something is computed, not what.
_WAYS = {"seed", "strict", "maxsize", "dtype", "kind", "copy", "stacklevel", "slots", "frozen"}
_PORTIONS = ("at_once", "chunk", "cache")
_REPEATS = ("iterations", "rounds")
# Smaller ones guard against zero and larger ones stand for infinity: twice as much is the same.
_TINY, _HUGE = 1e-5, 1e5
_LARGE_COUNT = 10


def alternatives(node: ast.AST, above: Above) -> Iterator[Changed]:
    """What a node becomes in mutants; `above` are the nodes around it, the nearest first."""
    if type(node) in _OPERATORS:
        yield from _OPERATORS[type(node)](node, above)
    if isinstance(node, ast.Name | ast.Attribute | ast.Call | ast.BoolOp) and _is_condition(node, above):
        yield ast.UnaryOp(ast.Not(), node)


def _comparisons(node: ast.Compare, _: Above) -> Iterator[ast.Compare]:
    values = [node.left, *node.comparators]
    for i, operator in enumerate(node.ops):
        whole = any(_is_count(value) for value in values[i : i + 2])
        others = [_COMPARED[type(operator)]]
        if whole and type(operator) in _BOUNDARY:
            others.append(_BOUNDARY[type(operator)])
        for other in others:
            changed = copy.copy(node)
            changed.ops = [*node.ops[:i], other(), *node.ops[i + 1 :]]
            yield changed


def _is_count(value: ast.expr) -> bool:
    if isinstance(value, ast.Call):
        return isinstance(value.func, ast.Name) and value.func.id == "len"
    return isinstance(value, ast.Constant) and type(value.value) is int


def _arithmetic(node: ast.BinOp, _: Above) -> Iterator[ast.expr]:
    if not (_is_number(node.left) and _is_number(node.right)) or type(node.op) not in _ARITHMETIC:
        return
    yield ast.BinOp(node.left, _ARITHMETIC[type(node.op)](), node.right)
    if isinstance(node.op, ast.Add | ast.Sub) and not _is_guard(node.right):
        yield node.left


def _is_number(value: ast.expr) -> bool:
    """False for what is a text, a list or a class for sure, as in `[a] + b` or `int | None`."""
    texts = ast.List | ast.Tuple | ast.JoinedStr | ast.Dict | ast.Set | ast.ListComp
    if isinstance(value, ast.Constant):
        return type(value.value) in {int, float}
    return not isinstance(value, texts) and not (
        isinstance(value, ast.Name) and value.id[0].isupper() and len(value.id) > 1
    )


def _is_guard(value: ast.expr) -> bool:
    return isinstance(value, ast.Constant) and isinstance(value.value, float) and abs(value.value) <= _TINY


def _conditions(node: ast.BoolOp, _: Above) -> Iterator[ast.expr]:
    other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
    yield ast.BoolOp(other, node.values)
    for i in range(len(node.values)):
        rest = [*node.values[:i], *node.values[i + 1 :]]
        yield rest[0] if len(rest) == 1 else ast.BoolOp(node.op, rest)


def _is_condition(node: ast.expr, above: Above) -> bool:
    """Whether it decides between branches, or what a comprehension takes."""
    if isinstance(above[0], ast.If | ast.IfExp):
        return above[0].test is node
    return isinstance(above[0], ast.comprehension) and node in above[0].ifs


def _signs(node: ast.UnaryOp, above: Above) -> Iterator[ast.expr]:
    if not isinstance(node.op, ast.UAdd) and not _is_aside(above):
        yield node.operand


def _constants(node: ast.Constant, above: Above) -> Iterator[ast.Constant]:
    if _is_aside(above):
        return
    name = _name_of(node, above)
    if name in _WAYS or any(part in name for part in _PORTIONS):
        return
    value = node.value
    if isinstance(value, bool):
        yield ast.Constant(not value)
    elif isinstance(value, int):
        yield from (ast.Constant(other) for other in (_other_count(value, name, above),) if other != value)
    elif isinstance(value, float) and (value == 0 or _TINY < value < _HUGE):
        yield ast.Constant(2 * value if value else 1.0)


def _other_count(value: int, name: str, above: Above) -> int:
    """A whole number that should matter: one repetition only, a neighbouring index, one more or twice as much."""
    if any(part in name for part in _REPEATS):
        return 1
    if _is_index(above):
        return value - 1 if value else 1
    return value + 1 if value < _LARGE_COUNT else 2 * value


def _axes(node: ast.keyword, _: Above) -> Iterator[ast.keyword]:
    if node.arg == "axis":
        yield ast.keyword("axis", ast.Constant(int(isinstance(node.value, ast.Constant) and node.value.value == 0)))


def _is_aside(above: Above) -> bool:
    """Whether it belongs to a shape or is an axis, which has an operator of its own."""
    if isinstance(above[0], ast.keyword):
        return above[0].arg == "axis"
    for inner, outer in pairwise((None, *above)):
        if isinstance(outer, ast.Call):
            return _called(outer) in _SHAPED and inner is not outer.func
        if not isinstance(outer, ast.Tuple | ast.List | ast.UnaryOp):
            return False
    return False


def _is_index(above: Above) -> bool:
    for outer in above:
        if isinstance(outer, ast.Subscript):
            return True
        if not isinstance(outer, ast.Tuple | ast.Slice | ast.UnaryOp):
            return False
    return False


def _name_of(node: ast.Constant, above: Above) -> str:
    """The lower-case name that a constant is given by an argument, a default or an assignment; empty without one."""
    match above[0]:
        case ast.keyword(arg=str(name)):
            return name.lower()
        case ast.AnnAssign(target=ast.Name(id=name)) | ast.Assign(targets=[ast.Name(id=name)]):
            return name.lower()
        case ast.arguments() as taken:
            plain = [*taken.posonlyargs, *taken.args]
            given = [*zip(reversed(plain), reversed(taken.defaults), strict=False)]
            given += [
                (own, default) for own, default in zip(taken.kwonlyargs, taken.kw_defaults, strict=True) if default
            ]
            return next(own.arg for own, default in given if default is node)
    return ""


def _calls(node: ast.Call, _: Above) -> Iterator[ast.expr]:
    name = _called(node)
    if name in _OPPOSITE:
        changed = copy.copy(node)
        changed.func = copy.copy(node.func)
        match changed.func:
            case ast.Name() as function:
                function.id = _OPPOSITE[name]
            case ast.Attribute() as function:
                function.attr = _OPPOSITE[name]
        yield changed
    if name in _LEFT_OUT and node.args:
        yield node.args[0]
    if name == "where" and len(node.args) == 3:
        test, first, second = node.args
        yield ast.Call(node.func, [test, second, first], node.keywords)


def _called(node: ast.Call) -> str:
    match node.func:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name
    return ""


def _updates(node: ast.AugAssign, _: Above) -> Iterator[ast.stmt]:
    if type(node.op) in _ARITHMETIC and _is_number(node.value):
        yield ast.AugAssign(node.target, _ARITHMETIC[type(node.op)](), node.value)
    yield ast.Pass()


def _statements(node: ast.Expr, _: Above) -> Iterator[ast.stmt]:
    if isinstance(node.value, ast.Call):
        yield ast.Pass()


def _jumps(node: ast.Break | ast.Continue, _: Above) -> Iterator[ast.stmt]:
    yield ast.Continue() if isinstance(node, ast.Break) else ast.Break()


_OPERATORS: dict[type[ast.AST], Callable[[Any, Above], Iterator[Changed]]] = {
    ast.Compare: _comparisons,
    ast.BinOp: _arithmetic,
    ast.BoolOp: _conditions,
    ast.UnaryOp: _signs,
    ast.Constant: _constants,
    ast.keyword: _axes,
    ast.Call: _calls,
    ast.AugAssign: _updates,
    ast.Expr: _statements,
    ast.Break: _jumps,
    ast.Continue: _jumps,
}
