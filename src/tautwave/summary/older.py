"""What older versions of `summary.json` said, as the newest says it: one step for each version.

A file without a version is of version 1, which had many authors: what they wrote is known from the
summaries in `tests/summary/older`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from tautwave.formats import SUMMARY

Data = dict[str, Any]


def upgraded(data: Mapping[str, Any]) -> Data:
    """Return a summary of any version as the newest has it, as far as it can be understood."""
    found = dict(data)
    version = found.get("format", 1)
    for step in range(version if isinstance(version, int) else 1, SUMMARY):
        found = _STEPS[step](found)
    return found


def _typed(data: Data) -> Data:
    """Version 1 to 2: sentences that were parsed back become objects."""
    found = {**data, "format": 2}
    if isinstance(found.get("outcome"), str):
        found["outcome"] = {"kind": found["outcome"]}
    if "left_out" in found:
        found["left_out"] = [_unused(one) for one in _list(found["left_out"])]
    if "faults" in found:
        found["faults"] = _faults(found["faults"])
    found["axes"] = {
        name: {**axis, "faults": _faults(axis.get("faults"))} if isinstance(axis, dict) else {}
        for name, axis in _dict(found.get("axes")).items()
    }
    pairs = {name: dict(_dict(pair)) for name, pair in _dict(found.get("pairs")).items()}
    delay = found.pop("coupling_delay_s", None)  # once of the rig, or by pair beside the pairs
    for name, pair in pairs.items():
        known = delay.get(name) if isinstance(delay, dict) else delay
        if known is not None:
            pair.setdefault("coupling_delay_s", known)
    found["pairs"] = pairs
    if isinstance(found.get("certificate"), dict):
        found["certificate"] = _certificate(found["certificate"])
    found.pop("skipped_slots", None)  # of a rebuilt one: missed_cycles, once more
    return found


def _certificate(data: Data) -> Data:
    found = dict(data)
    for key in ("verdicts", "loops"):
        found[key] = {
            name: one
            if isinstance(one, dict)
            else {"passed": True, "state": "passed"}
            if one is True
            else {}
            for name, one in _dict(found.get(key)).items()
        }
    elements = _dict(found.get("elements"))
    found["elements"] = {name: _dict(one) for name, one in elements.items()}
    if "after_run" in found and not isinstance(found["after_run"], dict):
        del found["after_run"]
    return found


def _unused(entry: Any) -> Data:
    """Return an element that was left out, once written as a sentence, `ELEMENT: why`."""
    if isinstance(entry, dict):
        return entry
    element, _, reason = str(entry).partition(": ")
    return {"element": element, "reason": reason}


def _faults(found: Any) -> list[Data]:
    """Return faults, once written as sentences alone."""
    return [one if isinstance(one, dict) else {"text": str(one)} for one in _list(found)]


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _dict(value: Any) -> Data:
    return value if isinstance(value, dict) else {}


_STEPS: dict[int, Callable[[Data], Data]] = {1: _typed}
