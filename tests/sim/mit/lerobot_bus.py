"""LeRobot's Damiao bus in front of simulated motors, where all that it draws is a stand-in.

    python -m tests.sim.mit.lerobot_bus CHANNEL

Prints what it found as JSON. Its handshake enables the motors: never do this to a real arm.
"""

from __future__ import annotations

import json
import sys
import time

from tautwave.multicast import only_its_group
from tests.sim.feetech.lerobot_bus import LIMIT_S, StandIns, patiently

GOALS = {"m1": 20.0, "m2": -10.0}
"""[deg]"""
NEAR = 1.0
MIT = 1


def main(channel: str) -> None:
    sys.meta_path.insert(0, StandIns())
    import can
    from lerobot.motors import Motor, MotorNormMode
    from lerobot.motors.damiao import DamiaoMotorsBus

    with can.Bus(interface="udp_multicast", channel=channel) as tool:
        only_its_group(tool)
        for number in (1, 2):  # which LeRobot takes for done in the maker's tool
            write = bytes((number, 0, 0x55, 10, MIT, 0, 0, 0))
            tool.send(can.Message(arbitration_id=0x7FF, data=write, is_extended_id=False))
    motors = {
        f"m{at}": Motor(
            at, "dm4310", MotorNormMode.DEGREES, motor_type_str="dm4310", recv_id=at + 16
        )
        for at in (1, 2)
    }
    bus = DamiaoMotorsBus(
        port=channel, motors=motors, can_interface="udp_multicast", use_can_fd=False
    )
    patiently(bus.connect)
    only_its_group(bus.canbus)
    patiently(bus.enable_torque)

    def places() -> dict[str, float]:
        found: dict[str, float] = patiently(lambda: bus.sync_read("Present_Position"))
        return found

    places()  # the first has what its handshake made of its own request
    begun = places()
    until = time.monotonic() + LIMIT_S
    while time.monotonic() < until:
        bus.sync_write("Goal_Position", GOALS)
        if all(abs(at - GOALS[name]) < NEAR for name, at in places().items()):
            break
    reached = places()
    bus.disconnect()
    print(json.dumps({"begun": begun, "reached": reached}))


if __name__ == "__main__":
    main(sys.argv[1])
