"""The page of sweep files: their keys by block, and every measure with its unit."""

from __future__ import annotations

from typing import Any

from _tools.markdown import table
from tautwave.sweep.file import Sweep

MEASURES = {
    "peak_amplitude": ("rad, m", "greatest distance of master or slave from its start"),
    "late_amplitude": ("rad, m", "the same over the last tenth of the simulation"),
    "growth_rate": ("1/s", "of the amplitude over the last half: below 0, motion dies away"),
    "stable": ("1 or 0", "1 if the pair comes to rest once its hand does, 0 if it does not or the "
               "run was stopped; NaN for a hand that never rests"),
    "predicted_radius": ("1", "magnitude of the least damped pole of the sampled loop, without "
                         "walls and dry friction; above 1 it is unstable"),
    "predicted_growth": ("1/s", "growth rate of that pole"),
    "predicted_frequency": ("Hz", "frequency of that pole"),
    "position_error_rms": ("rad, m", "root mean square of the column `PAIR.position_error`"),
    "position_error_max": ("rad, m", "greatest size of that column"),
    "effort_error_rms": ("N m, N", "root mean square of the column `PAIR.effort_error`"),
    "effort_error_max": ("N m, N", "greatest size of that column"),
    "gross_flow": ("J", "sum of what passed both ports of the pair, without sign"),
    "residual": ("J", "greatest difference that the energy balance of the controller leaves"),
    "generated": ("J", "most that elements of the controller gave beyond what they took"),
    "hand_effort_rms": ("N m, N", "effort of the hand: drag in free motion, force in contact"),
    "force_error_rms": ("N m, N", "sum of hand and contact: 0 if the hand feels the contact alone"),
    "rendered_stiffness": ("N m/rad, N/m", "slope of the hand's effort over its position while "
                           "the slave is in contact; NaN without contact"),
    "energy_made": ("J", "most that both motors had given at any time"),
    "fast_share": ("1", "share of the motion's power above 8 Hz, on the worse side"),
}  # fmt: skip
"""Unit and meaning of each measure; lengths, angles and efforts are the master's."""

TITLES = {"Sweep": "Keys", "Case": "A case", "Figure": "The figure", "Panel": "A panel of it"}


def sweeps_page() -> str:
    """Return the page."""
    schema = Sweep.model_json_schema()
    blocks = {"Sweep": schema, **schema["$defs"]}
    parts = [
        "# Sweep files\n",
        "A sweep file says which rig is simulated, which of its keys vary, and what is measured."
        " `tautwave sweep FILE` runs it: see [Run a study over a grid](../../howto/study.md).\n",
        "## Measures\n",
        "A column of `points.csv` each, from a simulation of one pair.\n",
        table(
            ("measure", "unit", "meaning"),
            [(f"`{name}`", unit, meaning) for name, (unit, meaning) in MEASURES.items()],
        ),
    ]
    for name, title in TITLES.items():
        block = blocks[name]
        needed = block.get("required", ())
        rows = [
            (f"`{key}`", _takes(value), "needed" if key in needed else "", value["description"])
            for key, value in block["properties"].items()
        ]
        parts += [f"## {title}\n", table(("key", "takes", "", "meaning"), rows)]
    return "\n".join(parts)


def _takes(value: dict[str, Any]) -> str:
    """Return what a key takes, in a word or some."""
    if "$ref" in value:
        title = TITLES[value["$ref"].rpartition("/")[2]]
        return f"[{title.lower()}](#{title.lower().replace(' ', '-')})"
    if "anyOf" in value:
        return " or ".join(_takes(one) for one in value["anyOf"] if one.get("type") != "null")
    if "enum" in value:
        listed = ", ".join(f"`{one}`" for one in value["enum"])
        return "[measures](#measures)" if list(MEASURES) == value["enum"] else listed
    if "prefixItems" in value:
        return f"{len(value['prefixItems'])} numbers"
    if value.get("type") == "array":
        return f"list of {_takes(value['items'])}" if value["items"] else "list of values"
    if value.get("type") == "object":
        if "patternProperties" in value:
            return f"NAME: {_takes(next(iter(value['patternProperties'].values())))}"
        each = value["additionalProperties"]
        return f"KEY: {_takes(each)}" if isinstance(each, dict) else "KEY: value"
    return str(value["type"])
