"""Two drives on a bus that a plan of faults befalls."""

from __future__ import annotations

from typing import Any

from tests.drivers.canopen.benches import Rig, block, make, node

SEED = 7
TORQUE = 0.05
AT_S = 0.05
CYCLES = 200
ENABLED, DISABLE_VOLTAGE = 0x0F, 0x00


def with_faults(*events: dict[str, Any], quirks: Any = None, **more: Any) -> dict[str, Any]:
    probabilities = {key: more.pop(key) for key in list(more) if key in PROBABILITIES}
    simulator: dict[str, Any] = {"faults": {"seed": SEED, "events": list(events), **probabilities}}
    if quirks is not None:
        simulator["nodes"] = {"2": quirks}
    return block(node(1), node(2), simulator=simulator, **more)


PROBABILITIES = (
    "lost",
    "delayed",
    "duplicated",
    "corrupted",
    "error_frame",
    "sync_lost",
    "delay_s",
)


def started(options: dict[str, Any]) -> Rig:
    rig = make(options, mass=0.1)
    rig.open_and_enable()
    return rig


def leave(rig: Rig) -> None:
    rig.driver.close()
    assert all(device.drive.motor.torque_counts == 0 for device in rig.devices())
