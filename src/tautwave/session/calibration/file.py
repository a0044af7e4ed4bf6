"""The calibration file, and the line in the rig file that names it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tautwave.config import Rig
from tautwave.config.calibrated import MEASURED, digest
from tautwave.config.text.resolved import flow_yaml
from tautwave.config.text.yaml12 import parse_yaml
from tautwave.errors import ConfigError
from tautwave.files import write_text

Axes = Mapping[str, Mapping[str, Any]]

_LINE = re.compile(r"^calibration:.*(?:\n[ \t]+.*)*\n?", re.M)


def calibration_text(rig_name: str, axes: Axes) -> str:
    """Return the file: by axis its device, zero, direction, and what was measured."""
    lines = [
        f"# Calibration of rig {rig_name}, by `tautwave calibrate`, "
        f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC. The rig file names it by its SHA-256:",
        "# a manual change is rejected until `tautwave calibrate` runs again. SI units.",
        "axes:",
    ]
    for name, measured in axes.items():
        lines.append(f"  {name}:")
        keys = [key for key in ("device", "zero", "direction", *MEASURED) if key in measured]
        lines += [f"    {key}: {flow_yaml(measured[key])}" for key in keys]
    return "\n".join(lines) + "\n"


def named_in(rig_text: str, file: str, text: str) -> str:
    """Return a rig file that names a calibration file with this text, in place of any other.

    Raises
    ------
    ConfigError
        The rig file has no line that it could stand below.
    """
    line = f"calibration: {{file: {flow_yaml(file)}, sha256: {digest(text)}}}\n"
    if _LINE.search(rig_text):
        return _LINE.sub(lambda _: line, rig_text, count=1)
    named, count = re.subn(
        r"^name:.*(?:\n|\Z)",
        lambda found: _with_end(found[0]) + line,
        rig_text,
        count=1,
        flags=re.M,
    )
    if not count:
        raise ConfigError(
            f"the rig file has no line `name: ...`; add this below its name: {line.strip()}"
        )
    return named


def _with_end(line: str) -> str:
    return line if line.endswith("\n") else f"{line}\n"


def read_calibration(rig: Rig, rig_path: Path) -> dict[str, dict[str, Any]]:
    """Return what the file that a rig names says by axis, {} without one."""
    if rig.calibration is None or rig.calibration.file is None:
        return {}
    text = (rig_path.parent / rig.calibration.file).read_text(encoding="utf-8")
    axes: dict[str, dict[str, Any]] = parse_yaml(text).value["axes"]
    return axes


def write_calibration(rig_path: Path, rig_name: str, axes: Axes) -> Path:
    """Write the file beside the rig, and its name into the rig; return its path."""
    path = rig_path.with_suffix(".calibration.yaml")
    text = calibration_text(rig_name, axes)
    write_text(path, text)
    write_text(rig_path, named_in(rig_path.read_text(encoding="utf-8"), path.name, text))
    return path
