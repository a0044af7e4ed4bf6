"""LeRobot's Feetech bus in front of a device, in a process where all that it draws is a stand-in.

    python -m tests.sim.feetech.lerobot_bus DEVICE

LeRobot needs torch and more for what is not used here: `FeetechMotorsBus` needs the maker's SDK.
Prints what it found as JSON.
"""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import json
import sys
import time
from types import ModuleType
from typing import Any
from unittest.mock import MagicMock

STAND_INS = (
    "torch", "torchvision", "torchcodec", "draccus", "deepdiff", "datasets", "huggingface_hub",
    "av", "wandb", "einops", "accelerate", "diffusers", "cv2", "rerun", "safetensors", "jsonlines",
    "gymnasium", "pynput", "termcolor", "tqdm", "imageio",
)  # fmt: skip
GOALS = {"m1": 2300, "m2": 1800, "m3": 2048}
LIMIT_S = 20.0


class StandIns(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Modules that have everything and do nothing."""

    def find_spec(self, name: str, path: Any, target: Any = None) -> Any:
        if name.split(".")[0] in STAND_INS:
            return importlib.machinery.ModuleSpec(name, self, is_package=True)
        return None

    def create_module(self, spec: Any) -> Any:
        module = MagicMock(name=spec.name)
        module.__spec__, module.__path__ = spec, []
        return module

    def exec_module(self, module: ModuleType) -> None:
        pass


def patiently(ask: Any) -> Any:
    """A busy machine answers late, which LeRobot takes for no answer."""
    for _ in range(10):
        try:
            return ask()
        except ConnectionError:
            time.sleep(0.1)
    return ask()


def main(device: str) -> None:
    sys.meta_path.insert(0, StandIns())
    from lerobot.motors import Motor, MotorNormMode
    from lerobot.motors.feetech import FeetechMotorsBus, OperatingMode

    motors = {f"m{at}": Motor(at, "sts3215", MotorNormMode.DEGREES) for at in (1, 2, 3)}
    bus = FeetechMotorsBus(port=device, motors=motors)

    def connect() -> None:
        if bus.is_connected:
            bus.disconnect(disable_torque=False)
        bus.connect()

    patiently(connect)
    found = patiently(bus.broadcast_ping)
    patiently(bus.configure_motors)
    for name in motors:
        patiently(lambda name=name: bus.write("Operating_Mode", name, OperatingMode.POSITION.value))
    patiently(bus.enable_torque)

    def places() -> dict[str, int]:
        return patiently(lambda: bus.sync_read("Present_Position", normalize=False))

    begun = places()
    until = time.monotonic() + LIMIT_S
    while time.monotonic() < until:
        bus.sync_write("Goal_Position", GOALS, normalize=False)
        if all(abs(at - GOALS[name]) < 30 for name, at in places().items()):
            break
    reached = places()
    patiently(bus.disable_torque)
    torque = patiently(lambda: bus.sync_read("Torque_Enable", normalize=False))
    patiently(bus.disconnect)
    print(json.dumps({"found": found, "begun": begun, "reached": reached, "torque": torque}))


if __name__ == "__main__":
    main(sys.argv[1])
