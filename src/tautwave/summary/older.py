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
    newest = dict(data)
    version = newest.get("format", 1)
    for step in range(version if isinstance(version, int) else 1, SUMMARY):
        newest = _STEPS[step](newest)
    return newest


def _typed(data: Data) -> Data:
    """Version 1 to 2: sentences that were parsed back become objects."""
    typed = {**data, "format": 2}
    if isinstance(typed.get("outcome"), str):
        typed["outcome"] = {"kind": typed["outcome"]}
    if "left_out" in typed:
        typed["left_out"] = [_unused(one) for one in _list(typed["left_out"])]
    if "faults" in typed:
        typed["faults"] = _faults(typed["faults"])
    typed["axes"] = {
        name: {**axis, "faults": _faults(axis.get("faults"))} if isinstance(axis, dict) else {}
        for name, axis in _dict(typed.get("axes")).items()
    }
    pairs = {name: dict(_dict(pair)) for name, pair in _dict(typed.get("pairs")).items()}
    delay = typed.pop("coupling_delay_s", None)  # once of the rig, or by pair beside the pairs
    for name, pair in pairs.items():
        known = delay.get(name) if isinstance(delay, dict) else delay
        if known is not None:
            pair.setdefault("coupling_delay_s", known)
    typed["pairs"] = pairs
    if isinstance(typed.get("certificate"), dict):
        typed["certificate"] = _certificate(typed["certificate"])
    typed.pop("skipped_slots", None)  # of a rebuilt one: missed_cycles, once more
    return typed


def _certificate(data: Data) -> Data:
    certificate = dict(data)
    for key in ("verdicts", "loops"):
        certificate[key] = {
            name: one
            if isinstance(one, dict)
            else {"passed": True, "state": "passed"}
            if one is True
            else {}
            for name, one in _dict(certificate.get(key)).items()
        }
    elements = _dict(certificate.get("elements"))
    certificate["elements"] = {name: _dict(one) for name, one in elements.items()}
    if "after_run" in certificate and not isinstance(certificate["after_run"], dict):
        del certificate["after_run"]
    return certificate


def _unused(entry: Any) -> Data:
    """Return an element that was left out, once written as a sentence, `ELEMENT: why`."""
    if isinstance(entry, dict):
        return entry
    element, _, reason = str(entry).partition(": ")
    return {"element": element, "reason": reason}


def _faults(faults: Any) -> list[Data]:
    """Return faults, once written as sentences alone."""
    return [one if isinstance(one, dict) else {"text": str(one)} for one in _list(faults)]


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _dict(value: Any) -> Data:
    return value if isinstance(value, dict) else {}


_STEPS: dict[int, Callable[[Data], Data]] = {1: _typed}
