"""Expressions of the subset, in C. Where C would round or convert otherwise, it is written out."""

from __future__ import annotations

import ast
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from types import FunctionType
from typing import Any, NamedTuple, NoReturn, get_type_hints

from tautwave.simulation.kernel.ctypes_of import (
    BOOL,
    FLOAT,
    INT,
    Number,
    Record,
    Table,
    Type,
    type_of,
)

MATH = {"sqrt", "exp", "log", "sin", "cos", "tan", "atan", "pow", "fabs"}
MATH_NUMBERS = {"pi": math.pi, "inf": math.inf, "nan": math.nan}
ARITHMETIC: dict[type[ast.operator], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*"}
COMPARISONS: dict[type[ast.cmpop], str] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}


class Value(NamedTuple):
    """A C expression and its type; a record's is its address."""

    text: str
    kind: Type


class Expressions(ABC):
    """Translates expressions; the names in them are looked up by the function around."""

    @abstractmethod
    def refuse(self, node: ast.AST, what: str) -> NoReturn:
        """Raise, naming the line."""

    @abstractmethod
    def look_up(self, name: str) -> Value | None:
        """Return a parameter or local variable."""

    @abstractmethod
    def constant(self, name: str) -> Any:
        """Return what a name means in the function's module, or None."""

    @abstractmethod
    def call(self, node: ast.Call, function: Callable[..., Any], given: list[Value]) -> Value:
        """Return a call of another function of the subset."""

    def expression(self, node: ast.expr) -> Value:
        """Return an expression in C."""
        match node:
            case ast.Constant(value=value):
                return self._literal(node, value)
            case ast.Name(id=name):
                return self._name(node, name)
            case ast.Attribute(value=ast.Name(id="math"), attr=name):
                return self._literal(node, MATH_NUMBERS.get(name))
            case ast.Attribute(value=owner, attr=name):
                return self._member(node, self.expression(owner), name)
            case ast.Subscript(value=owner, slice=index):
                return self._element(node, self.expression(owner), self.expression(index))
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return Value(f"(!{self.condition(operand)})", BOOL)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                number = self.expression(operand)
                self._number(node, number)
                return Value(f"(-{number.text})", number.kind)
            case ast.BinOp(left=left, op=operator, right=right):
                return self._binary(node, self.expression(left), operator, self.expression(right))
            case ast.BoolOp(op=operator, values=values):
                sign = " && " if isinstance(operator, ast.And) else " || "
                return Value(f"({sign.join(self.condition(value) for value in values)})", BOOL)
            case ast.Compare():
                return self._compare(node)
            case ast.IfExp(test=test, body=body, orelse=orelse):
                one, other = self.expression(body), self.expression(orelse)
                kind = self._common(node, one, other)
                return Value(f"({self.condition(test)} ? {one.text} : {other.text})", kind)
            case ast.Call(func=function, args=arguments, keywords=[]):
                return self._call(node, function, arguments)
            case _:
                self.refuse(node, f"an expression {type(node).__name__}")

    def condition(self, node: ast.expr) -> str:
        """Return an expression that has to be true or false."""
        value = self.expression(node)
        if value.kind != BOOL:
            self.refuse(node, "a number or record as a condition")
        return value.text

    def same(self, node: ast.AST, value: Value, kind: Number) -> str:
        """Return a value for a place of a type; Python would keep the type of the value."""
        if value.kind != kind:
            self.refuse(node, f"a {value.kind} where a {kind.c} was")
        return value.text

    def converted(self, node: ast.AST, value: Value, kind: Number) -> str:
        """Return a number for a place of a type; whole numbers pass as floats."""
        if value.kind == INT and kind == FLOAT:
            return f"(double){value.text}"
        return self.same(node, value, kind)

    # -- kinds of expressions ------------------------------------------------------------------

    def _literal(self, node: ast.AST, value: Any) -> Value:
        if value is True or value is False:
            return Value("true" if value else "false", BOOL)
        if isinstance(value, int):
            return Value(f"INT64_C({value})", INT)
        if not isinstance(value, float):
            self.refuse(node, f"the value {value!r}")
        if math.isnan(value):
            return Value("((double)NAN)", FLOAT)
        if math.isinf(value):
            return Value(f"({'-' if value < 0 else ''}(double)INFINITY)", FLOAT)
        return Value(value.hex() if value >= 0.0 else f"({value.hex()})", FLOAT)

    def _name(self, node: ast.AST, name: str) -> Value:
        known = self.look_up(name)
        if known is not None:
            return known
        value = self.constant(name)
        if not isinstance(value, int | float):
            self.refuse(node, f"the name {name}")
        return self._literal(node, value)

    def _member(self, node: ast.AST, owner: Value, name: str) -> Value:
        if not isinstance(owner.kind, Record):
            self.refuse(node, f".{name} of what is no record")
        hint = get_type_hints(owner.kind.of).get(name)
        if hint is None:
            self.refuse(node, f"{owner.kind.of.__name__} without a field {name}, so .{name}")
        kind = type_of(hint, name)
        text = f"{owner.text}->m_{name}"
        return Value(f"(&{text})" if isinstance(kind, Record) else text, kind)

    def _element(self, node: ast.AST, owner: Value, index: Value) -> Value:
        if not isinstance(owner.kind, Table) or index.kind != INT:
            self.refuse(node, "an index here")
        text = f"{owner.text}[{index.text}]"
        kind = owner.kind.of
        return Value(f"(&{text})" if isinstance(kind, Record) else text, kind)

    def _binary(self, node: ast.AST, left: Value, operator: ast.operator, right: Value) -> Value:
        kind = self._common(node, left, right)
        if kind == BOOL:
            self.refuse(node, "arithmetic with conditions")
        if type(operator) in ARITHMETIC:
            return Value(f"({left.text} {ARITHMETIC[type(operator)]} {right.text})", kind)
        if isinstance(operator, ast.Div):
            return Value(f"((double){left.text} / (double){right.text})", FLOAT)
        if isinstance(operator, ast.Mod | ast.FloorDiv) and kind == INT:
            # C rounds towards zero, Python down: the same for what is never negative, and
            # in this subset such numbers are counts and codes.
            sign = "%" if isinstance(operator, ast.Mod) else "/"
            return Value(f"({left.text} {sign} {right.text})", INT)
        self.refuse(node, f"the operator {type(operator).__name__} here")

    def _compare(self, node: ast.Compare) -> Value:
        values = [self.expression(part) for part in (node.left, *node.comparators)]
        parts = []
        for left, operator, right in zip(values, node.ops, values[1:], strict=False):
            if type(operator) not in COMPARISONS:
                self.refuse(node, f"the comparison {type(operator).__name__}")
            self._common(node, left, right)
            parts.append(f"{left.text} {COMPARISONS[type(operator)]} {right.text}")
        return Value(f"({' && '.join(parts)})", BOOL)

    def _call(self, node: ast.Call, called: ast.expr, arguments: list[ast.expr]) -> Value:
        given = [self.expression(argument) for argument in arguments]
        match called:
            case ast.Attribute(value=ast.Name(id="math"), attr="isnan"):
                return Value(f"isnan({self.converted(node, given[0], FLOAT)})", BOOL)
            case ast.Attribute(value=ast.Name(id="math"), attr="floor"):
                return Value(f"((int64_t)floor({self.converted(node, given[0], FLOAT)}))", INT)
            case ast.Attribute(value=ast.Name(id="math"), attr=name) if name in MATH:
                parts = ", ".join(self.converted(node, value, FLOAT) for value in given)
                return Value(f"{name}({parts})", FLOAT)
            case ast.Name(id="float") if len(given) == 1:
                self._number(node, given[0])
                return Value(f"((double){given[0].text})", FLOAT)
            case ast.Name(id=name):
                function = self.constant(name)
                if isinstance(function, FunctionType):
                    return self.call(node, function, given)
        self.refuse(node, f"a call of {ast.unparse(called)}")

    def _number(self, node: ast.AST, value: Value) -> None:
        if not isinstance(value.kind, Number):
            self.refuse(node, "arithmetic with a record, a table or several results")

    def _common(self, node: ast.AST, left: Value, right: Value) -> Number:
        if not (isinstance(left.kind, Number) and isinstance(right.kind, Number)):
            self.refuse(node, "arithmetic with a record, a table or several results")
        if left.kind == right.kind:
            return left.kind
        if BOOL in (left.kind, right.kind):
            self.refuse(node, "a condition together with a number")
        return FLOAT
