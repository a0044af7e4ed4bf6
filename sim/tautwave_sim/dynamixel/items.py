"""Control tables as data: items, models, and what an instruction may do to them."""

from __future__ import annotations

from typing import NamedTuple

R, RW = "R", "RW"
EEPROM, RAM = "EEPROM", "RAM"


class Item(NamedTuple):
    """One item of a control table, as its e-manual page lists it.

    `low` and `high` are the range for writing; `unit` is for readers. `limit` names the item whose
    value bounds this one to both sides.
    """

    address: int
    size: int
    name: str
    access: str = RW
    area: str = RAM
    initial: int = 0
    low: int = 0
    high: int = 255
    unit: str = ""
    signed: bool = False
    limit: str = ""

    @property
    def end(self) -> int:
        """Address behind the item."""
        return self.address + self.size

    def decode(self, raw: bytes | bytearray) -> int:
        """Return the value of these bytes, little endian."""
        return int.from_bytes(raw, "little", signed=self.signed)

    def encode(self, value: int) -> bytes:
        """Return the bytes of a value, wrapped to the item's size."""
        return (value & ((1 << 8 * self.size) - 1)).to_bytes(self.size, "little")


class Indirect(NamedTuple):
    """A block of indirect addresses (two bytes each) and their data (one byte each)."""

    addresses: int
    data: int
    length: int


class Model(NamedTuple):
    """One servo model: its table, and its motor as the page's specification says.

    `current_unit_a` [A] is one count of the current items, 0 where it has none. `stall_torque`
    [N m] and `stall_current` [A] at `voltage` [V]; `no_load_speed_rpm` [rev/min]. `counts` per
    `turn_rad` [rad] of the output; `velocity_unit_rpm` [rev/min] is one count of velocity.
    """

    name: str
    number: int
    protocol: float
    firmware: int
    page: str
    items: tuple[Item, ...]
    indirect: tuple[Indirect, ...]
    bauds: tuple[tuple[int, int], ...]
    current_unit_a: float
    stall_torque: float
    stall_current: float
    no_load_speed_rpm: float
    voltage: float
    counts: int
    turn_rad: float
    velocity_unit_rpm: float
    centre_counts: int
    fast_firmware: int = 255

    @property
    def torque_constant(self) -> float:
        """[N m/A] Slope to the stall point; friction and gear included, so +-20 %."""
        return self.stall_torque / self.stall_current


def indirect_items(block: Indirect, first: int, top: int) -> tuple[Item, ...]:
    """Return the items of a block of indirect addresses, numbered from `first` on.

    `top` is the last address that one may point to.
    """
    addresses = tuple(
        Item(
            block.addresses + 2 * at,
            2,
            f"Indirect Address {first + at}",
            initial=block.data + at,
            low=64,
            high=top,
        )
        for at in range(block.length)
    )
    data = tuple(
        Item(block.data + at, 1, f"Indirect Data {first + at}") for at in range(block.length)
    )
    return addresses + data
