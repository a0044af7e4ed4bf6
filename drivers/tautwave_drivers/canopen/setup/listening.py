"""Another master on the bus, noticed before anything is sent to a drive that it may be moving."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import Clock, FramePort
from tautwave.errors import DriverError
from tautwave_drivers.canopen.axis import Axis
from tautwave_drivers.canopen.health import SYNC_ID

LISTEN_NS = 100_000_000
"""A master that moves drives speaks ten times a second at least."""
SDO_REQUEST, HEARTBEAT = 0x600, 0x700


def refuse_another_master(
    port: FramePort, clock: Clock, bus: str, axes: Sequence[Axis], *, master_id: int, sync: bool
) -> None:
    """Listen for what only a master sends; nothing is sent meanwhile.

    Parameters
    ----------
    port : FramePort
        Just opened.
    clock : Clock
        What waits.
    bus : str
        Its name.
    axes : sequence of Axis
        Whose drives are to be set up.
    master_id : int
        Node id of this master: a device that has it too would feed the watchdogs of the drives.
    sync : bool
        Whether SYNC would be ours: a device that only gives the beat is no master then.

    Raises
    ------
    DriverError
        SYNC, a command or a request to one of the drives came, or a heartbeat with our id.
    """
    heard = {}
    for axis in axes:
        heard[axis.rpdo_id] = f"commands to node {axis.node.id} (RPDO, {axis.rpdo_id:X}h)"
        request = SDO_REQUEST + axis.node.id
        heard[request] = f"requests to node {axis.node.id} (SDO, {request:X}h)"
    ours = HEARTBEAT + master_id
    if sync:
        heard[SYNC_ID] = f"SYNC ({SYNC_ID:X}h)"
    while port.receive() is not None:
        pass  # frames from before
    until = clock.now_ns() + LISTEN_NS
    while clock.wait(port, until):
        while (frame := port.receive()) is not None:
            if frame[0] == ours:
                raise DriverError(
                    f"bus {bus}: another device has the node id {master_id} of this master (its "
                    f"heartbeat, {ours:X}h, came), so drives would not notice that this program "
                    "is gone; nothing was sent. Give this master an id of its own: master_id"
                )
            what = heard.get(frame[0])
            if what is not None:
                raise DriverError(
                    f"bus {bus}: another master sends {what} on this bus, so a drive may be "
                    "moving; nothing was sent. Stop it, or give each master its own bus"
                )
