"""Types of the subset that laws, models and kernel are written in, and what C calls them."""

from __future__ import annotations

import collections.abc
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

from tautwave.contracts import Row
from tautwave.errors import ConfigError


class TranslationError(ConfigError):
    """A function is not written in the subset that has a translation to C."""


class Number(NamedTuple):
    """`double`, `int64_t` or `bool`."""

    c: str


class Record(NamedTuple):
    """A NamedTuple or a class of annotated numbers; handed over by its address."""

    of: type[Any]

    @property
    def c(self) -> str:
        """Name of the struct."""
        return f"R_{self.of.__name__}"


class Table(NamedTuple):
    """A sequence of numbers or records."""

    of: Number | Record


class Tuple(NamedTuple):
    """What a function with several results returns."""

    of: tuple[Number, ...]

    @property
    def c(self) -> str:
        """Name of the struct."""
        return "T_" + "".join(part.c[0] for part in self.of)


class Nothing(NamedTuple):
    """No result."""

    c: str = "void"


Type = Number | Record | Table | Tuple | Nothing

FLOAT = Number("double")
INT = Number("int64_t")
BOOL = Number("bool")
NUMBERS: dict[Any, Number] = {float: FLOAT, int: INT, bool: BOOL}
SEQUENCES = (collections.abc.Sequence, collections.abc.MutableSequence)


def type_of(hint: Any, where: str) -> Type:
    """Return the type behind an annotation; `where` is named if there is none."""
    if hint in NUMBERS:
        return NUMBERS[hint]
    if hint is type(None):
        return Nothing()
    if hint is Row:
        return Table(FLOAT)
    if get_origin(hint) in SEQUENCES:
        inner = type_of(get_args(hint)[0], where)
        if isinstance(inner, Number | Record):
            return Table(inner)
    if get_origin(hint) is tuple:
        parts = [type_of(part, where) for part in get_args(hint)]
        numbers = tuple(part for part in parts if isinstance(part, Number))
        if len(numbers) == len(parts):
            return Tuple(numbers)
    if isinstance(hint, type) and get_type_hints(hint):
        return Record(hint)
    raise TranslationError(f"{where}: the type {hint!r} has no translation to C")


def handed(kind: Type, alone: bool = False) -> str:
    """Return how C writes a parameter of a type; `alone`: no other table shares its memory."""
    if isinstance(kind, Table):
        return f"{kind.of.c} *{'restrict ' if alone else ''}"
    if isinstance(kind, Record):
        return f"{kind.c} *"
    return f"{kind.c} "


def struct_text(record: Record, where: str) -> str:
    """Return the C struct of a record; fields in order, as NumPy lays out aligned records."""
    lines = []
    for name, hint in get_type_hints(record.of).items():
        kind = type_of(hint, f"{where}, {record.of.__name__}.{name}")
        if not isinstance(kind, Number | Record):
            raise TranslationError(f"{where}: {record.of.__name__}.{name} is no number or record")
        lines.append(f"    {kind.c} m_{name};")
    return "typedef struct {\n" + "\n".join(lines) + f"\n}} {record.c};\n"


def tuple_text(kind: Tuple) -> str:
    """Return the C struct of several results."""
    members = " ".join(f"{part.c} _{index};" for index, part in enumerate(kind.of))
    return f"typedef struct {{ {members} }} {kind.c};\n"
