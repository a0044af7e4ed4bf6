"""The page of `summary.json`: its keys by block, from the model that writes and reads it."""

from __future__ import annotations

import inspect
from typing import Any

from _tools.markdown import table
from tautwave.formats import SUMMARY
from tautwave.summary import model as models
from tautwave.summary import summary_schema


def summary_page() -> str:
    """Return the page."""
    schema = summary_schema()
    parts = [
        "# summary.json\n",
        f"Version {SUMMARY}, key `format`. `tautwave report --schema` prints this as a JSON schema;"
        " `tautwave.summary.read_summary` reads files of every version. A key that is not known of"
        " a run is absent. Units are SI where a key names none; NAME stands for the names of a"
        " rig's axes, buses, pairs and elements.\n",
    ]
    for title, block in {"Summary": schema, **schema["$defs"]}.items():
        rows = [(f"`{key}`", _types(value)) for key, value in block.get("properties", {}).items()]
        parts.append(f"## {title}\n")
        parts.append(f"{inspect.getdoc(getattr(models, title))}\n")
        parts.append(table(("key", "holds"), rows))
    return "\n".join(parts)


def _types(value: dict[str, Any]) -> str:
    """Return what a schema admits, in a word or some."""
    if "$ref" in value:
        name = value["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if "const" in value:
        return repr(value["const"])
    if "enum" in value:
        return ", ".join(f"`{one}`" for one in value["enum"])
    if "anyOf" in value:
        return " or ".join(dict.fromkeys(_types(part) for part in value["anyOf"]))
    if value.get("type") == "array":
        return f"list of {_types(value['items'])}"
    if value.get("type") == "object":
        return f"NAME: {_types(value.get('additionalProperties') or {})}"
    return str(value.get("type", "any")).replace("null", "not known")
