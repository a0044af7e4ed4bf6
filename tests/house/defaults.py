"""Defaults and bounds of the keys of rig files, as lines of text.

    python -m tests.house.defaults            prints what differs from `defaults.txt`
    python -m tests.house.defaults --write    writes it anew: with a change that means to change it

A default that changes is another run of a file that did not change; a bound that moves refuses a
file that was good, or takes one that was not. `test_surface.py` compares.
"""

from __future__ import annotations

import difflib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tautwave.config.schema import rig_schema

KEPT = Path(__file__).with_name("defaults.txt")
BOUNDS = {
    "exclusiveMinimum": ">",
    "minimum": ">=",
    "exclusiveMaximum": "<",
    "maximum": "<=",
    "minItems": "items >=",
    "maxItems": "items <=",
    "minLength": "letters >=",
    "maxLength": "letters <=",
    "pattern": "like",
}


def defaults() -> list[str]:
    """Return a line for each key that has a default or a bound."""
    schema = rig_schema()
    lines = []
    for block, definition in {"Rig": schema, **schema["$defs"]}.items():
        for key, value in definition.get("properties", {}).items():
            words = [f"{block}.{key}"]
            if "default" in value:
                words.append(f"= {json.dumps(value['default'])}")
            bounds = list(dict.fromkeys(_bounds(value)))
            if len(words) + len(bounds) > 1:
                lines.append(", ".join([" ".join(words), *bounds]))
    return sorted(lines)


def _bounds(value: Any) -> Iterator[str]:
    """Yield the bounds in a schema of a key, of all its alternatives and items."""
    if not isinstance(value, dict):
        return
    for name, sign in BOUNDS.items():
        if name in value:
            yield f"{sign} {value[name]}"
    for union in ("anyOf", "oneOf", "allOf", "prefixItems"):
        for part in value.get(union, ()):
            yield from _bounds(part)
    for inner in ("items", "additionalProperties"):
        yield from _bounds(value.get(inner))


def difference() -> list[str]:
    """Return the lines that came (+) and went (-) since they were written."""
    changes = difflib.unified_diff(KEPT.read_text().splitlines(), defaults(), lineterm="", n=0)
    return [line for line in changes if line[:1] in "+-" and line[:3] not in ("+++", "---")]


if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        KEPT.write_text("\n".join(defaults()) + "\n")
    sys.stdout.write("".join(f"{line}\n" for line in difference()))
