"""Dead-man switches on digital inputs of drives, read by SDO while the bus runs.

Source: CiA 402-2 v4.0, 60FDh digital inputs; CiA 301 v4.2, 7.2.4.3.5 (expedited upload).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tautwave_drivers.canopen.axis import Axis

READ_INPUTS = bytes.fromhex("40fd600000000000")
ANSWER = bytes.fromhex("43fd6000")
"""Four bytes, expedited."""

EVERY_S = 0.01
OLDEST_NS = 100_000_000
"""An input that was not read for so long counts as off."""


class EnableInputs:
    """The switches of one bus.

    Parameters
    ----------
    axes : sequence of Axis
        Those that have one.
    now : callable
        The clock [ns].
    """

    def __init__(self, axes: Sequence[Axis], now: Callable[[], int]) -> None:
        self._axes, self._now = axes, now
        self.name = "enable input of " + ", ".join(axis.spec.name for axis in axes)

    def held(self) -> bool:
        """Return whether all are on, and were read lately."""
        since = self._now() - OLDEST_NS
        return all(axis.input_on and axis.input_ns > since for axis in self._axes)


def enable_inputs(axes: Sequence[Axis], now: Callable[[], int]) -> EnableInputs | None:
    """Return the switches of a bus, None without any."""
    used = [axis for axis in axes if axis.node.enable_input is not None]
    return EnableInputs(used, now) if used else None


def take_inputs(axis: Axis, data: bytes, arrival_ns: int) -> None:
    """Take the answer of a drive; others than four bytes say nothing."""
    bit = axis.node.enable_input
    if bit is not None and len(data) >= 8 and data[:4] == ANSWER:
        axis.input_on = bool(int.from_bytes(data[4:8], "little") >> bit & 1)
        axis.input_ns = arrival_ns
