"""Laws, models and kernel as one C file: a translation of the Python text, statement by statement.

It takes the subset they are written in (see `laws/__init__`): numbers, records, tables, tuples as
results, `if`, `while`, `for .. in range`, arithmetic, comparisons, `math` and calls of functions of
the same kind. Anything else is an error that names file and line. Built for checks and benchmarks.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn, get_type_hints

from tautwave.simulation.kernel.cexpr import Expressions, Value
from tautwave.simulation.kernel.ctypes_of import (
    INT,
    Nothing,
    Number,
    Record,
    Table,
    TranslationError,
    Tuple,
    Type,
    handed,
    struct_text,
    tuple_text,
    type_of,
)

HEAD = """\
/* Translated from Python by tautwave.simulation.kernel.ctext; compile with -ffp-contract=off. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
"""


def translate(entry: Callable[..., Any]) -> str:
    """Return C for `entry`, exported under its own name, and for every function it needs.

    No two tables handed to `entry` may overlap: the compiler is told that they do not.

    Raises
    ------
    TranslationError
        Something is not in the subset; the sentence names file, line and what it is.
    """
    unit = Unit(entry)
    unit.need(entry)
    bodies = []
    while unit.waiting:
        bodies.append(Function(unit, unit.waiting.pop(0)).text())
    first = unit.signature(entry).replace("static ", "", 1)
    first = first.replace(unit.names[entry], entry.__name__, 1)
    last = f"{first} {{\n    return {unit.names[entry]}({unit.arguments(entry)});\n}}\n"
    prototypes = "".join(unit.signature(function) + ";\n" for function in unit.names)
    return "\n".join([HEAD, *unit.structs.values(), prototypes, *bodies, last])


class Unit:
    """What the C file holds so far: structs in order of need, and functions."""

    def __init__(self, entry: Callable[..., Any]) -> None:
        self._entry = entry
        self.structs: dict[str, str] = {}
        self.names: dict[Callable[..., Any], str] = {}
        self.waiting: list[Callable[..., Any]] = []

    def need(self, function: Callable[..., Any]) -> str:
        """Return the C name of a function, and have it translated."""
        if function not in self.names:
            module = function.__module__.rpartition(".")[2]
            self.names[function] = f"f_{module}_{function.__name__}"
            self.waiting.append(function)
            for kind in (*self.parameters(function).values(), self.result(function)):
                self._need_type(kind, function.__name__)
        return self.names[function]

    def parameters(self, function: Callable[..., Any]) -> dict[str, Type]:
        """Return the types of a function's parameters."""
        hints = get_type_hints(function)
        names = list(inspect.signature(function).parameters)
        for name in names:
            if name not in hints:
                raise TranslationError(f"{function.__name__}: parameter {name} has no annotation")
        return {name: type_of(hints[name], f"{function.__name__}({name})") for name in names}

    def result(self, function: Callable[..., Any]) -> Type:
        """Return the type of what a function returns."""
        hints = get_type_hints(function)
        return type_of(hints.get("return", type(None)), f"result of {function.__name__}")

    def signature(self, function: Callable[..., Any]) -> str:
        """Return the head of the C function."""
        alone = function is self._entry
        parts = [
            f"{handed(kind, alone)}v_{name}" for name, kind in self.parameters(function).items()
        ]
        result = self.result(function)
        if isinstance(result, Record | Table):
            raise TranslationError(f"{function.__name__}: returns a record; give back its numbers")
        return f"static {result.c} {self.names[function]}({', '.join(parts)})"

    def arguments(self, function: Callable[..., Any]) -> str:
        """Return the parameters, to hand them on."""
        return ", ".join(f"v_{name}" for name in self.parameters(function))

    def _need_type(self, kind: Type, where: str) -> None:
        if isinstance(kind, Table):
            self._need_type(kind.of, where)
        elif isinstance(kind, Tuple):
            self.structs.setdefault(kind.c, tuple_text(kind))
        elif isinstance(kind, Record) and kind.c not in self.structs:
            for hint in get_type_hints(kind.of).values():
                self._need_type(type_of(hint, where), where)
            self.structs[kind.c] = struct_text(kind, where)


class Function(Expressions):
    """One function on its way to C."""

    def __init__(self, unit: Unit, function: Callable[..., Any]) -> None:
        source, first = inspect.getsourcelines(function)
        tree = ast.parse("".join(source)).body[0]
        assert isinstance(tree, ast.FunctionDef)
        self._unit = unit
        self._function = function
        self._tree = tree
        self._first = first
        self._file = Path(inspect.getsourcefile(function) or "?").name
        self._globals: dict[str, Any] = getattr(function, "__globals__", {})
        self._parameters = unit.parameters(function)
        self._result = unit.result(function)
        self._locals: dict[str, Type] = {}
        self._lines: list[str] = []
        self._depth = 1
        self._serial = 0

    def text(self) -> str:
        """Return the whole C function."""
        if self._tree.decorator_list:
            self.refuse(self._tree, "a decorator")
        self._block(self._tree.body)
        declared = [
            f"    {handed(kind)}v_{name};" for name, kind in self._locals.items() if name != "_"
        ]
        head = self._unit.signature(self._function)
        return "\n".join([f"{head} {{", *declared, *self._lines, "}\n"])

    # -- what expressions ask for ------------------------------------------------------------

    def refuse(self, node: ast.AST, what: str) -> NoReturn:
        """Raise, naming file and line."""
        line = self._first + getattr(node, "lineno", 1) - 1
        raise TranslationError(f"{self._file}:{line}: {what} has no translation to C")

    def look_up(self, name: str) -> Value | None:
        """Return a parameter or local variable."""
        kind = self._locals.get(name) or self._parameters.get(name)
        return None if kind is None else Value(f"v_{name}", kind)

    def constant(self, name: str) -> Any:
        """Return what a name means in the function's module, or None."""
        return self._globals.get(name)

    def call(self, node: ast.Call, function: Callable[..., Any], given: list[Value]) -> Value:
        """Return a call of another function, which is translated as well."""
        wanted = self._unit.parameters(function)
        if len(wanted) != len(given):
            self.refuse(node, f"a call of {function.__name__} with {len(given)} arguments")
        parts = []
        for value, kind in zip(given, wanted.values(), strict=True):
            if isinstance(kind, Number):
                parts.append(self.converted(node, value, kind))
            elif value.kind != kind:
                self.refuse(node, f"a {value.kind} where {function.__name__} takes {kind}")
            else:
                parts.append(value.text)
        name = self._unit.need(function)
        return Value(f"{name}({', '.join(parts)})", self._unit.result(function))

    # -- statements --------------------------------------------------------------------------

    def _write(self, line: str) -> None:
        self._lines.append("    " * self._depth + line)

    def _block(self, statements: list[ast.stmt]) -> None:
        for statement in statements:
            self._statement(statement)

    def _inner(self, statements: list[ast.stmt]) -> None:
        self._depth += 1
        self._block(statements)
        self._depth -= 1

    def _statement(self, node: ast.stmt) -> None:
        match node:
            case ast.Expr(value=ast.Constant(value=str())) | ast.Pass():
                pass
            case ast.Expr(value=ast.Call() as call):
                self._write(f"{self.expression(call).text};")
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=value):
                self._assign_several(node, targets, value)
            case ast.Assign(targets=[target], value=value):
                self._assign(node, target, self.expression(value))
            case ast.AugAssign(target=target, op=operator, value=value):
                read = ast.copy_location(ast.parse(ast.unparse(target), mode="eval").body, node)
                both = ast.BinOp(left=read, op=operator, right=value)
                self._assign(node, target, self.expression(ast.copy_location(both, node)))
            case ast.Return(value=value):
                self._return(node, value)
            case ast.If(test=test, body=body, orelse=orelse):
                self._write(f"if ({self.condition(test)}) {{")
                self._inner(body)
                if orelse:
                    self._write("} else {")
                    self._inner(orelse)
                self._write("}")
            case ast.While(test=test, body=body, orelse=[]):
                self._write(f"while ({self.condition(test)}) {{")
                self._inner(body)
                self._write("}")
            case ast.For(target=ast.Name(id=name), iter=ast.Call() as call, body=body, orelse=[]):
                self._for(node, name, call, body)
            case ast.Break():
                self._write("break;")
            case ast.Continue():
                self._write("continue;")
            case _:
                self.refuse(node, f"a statement {type(node).__name__}")

    def _for(self, node: ast.stmt, name: str, call: ast.Call, body: list[ast.stmt]) -> None:
        if not (isinstance(call.func, ast.Name) and call.func.id == "range" and not call.keywords):
            self.refuse(node, "a loop over something else than range")
        ends = [self.converted(node, self.expression(end), INT) for end in call.args]
        if len(ends) > 2:
            self.refuse(node, "a range with a step")
        low, high = ("0", ends[0]) if len(ends) == 1 else ends
        self._serial += 1
        at, end = f"k{self._serial}", f"n{self._serial}"
        # The counter is not the variable: Python's may be changed inside, or read after.
        self._write(f"for (int64_t {at} = {low}, {end} = {high}; {at} < {end}; {at}++) {{")
        self._depth += 1
        if name != "_":
            self._assign(node, ast.Name(id=name), Value(at, INT))
        self._block(body)
        self._depth -= 1
        self._write("}")

    def _assign(self, node: ast.stmt, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            if target.id == "_":
                return
            known = self._locals.get(target.id) or self._parameters.get(target.id)
            if known is None:
                if isinstance(value.kind, Tuple | Nothing):
                    self.refuse(node, "keeping several results in one name")
                known = self._locals[target.id] = value.kind
            if isinstance(known, Number):
                self._write(f"v_{target.id} = {self.same(node, value, known)};")
            elif known == value.kind:
                self._write(f"v_{target.id} = {value.text};")
            else:
                self.refuse(node, f"another type for {target.id}")
            return
        place = self.expression(target)
        if not isinstance(place.kind, Number):
            self.refuse(node, "assigning a record or a table")
        self._write(f"{place.text} = {self.same(node, value, place.kind)};")

    def _assign_several(self, node: ast.stmt, targets: list[ast.expr], value: ast.expr) -> None:
        if isinstance(value, ast.Tuple):
            parts = [self.expression(part) for part in value.elts]
        else:
            whole = self.expression(value)
            if not isinstance(whole.kind, Tuple):
                self.refuse(node, "taking apart what is no tuple")
            self._serial += 1
            self._write(f"{whole.kind.c} t{self._serial} = {whole.text};")
            parts = [
                Value(f"t{self._serial}._{index}", kind) for index, kind in enumerate(whole.kind.of)
            ]
        if len(parts) != len(targets):
            self.refuse(node, f"{len(parts)} values for {len(targets)} names")
        if isinstance(value, ast.Tuple):
            held = []
            for part in parts:  # all are read before the first is written
                if not isinstance(part.kind, Number):
                    self.refuse(node, "several records or tables at once")
                self._serial += 1
                self._write(f"{part.kind.c} t{self._serial} = {part.text};")
                held.append(Value(f"t{self._serial}", part.kind))
            parts = held
        for target, part in zip(targets, parts, strict=True):
            self._assign(node, target, part)

    def _return(self, node: ast.stmt, value: ast.expr | None) -> None:
        result = self._result
        if value is None or isinstance(result, Nothing):
            self._write("return;")
        elif isinstance(value, ast.Tuple) and isinstance(result, Tuple):
            if len(value.elts) != len(result.of):
                self.refuse(node, f"{len(value.elts)} results instead of {len(result.of)}")
            parts = [
                self.same(node, self.expression(part), kind)
                for part, kind in zip(value.elts, result.of, strict=True)
            ]
            self._write(f"return ({result.c}){{{', '.join(parts)}}};")
        else:
            given = self.expression(value)
            if isinstance(result, Number):
                self._write(f"return {self.same(node, given, result)};")
            elif given.kind == result:
                self._write(f"return {given.text};")
            else:
                self.refuse(node, "a result of another type")
