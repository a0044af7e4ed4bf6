"""The memory of one servo: its control table with the rules of access.

A read may cross addresses that hold nothing (they read 0), but has to touch an item and to stay
inside the table. A write has to cover whole items. Reads and writes of indirect data go to the
addresses that the indirect addresses name, and obey the rules there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tautwave_sim.dynamixel.items import EEPROM, RW, Item, Model, R
from tautwave_sim.dynamixel.packets import ACCESS_ERROR, LENGTH_ERROR, LIMIT_ERROR, RANGE_ERROR

OPERATING_MODES = (0, 1, 3, 4, 5, 16)
MODES_WITHOUT_CURRENT = (1, 3, 4, 16)
WATCHDOG_TRIPPED = 255
GOALS = ("Goal PWM", "Goal Current", "Goal Velocity", "Goal Position")
LOCK = "Lock"


class Memory:
    """Values of a control table.

    Parameters
    ----------
    model : Model
        Whose table it is.
    initial : mapping
        Values by item name that differ from the model's, as if written before.
    """

    def __init__(self, model: Model, initial: Mapping[str, int]) -> None:
        self.model = model
        self.items = {item.name: item for item in model.items}
        self.end = max(item.end for item in model.items)
        self._bytes = bytearray(self.end)
        self._at: list[Item | None] = [None] * self.end
        for item in model.items:
            self._at[item.address : item.end] = [item] * item.size
        self._initial = dict(initial)
        self._torque_on = self.items["Torque Enable"].address
        self._data: dict[int, int] = {}
        for block in model.indirect:
            for at in range(block.length):
                self._data[block.data + at] = block.addresses + 2 * at
        self.registered: tuple[int, bytes] | None = None
        for item in model.items:
            self.poke(item.name, item.initial)
        for name, value in self._initial.items():
            self.poke(name, value)
        self.restart()

    def restart(self) -> None:
        """Lose what a reboot loses: everything that is not in the EEPROM."""
        for item in self.model.items:
            if item.area != EEPROM and not item.name.startswith("Present"):
                self.poke(item.name, self._initial.get(item.name, item.initial))
        for goal, limit in (("Goal PWM", "PWM Limit"), ("Goal Current", "Current Limit")):
            if goal in self.items and goal not in self._initial:
                self.poke(goal, self.peek(limit))
        if "Torque Limit" in self.items:
            self.poke("Torque Limit", self.peek("Max Torque"))
        self.registered = None

    def factory_reset(self, kept: Sequence[str]) -> None:
        """Set all that can be written in the EEPROM to what the model has, but for `kept`."""
        for item in self.model.items:
            if item.area == EEPROM and item.access == RW and item.name not in kept:
                self.poke(item.name, item.initial)

    def has(self, name: str) -> bool:
        """Return whether the table has this item."""
        return name in self.items

    def peek(self, name: str) -> int:
        """Return the value of an item."""
        item = self.items[name]
        return item.decode(self._bytes[item.address : item.end])

    def poke(self, name: str, value: int) -> None:
        """Set an item, whatever its access; ignored if the table has none of this name."""
        item = self.items.get(name)
        if item is not None:
            self._bytes[item.address : item.end] = item.encode(value)

    def target(self, address: int) -> int:
        """Return the address behind an address of indirect data; any other unchanged."""
        pointer = self._data.get(address)
        if pointer is None:
            return address
        return self._bytes[pointer] | self._bytes[pointer + 1] << 8

    def read(self, address: int, length: int) -> bytes | None:
        """Return bytes from an address on, or None: not in the table."""
        if length < 1 or address + length > self.end:
            return None
        if all(item is None for item in self._at[address : address + length]):
            return None
        if not self._data:
            return bytes(self._bytes[address : address + length])
        targets = (self.target(at) for at in range(address, address + length))
        return bytes(self._bytes[at] if at < self.end else 0 for at in targets)

    def items_of(self, address: int, data: bytes) -> tuple[int, list[tuple[Item, int]]]:
        """Return what a write of `data` at `address` would set, or why it may not: error, items.

        Nothing is changed; one refusal refuses all.
        """
        if not data:
            return LENGTH_ERROR, []
        targets = [self.target(at) for at in range(address, address + len(data))]
        items: list[tuple[Item, int]] = []
        at = 0
        while at < len(data):
            item = self._at[targets[at]] if targets[at] < self.end else None
            if item is None or item.access == R:
                return ACCESS_ERROR, []
            whole = list(range(item.address, item.end))
            if targets[at : at + item.size] != whole:
                return LENGTH_ERROR, []
            value = item.decode(data[at : at + item.size])
            error = self._refuse(item, value)
            if error:
                return error, []
            items.append((item, value))
            at += item.size
        return 0, items

    def _refuse(self, item: Item, value: int) -> int:
        if item.access != RW:
            return ACCESS_ERROR
        if item.area == EEPROM and self._locked():
            return ACCESS_ERROR
        if item.name in GOALS and self.tripped:
            return RANGE_ERROR
        if item.name == "Operating Mode":
            modes = OPERATING_MODES if self.has("Goal Current") else MODES_WITHOUT_CURRENT
            return 0 if value in modes else RANGE_ERROR
        if not item.low <= value <= item.high:
            return RANGE_ERROR
        if item.limit and abs(value) > self.peek(item.limit):
            return LIMIT_ERROR
        if item.name == "Goal Position" and not self._in_reach(value):
            return LIMIT_ERROR
        return 0

    def _locked(self) -> bool:
        if self.model.protocol < 2.0:  # there only the Lock item locks
            return self.has(LOCK) and self.peek(LOCK) == 1
        return self._bytes[self._torque_on] == 1

    def _in_reach(self, counts: int) -> bool:
        if self.model.protocol < 2.0:
            return self.peek("CW Angle Limit") <= counts <= self.peek("CCW Angle Limit") or (
                self.peek("CCW Angle Limit") == 0
            )
        if self.peek("Operating Mode") != 3:
            return True
        return self.peek("Min Position Limit") <= counts <= self.peek("Max Position Limit")

    @property
    def tripped(self) -> bool:
        """Whether the bus watchdog has tripped and was not cleared."""
        return self.has("Bus Watchdog") and self.peek("Bus Watchdog") == WATCHDOG_TRIPPED
