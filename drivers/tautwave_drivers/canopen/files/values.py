"""Numbers and bytes in EDS and DCF files: CiA 306 notation, as vendors write it."""

from __future__ import annotations

import ast
import math
import re
import struct

BOOLEAN, REAL32, REAL64 = 0x01, 0x08, 0x11
VISIBLE_STRING, OCTET_STRING, UNICODE_STRING, DOMAIN = 0x09, 0x0A, 0x0B, 0x0F
TEXTS = (VISIBLE_STRING, OCTET_STRING, UNICODE_STRING, DOMAIN)
SIGNED = {0x02: 8, 0x03: 16, 0x10: 24, 0x04: 32, 0x12: 40, 0x13: 48, 0x14: 56, 0x15: 64}
UNSIGNED = {0x05: 8, 0x06: 16, 0x16: 24, 0x07: 32, 0x18: 40, 0x19: 48, 0x1A: 56, 0x1B: 64}
"""Data types of CiA 301 (7.4.7) to their bits."""

TYPE_NAMES = {
    BOOLEAN: "BOOLEAN", REAL32: "REAL32", REAL64: "REAL64", VISIBLE_STRING: "VISIBLE_STRING",
    OCTET_STRING: "OCTET_STRING", UNICODE_STRING: "UNICODE_STRING", DOMAIN: "DOMAIN",
    **{kind: f"INTEGER{bits}" for kind, bits in SIGNED.items()},
    **{kind: f"UNSIGNED{bits}" for kind, bits in UNSIGNED.items()},
}  # fmt: skip

TYPES = {
    "BOOL": BOOLEAN, "STR": VISIBLE_STRING,
    **{f"I{bits}": kind for kind, bits in SIGNED.items()},
    **{f"U{bits}": kind for kind, bits in UNSIGNED.items()},
}  # fmt: skip
"""Data types by the names of `Entry`."""

LONGEST_NUMBER = 100
"""Characters; a sum of COB-ID and node id needs some 40."""
_TOKEN = re.compile(r"0x[0-9a-f]+|[0-9][0-9a-f]*h\b|[0-9]\w*|[a-z_$]\w*", re.IGNORECASE)
_ALLOWED = re.compile(r"[0-9+\-*|<()\s]+")
_WIDEST = 64


class UnreadableError(ValueError):
    """A value that is not a number, or does not fit its type; the message says why."""


def bare(text: str) -> str:
    """Return a value without the comment behind it and the quotes around it."""
    text = re.split(r";|//", text, maxsplit=1)[0].strip()
    if len(text) > 1 and text[0] == text[-1] and text[0] in "\"'":
        text = text[1:-1].strip()
    return text


def number(text: str, node_id: int | None = None) -> int:
    """Return the integer in `text`.

    CiA 306 has decimal, `0x` and octal numbers (a leading 0) and `$NODEID`, by which a number is
    counted from the node id. Vendors write 64h, quotes, `$NodeID` in any place and `|` for `+`.

    Raises
    ------
    UnreadableError
        It is none, or needs a node id that was not given.
    """
    text = bare(text)
    if not text or len(text) > LONGEST_NUMBER or not text.isascii():
        raise UnreadableError("not a number" if text else "nothing")

    def decimal(found: re.Match[str]) -> str:
        token = found[0].lower()
        if token == "$nodeid":
            if node_id is None:
                raise UnreadableError("counted from a node id")
            return str(node_id)
        if not token.isalnum():
            raise UnreadableError(_why(text))
        try:
            if token.startswith("0x"):
                return str(int(token, 16))
            if token.endswith("h"):
                return str(int(token[:-1], 16))
            return str(int(token, 8 if token[0] == "0" and token.isdigit() else 10))
        except ValueError:
            raise UnreadableError(_why(text)) from None

    plain = _TOKEN.sub(decimal, text)
    if not _ALLOWED.fullmatch(plain):
        raise UnreadableError(_why(text))
    try:
        value = _sum(ast.parse(plain.strip(), mode="eval").body)
    except (SyntaxError, RecursionError, MemoryError):
        raise UnreadableError(_why(text)) from None
    if value.bit_length() > _WIDEST:
        raise UnreadableError("longer than 64 bits")
    return value


def _why(text: str) -> str:
    if re.fullmatch(r"[+-]?\d*,\d+", text):
        return "a decimal comma"
    if re.fullmatch(r"0\d+", text):
        return "no octal number, as its leading 0 would make it by CiA 306"
    return "not a number"


def _sum(node: ast.expr) -> int:
    """Return the value of sums, products and shifts of integers."""
    if isinstance(node, ast.Constant) and isinstance(node.value, int):
        return node.value
    if isinstance(node, ast.UnaryOp):
        if isinstance(node.op, ast.USub):
            return -_sum(node.operand)
        if isinstance(node.op, ast.UAdd):
            return _sum(node.operand)
    if isinstance(node, ast.BinOp):
        left, right = _sum(node.left), _sum(node.right)
        if isinstance(node.op, ast.Add):
            return left + right
        if isinstance(node.op, ast.Sub):
            return left - right
        if isinstance(node.op, ast.BitOr):
            return left | right
        if isinstance(node.op, ast.Mult):
            return left * right
        if isinstance(node.op, ast.LShift) and 0 <= right < _WIDEST:
            return left << right
    raise UnreadableError("not a number")


def integer(text: str | None, node_id: int | None = None) -> int | None:
    """Return the integer in a field that may be blank or odd: None where there is none."""
    try:
        return None if text is None else number(text, node_id)
    except UnreadableError:
        return None


def encode(text: str, kind: int | None, node_id: int) -> bytes:
    """Return a value as the bytes of its data type, little endian (CiA 301, 7.1.4).

    Raises
    ------
    UnreadableError
        It cannot be read, or does not fit.
    """
    if kind in (VISIBLE_STRING, UNICODE_STRING):
        return text.encode("utf-16-le" if kind == UNICODE_STRING else "latin-1", "replace")
    if kind in (OCTET_STRING, DOMAIN):
        try:
            return bytes.fromhex(re.sub(r"\s|0x", "", bare(text)))
        except ValueError:
            raise UnreadableError("not bytes in hexadecimal") from None
    if kind in (REAL32, REAL64):
        return _real(text, kind)
    if kind is None:
        raise UnreadableError("of an object without a DataType")
    bits = 1 if kind == BOOLEAN else SIGNED.get(kind) or UNSIGNED.get(kind)
    if bits is None:
        raise UnreadableError(f"of the data type 0x{kind:04X}, whose values are not read here")
    value = number(text, node_id)
    signed = kind in SIGNED
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    if signed and high < value < 1 << bits and re.match(r"0x|.*h$", bare(text), re.IGNORECASE):
        value -= 1 << bits  # two's complement, as it is on the bus
    if not low <= value <= high:
        raise UnreadableError(f"outside {TYPE_NAMES[kind]} ({low} to {high})")
    return value.to_bytes((bits + 7) // 8, "little", signed=signed)


def _real(text: str, kind: int) -> bytes:
    plain = bare(text)
    try:
        value = float("" if "_" in plain else plain)
        data = struct.pack("<f" if kind == REAL32 else "<d", value)
    except ValueError:
        raise UnreadableError(_why(plain)) from None
    except OverflowError:
        raise UnreadableError("outside REAL32") from None
    if not math.isfinite(value):
        raise UnreadableError("no finite number")
    return data
