"""Put the calibration that a rig file names into the rig: devices, zeros, and measured keys.

What it says of an axis' range, inertia and friction goes before the rig file's; `--set` goes before
both.
"""

from __future__ import annotations

import copy
import hashlib
from pathlib import Path
from typing import Any

from tautwave.config.guard import read_guarded
from tautwave.config.text.document import Document
from tautwave.config.text.yaml12 import SyntaxProblem, parse_yaml
from tautwave.errors import ConfigError

LARGEST = 256 * 1024
MEASURED = ("position_range", "inertia", "damping", "coulomb")
"""Keys of an axis that a calibration file may have beside those of `calibration.axes`."""


def digest(text: str) -> str:
    """Return the SHA-256 of a calibration file's text."""
    return hashlib.sha256(text.encode()).hexdigest()


def take_calibration(document: Document) -> None:
    """Read the file that `calibration` names, and take what it measured into the axes."""
    block = document.get(("calibration",))
    if not isinstance(block, dict):
        return
    if isinstance(block.get("file"), str) and "axes" not in block:
        axes = _read(document, block)
        if axes is None:
            return
        block["axes"] = axes
    axes = block.get("axes")
    for name, measured in axes.items() if isinstance(axes, dict) else ():
        side, _, axis = str(name).partition(".")
        path = (side, "axes", axis)
        if not isinstance(document.get(path), dict):
            document.report(
                ("calibration",),
                f"it lists axis {name}, which the rig does not have; run tautwave calibrate again",
            )
        elif isinstance(measured, dict):
            _take(document, measured, path)


def _read(document: Document, block: dict[str, Any]) -> Any:
    """Return the `axes` of the file, None if that is refused."""
    where = ("calibration", "file")
    path = document.folder / Path(block["file"])
    try:
        text = read_guarded(path, "calibration", LARGEST)
        parsed = parse_yaml(text)
    except SyntaxProblem as err:
        document.report(where, f"{path}:{err.line}: {err}; run tautwave calibrate again")
        return None
    except ConfigError as err:
        document.report(where, f"{err}; run tautwave calibrate")
        return None
    if digest(text) != block.get("sha256"):
        document.report(
            ("calibration", "sha256"),
            f"{path} is not the file that this rig was calibrated with (its SHA-256 is "
            f"{digest(text)}); restore the original, or run tautwave calibrate again",
        )
        return None
    axes = parsed.value.get("axes") if isinstance(parsed.value, dict) else None
    if parsed.problems or not isinstance(axes, dict):
        problem = next(iter(parsed.problems), None)
        what = "has no `axes`" if problem is None else f"line {problem.mark.line}: {problem.text}"
        document.report(where, f"{path}: {what}; run tautwave calibrate again")
        return None
    return axes


def _take(document: Document, calibration: dict[str, Any], path: tuple[str, str, str]) -> None:
    for key in MEASURED:
        if key not in calibration:
            continue
        value = calibration.pop(key)
        if document.mark((*path, key)).argument is None:  # --set goes first
            document.get(path)[key] = copy.deepcopy(value)
            document.marks[(*path, key)] = document.mark(("calibration",))
