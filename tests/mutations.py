"""Single-point mutations of a source text."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from typing import NamedTuple

COMPARE = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==",
    ast.Is: "is not", ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in",
}  # fmt: skip
BINARY = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.FloorDiv: "*", ast.Mod: "+",
    ast.BitAnd: "|", ast.BitOr: "&", ast.LShift: ">>", ast.RShift: "<<",
}  # fmt: skip


class Mutant(NamedTuple):
    """One change: `new` in place of the characters from `start` to `end` of a file."""

    path: str
    line: int
    start: int
    end: int
    new: str
    what: str


def mutants_of(path: str, text: str) -> Iterator[Mutant]:
    """Yield every single-point mutation of a source text that a run could see.

    Annotations, docstrings, messages of exceptions and what only type checkers read are left alone.
    """
    tree = ast.parse(text)
    data = text.encode()
    starts = [0]
    for row in data.split(b"\n"):
        starts.append(starts[-1] + len(row) + 1)
    skipped: set[ast.AST] = set()

    def at(line: int, column: int) -> int:
        return starts[line - 1] + column

    def change(node: ast.expr | ast.stmt, new: str, what: str) -> Mutant:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        start = at(node.lineno, node.col_offset)
        end = at(node.end_lineno, node.end_col_offset)
        return Mutant(path, node.lineno, start, end, new, what)

    def source(node: ast.expr) -> str:
        one = change(node, "", "")
        return data[one.start : one.end].decode()

    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in source(node.test):
            skipped.update(ast.walk(node))
        if isinstance(node, ast.Raise):
            skipped.update(ast.walk(node))
        for field in ("annotation", "returns"):
            if getattr(node, field, None) is not None:
                skipped.update(ast.walk(getattr(node, field)))
    for node in ast.walk(tree):
        if node in skipped:
            continue
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            new = COMPARE[type(node.ops[0])]
            left, right = source(node.left), source(node.comparators[0])
            yield change(node, f"({left}) {new} ({right})", f"comparison becomes {new}")
        elif isinstance(node, ast.BinOp) and type(node.op) in BINARY:
            new = BINARY[type(node.op)]
            yield change(
                node, f"(({source(node.left)}) {new} ({source(node.right)}))", f"becomes {new}"
            )
        elif isinstance(node, ast.BoolOp):
            new = " or " if isinstance(node.op, ast.And) else " and "
            parts = new.join(f"({source(value)})" for value in node.values)
            yield change(node, f"({parts})", f"becomes{new.rstrip()}")
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
            yield change(node, f"({source(node.operand)})", "sign or not is left out")
        elif isinstance(node, ast.Constant):
            if isinstance(node.value, bool):
                yield change(node, str(not node.value), "constant is inverted")
            elif isinstance(node.value, int):
                yield change(node, str(node.value + 1), "constant is one more")
            elif isinstance(node.value, float):
                yield change(node, repr(1.1 * node.value + 0.01), "constant is a tenth more")
        elif isinstance(node, ast.If | ast.While | ast.IfExp):
            yield change(node.test, f"(not ({source(node.test)}))", "condition is negated")
        elif isinstance(node, ast.AugAssign) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
        ):
            yield change(node, "pass", "statement is left out")
