"""`RIG.accepted.json`: which devices were accepted with a rig, and the settings that they reported.

It is beside the rig file. A run on hardware compares what its devices report with it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

from tautwave.config import Rig
from tautwave.config.guard import parse_json
from tautwave.errors import ConfigError, DeviceFault
from tautwave.files import refuse_unwritable, write_text
from tautwave.reading import read_file
from tautwave.rig.calibrated import identities
from tautwave.runtime.sensing import LoopBus

NEEDED = ("identity", "motion")
"""Stages without which nothing is written: who the devices are, and that they go the right way."""

Devices = Mapping[str, Mapping[str, str]]

LARGEST = 1 << 20
"""Bytes of the file."""


def accepted_path(rig: Path) -> Path:
    """Return the file beside a rig file."""
    return rig.with_suffix(".accepted.json")


def keep_accepted(rig: Path, devices: Devices, by: str, document: Path) -> Path:
    """Write what the devices of some axes reported; entries of other axes stay as they are."""
    path = accepted_path(rig)
    kept = dict(_read(path)) if path.exists() else {}
    content = {
        "rig": rig.name,
        "by": by,
        "accepted_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "document": str(document),
        "devices": {**kept, **{name: dict(reported) for name, reported in devices.items()}},
    }
    write_text(path, json.dumps(content, indent=2) + "\n")
    return path


def refuse_unkept(rig: Path) -> None:
    """Refuse at the beginning what `keep_accepted` would refuse at the end.

    Raises
    ------
    ConfigError
        The file beside the rig is damaged, or may not be written.
    """
    path = accepted_path(rig)
    if path.exists():
        _read(path)
    refuse_unwritable([path.parent], "accept", "what was accepted")


def _read(path: Path) -> Devices:
    """Return the devices of a file.

    Raises
    ------
    ConfigError
        It is none.
    """
    try:
        devices = parse_json(read_file(path, LARGEST).decode())["devices"]
        return {
            str(name): {str(key): str(value) for key, value in reported.items()}
            for name, reported in devices.items()
        }
    except OSError as err:
        raise ConfigError(f"{path}: cannot be read: {err.strerror}") from err
    except (ValueError, KeyError, TypeError, AttributeError) as err:
        raise ConfigError(
            f"{path}: was not written by `tautwave accept`, or is damaged; remove it, and accept "
            "the rig again"
        ) from err


def comparing(
    rig: Rig, buses: Sequence[LoopBus], warn: Callable[[str], None]
) -> Callable[[], None]:
    """Return a function that compares open buses with what was accepted.

    Axes that were never accepted are named in one sentence, once; a device that is not as it was
    accepted is refused. `buses` are those with hardware. The function raises `DeviceFault` for such
    a device, and `ConfigError` where the file of accepted devices is damaged.
    """
    said_once: set[str] = set()

    def compare() -> None:
        names = [name for bus in buses for name in bus.axes]
        if rig.source is None or not names:
            return
        path = accepted_path(rig.source)
        known = _read(path) if path.exists() else {}
        reported = {name: one for bus in buses for name, one in identities(bus.driver).items()}
        changes = [
            f"{name}: {key} was {then}, now {reported.get(name, {}).get(key, 'not given')}"
            for name in names
            for key, then in known.get(name, {}).items()
            if reported.get(name, {}).get(key) != then
        ]
        if changes:
            raise DeviceFault(
                f"not as it was accepted ({path}): {'; '.join(changes)}; put it back, or accept "
                "it again with `tautwave accept`"
            )
        missing = [name for name in names if name not in known]
        if missing and not said_once:
            said_once.add("")
            warn(
                f"not accepted: {', '.join(missing)}; `tautwave accept {rig.source.name}` checks "
                "signs, scales and stops of real devices, and keeps what it found"
            )

    return compare
