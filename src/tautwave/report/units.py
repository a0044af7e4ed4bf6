"""Numbers formatted for people: engineering prefixes, powers of ten, counts.

A value that is missing (`None`) is "not recorded"; it is never shown as zero.
"""

from __future__ import annotations

import math
from typing import Any

MISSING = "not recorded"
THIN = "\N{NARROW NO-BREAK SPACE}"
_PREFIXES = (
    (1e9, "G"),
    (1e6, "M"),
    (1e3, "k"),
    (1.0, ""),
    (1e-3, "m"),
    (1e-6, "µ"),
    (1e-9, "n"),
    (1e-12, "p"),
)
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: Any) -> float | None:
    """`value` as a float, or None if it is missing or not a number."""
    if value is None or isinstance(value, bool):
        return None
    try:
        return float(value)
    except (TypeError, ValueError):
        return None


def scale_for(peak: float, unit: str) -> tuple[float, str]:
    """Factor and prefixed unit in which `peak` [unit] reads as 1 to 1000.

    Returns
    -------
    tuple[float, str]
        Multiply by the factor to get the number that belongs to the unit.
    """
    size = abs(peak)
    if not math.isfinite(size) or size == 0.0 or unit == "" or unit.startswith("√"):
        return 1.0, unit
    for weight, prefix in _PREFIXES:
        # There is no krad; and beyond kilometres no length.
        if weight > 1.0 and (unit in ("rad", "s", "rad/s") or (unit == "m" and weight > 1e3)):
            continue
        if size >= 0.9995 * weight:
            return 1.0 / weight, prefix + unit
    return 1.0 / _PREFIXES[-1][0], _PREFIXES[-1][1] + unit


def significant(value: float, digits: int = 4) -> str:
    """`value` to `digits` significant digits, with a real minus sign and powers of ten."""
    if math.isnan(value):
        return "undefined"
    if math.isinf(value):
        return "infinite" if value > 0 else "−infinite"
    text = f"{value:.{digits}g}"
    if "e+" in text and abs(value) < 1e4:  # 520 to two digits, not 5.2 x 10^2
        text = f"{float(text):.0f}"
    elif "e" in text:
        mantissa, exponent = text.split("e")
        text = f"{mantissa}{THIN}×{THIN}10{str(int(exponent)).translate(_SUPERSCRIPT)}"
    return text.replace("-", "−")


def quantity(value: Any, unit: str, digits: int = 4) -> str:
    """`value` [unit, SI] with an engineering prefix, as in `12.34 mrad`."""
    plain = number(value)
    if plain is None:
        return MISSING
    if not math.isfinite(plain):
        return significant(plain)
    if 0.0 < abs(plain) < 1e-13 and unit != "":
        return f"{significant(plain, 2)}{THIN}{unit}"
    factor, label = scale_for(plain, unit)
    return f"{significant(plain * factor, digits)}{THIN}{label}".rstrip(THIN)


def within(value: float, half: float, digits: int = 3) -> str:
    """`value ± half`: at least `digits` digits, and as many as the interval resolves."""
    if value and 0.0 < half < abs(value):
        digits = max(digits, math.floor(math.log10(abs(value))) - math.floor(math.log10(half)) + 2)
    return f"{significant(value, digits)} ± {significant(half, 2)}"


def microseconds(value: Any, digits: int = 4) -> str:
    """`value` [us] with a suitable prefix, as in `12.3 µs` or `1.4 ms`."""
    plain = number(value)
    return MISSING if plain is None else quantity(plain * 1e-6, "s", digits)


def ratio(value: Any, digits: int = 2) -> str:
    """A relative figure, as in `2.1 × 10⁻¹⁴`."""
    plain = number(value)
    return MISSING if plain is None else significant(plain, digits)


def count(value: Any) -> str:
    """A whole number, in groups of three from five digits on."""
    plain = number(value)
    if plain is None:
        return MISSING
    whole = round(plain)
    return f"{whole:,}".replace(",", THIN) if abs(whole) >= 10_000 else str(whole)


def plural(amount: int, noun: str) -> str:
    """`3 contacts`, `1 contact`, `no contacts`."""
    if amount == 1:
        return f"1 {noun}"
    return f"{count(amount) if amount else 'no'} {noun}s"


def axis_units(kind: str) -> tuple[str, str]:
    """Units of position and effort of a `rotary` or `linear` axis."""
    return ("rad", "N m") if kind == "rotary" else ("m", "N")


def share(value: float | None, whole: float | None) -> str:
    """Return a fraction of a total as text, as in `2.1 × 10⁻¹⁴`."""
    if value is None or whole is None:
        return MISSING
    if whole == 0.0:
        return "of zero" if value else "both zero"
    return ratio(value / whole)
