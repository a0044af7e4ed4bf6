"""The block of every cycle through the indirect addresses: what is not adjacent, made so.

e-manual, X series, "Indirect Address, Indirect Data": each 2-byte register from 168 on names the
byte that appears at the indirect data (208 on the 330 models, 224 on the others). RAM.
"""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.errors import ConfigError
from tautwave_drivers.dynamixel.options import Servo
from tautwave_drivers.dynamixel.protocol import registers as reg


def status_addresses() -> list[int]:
    """Return the bytes of the block: present values, torque enable, hardware error, watchdog."""
    present = reg.PRESENT
    block = list(range(present.address, present.address + present.size))
    state = (reg.TORQUE_ENABLE, reg.HARDWARE_ERROR, reg.BUS_WATCHDOG)
    return [*block, *(register.address for register in state)]


def check_one_family(servos: Sequence[Servo]) -> None:
    """Refuse servos whose indirect data lie at different addresses on one line.

    Raises
    ------
    ConfigError
        330 models and others are mixed.
    """
    if len({servo.model.indirect_data for servo in servos}) > 1:
        raise ConfigError(
            "status_block: 330 models and others have their indirect data at different addresses "
            "and cannot be read at once; omit status_block, or use two lines"
        )
