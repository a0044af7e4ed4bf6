"""The dead-man on a drive's digital inputs: which bit, which answers count, and for how long."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from tautwave_drivers.canopen.enable_inputs import OLDEST_NS, enable_inputs, take_inputs

NOW = 1_000_000_000


def switch(bit: int | None = 3) -> Any:
    """Return an axis with its switch on that bit, never read."""
    node, spec = SimpleNamespace(enable_input=bit), SimpleNamespace(name="slave.lever")
    return SimpleNamespace(node=node, spec=spec, input_on=False, input_ns=-(10**18))


def answer(inputs: int, head: str = "43fd6000") -> bytes:
    return bytes.fromhex(head) + inputs.to_bytes(4, "little")


@pytest.mark.parametrize(
    ("data", "on"),
    [
        (answer(0b1000), True),
        (answer(0xFFFF_FFF7), False),  # every bit but this one
        (answer(0b0100), False),
        (answer(0b1_0000), False),
        (answer(0b1000) + b"more", True),
    ],
)
def test_its_own_bit_is_the_switch(data: bytes, on: bool) -> None:
    axis = switch()
    take_inputs(axis, data, NOW)
    assert (axis.input_on, axis.input_ns) == (on, NOW)


@pytest.mark.parametrize(
    "data",
    [
        answer(0b1000)[:7],
        answer(0b1000, "4bfd6000"),  # two bytes of it
        answer(0b1000, "43416000"),  # another object
        answer(0b1000, "80fd6000"),  # an abort
        b"",
    ],
)
def test_what_is_no_answer_of_four_bytes_says_nothing(data: bytes) -> None:
    axis = switch()
    take_inputs(axis, data, NOW)
    assert (axis.input_on, axis.input_ns) == (False, -(10**18))


def test_a_switch_counts_as_held_as_long_as_its_last_reading_is_fresh() -> None:
    axes, now = [switch(), switch(5), switch(None)], [NOW]
    inputs = enable_inputs(axes, lambda: now[0])
    assert inputs is not None
    take_inputs(axes[0], answer(0b1000), NOW)
    take_inputs(axes[2], answer(0xFFFF_FFFF), NOW)
    assert not inputs.held()  # the second was never read
    take_inputs(axes[1], answer(0b10_0000), NOW)
    assert inputs.held()
    now[0] = NOW + OLDEST_NS - 1
    assert inputs.held()
    now[0] = NOW + OLDEST_NS
    assert not inputs.held()
    take_inputs(axes[0], answer(0), now[0])
    take_inputs(axes[1], answer(0b10_0000), now[0])
    assert not inputs.held()


def test_a_bus_without_switches_has_none() -> None:
    assert enable_inputs([switch(None)], lambda: NOW) is None
