"""A CiA 402 drive that knows nothing of our simulator or driver.

SDO server and NMT are canopen's `LocalNode`; PDOs, state machine, factor group, watchdogs and motor
are written here from CiA 301 and CiA 402-2. The truth is the angle of its motor in rad and the
torque at its shaft in N m; every object of the factor group changes what the bus shows of them.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import canopen
from canopen.objectdictionary import ObjectDictionary, ODRecord, ODVariable, datatypes

TYPES = {
    "i1": datatypes.INTEGER8, "i2": datatypes.INTEGER16, "i4": datatypes.INTEGER32,
    "u1": datatypes.UNSIGNED8, "u2": datatypes.UNSIGNED16, "u4": datatypes.UNSIGNED32,
}  # fmt: skip
LETTERS = {"i1": "b", "i2": "h", "i4": "i", "u1": "B", "u2": "H", "u4": "I"}
INVALID = 1 << 31
VENDOR, PRODUCT = 0x999, 0x402
SAVE = 0x65766173
ENCODER = 4096
"""Increments of the encoder per turn."""
Key = tuple[int, int]

OBJECTS: dict[Key, tuple[str, int]] = {
    (0x1000, 0): ("u4", 0x00020192), (0x1001, 0): ("u1", 0), (0x1005, 0): ("u4", 0x80),
    (0x1010, 0): ("u1", 1), (0x1010, 1): ("u4", 1), (0x1014, 0): ("u4", 0x80),
    (0x1016, 0): ("u1", 1), (0x1016, 1): ("u4", 0), (0x1017, 0): ("u2", 0),
    (0x1018, 0): ("u1", 4), (0x1018, 1): ("u4", VENDOR), (0x1018, 2): ("u4", PRODUCT),
    (0x1018, 3): ("u4", 1), (0x1018, 4): ("u4", 77),
    (0x6007, 0): ("i2", 1), (0x603F, 0): ("u2", 0), (0x6040, 0): ("u2", 0), (0x6041, 0): ("u2", 0),
    (0x605A, 0): ("i2", 2), (0x6060, 0): ("i1", 0), (0x6061, 0): ("i1", 0), (0x6064, 0): ("i4", 0),
    (0x606C, 0): ("i4", 0), (0x6071, 0): ("i2", 0), (0x6072, 0): ("u2", 3000),
    (0x6076, 0): ("u4", 500), (0x6077, 0): ("i2", 0), (0x607A, 0): ("i4", 0),
    (0x608F, 0): ("u1", 2), (0x608F, 1): ("u4", ENCODER), (0x608F, 2): ("u4", 1),
    (0x60C2, 0): ("u1", 2), (0x60C2, 1): ("u1", 1), (0x60C2, 2): ("i1", -3),
    (0x60FF, 0): ("i4", 0), (0x6502, 0): ("u4", 0x3AD),
}  # fmt: skip

OPTIONAL = {
    0x1006: "u4", 0x1012: "u4", 0x1015: "u2", 0x1019: "u1", 0x2000: "u1", 0x2001: "u1",
    0x6065: "u4", 0x6066: "u2", 0x6075: "u4", 0x607B: "i4", 0x607C: "i4", 0x607E: "u1",
    0x6073: "u2", 0x607F: "u4", 0x6089: "i1", 0x608A: "u1", 0x608B: "i1", 0x608C: "u1",
    0x6080: "u4", 0x6090: "u4", 0x6091: "u4", 0x6092: "u4", 0x6093: "u4", 0x6094: "u4",
    0x6095: "u4",
    0x6096: "u4", 0x60A8: "u4", 0x60A9: "u4", 0x60B0: "i4", 0x60B1: "i4", 0x60B2: "i2",
    0x605B: "i2", 0x605C: "i2", 0x605D: "i2", 0x605E: "i2", 0x60E0: "u2", 0x60E1: "u2",
}  # fmt: skip
"""Types of objects that a drive may have besides: given by a test with their value."""

ANGLES = {0x10: 1.0, 0x41: math.tau / 360.0, 0x42: math.tau / 21600.0, 0xB4: math.tau}
METRE = 0x01


class Silent(canopen.Network):
    """A network without an adapter: what the library sends goes to `send`."""

    def __init__(self, send: Callable[[int, bytes], None]) -> None:
        super().__init__()
        self._out = send

    def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:
        self._out(can_id, bytes(data))

    def send_periodic(self, *args: Any, **kwargs: Any) -> Any:
        return SimpleNamespace(stop=lambda: None, update=lambda data: None)  # we have no threads


class ForeignDrive:
    """One drive.

    Parameters
    ----------
    number : int
        Node id.
    send : callable
        Puts a frame on the bus.
    objects : mapping
        Values of objects by index and sub-index, instead of or besides the defaults.
    lacks, fixed : collection of int
        Indices that it does not have, and that cannot be written.
    eager : bool
        All of its PDOs are on when it boots.
    unmappable : collection of int
        Indices that no PDO can carry.
    pdos : int
        PDOs in each direction.
    """

    def __init__(
        self,
        number: int,
        send: Callable[[int, bytes], None],
        objects: Mapping[Key, int] | None = None,
        *,
        lacks: frozenset[int] = frozenset(),
        fixed: frozenset[int] = frozenset(),
        pdos: int = 4,
        eager: bool = False,
        unmappable: frozenset[int] = frozenset(),
    ) -> None:
        self.number, self.pdos = number, pdos
        self._fixed, self._unmappable = fixed, unmappable
        known = dict(OBJECTS) | _pdo_objects(number, pdos, eager)
        known[0x1014, 0] = ("u4", 0x80 + number)
        for key, value in (objects or {}).items():
            known[key] = (known[key][0] if key in known else _kind(*key), value)
        self.kinds = {key: kind for key, (kind, _) in known.items() if key[0] not in lacks}
        self.values = {key: known[key][1] for key in self.kinds}
        self._defaults = dict(self.values)
        self.stored: dict[Key, int] = {}
        self._boots_at: float | None = None
        self.resets, self.needs_resets = 0, 1
        """Fault resets since the last fault, and how many it needs."""
        self.most_torque = 0.0
        self.written: list[tuple[Key, int]] = []
        self.state = "disabled"
        self.angle = self.speed = self.torque = 0.0
        self.inertia, self.damping = 1.5e-3, 3.0e-3
        self.unit_of_rated = 1e-3
        """[N m] of one in 6076h."""
        self.turns_torque = 1
        """-1: it tells its torque with the other sign."""
        self.hides = 0
        """Bits of its statusword that are never 1."""
        self.stays_on = self.deaf_to_sync = self.beats_not = self.silent = False
        """It never goes to OPERATION ENABLED; hears no SYNC; sends no heartbeat; nothing at all."""
        self.stubborn = False
        """Once enabled it stays so, whatever it is told; only its watchdog ends that."""
        self.boots_unheard = self.starts_itself = False
        """Its boot-up frame is lost; it goes to OPERATIONAL without being told (1F80h)."""
        self.warns_of = 0
        """An EMCY that it sends while it is switched on."""
        self.shows_mode = "always"
        """When 6061h shows the mode: always, when enabled, never."""
        self.held = False
        """Somebody holds the shaft."""
        self.mute_of = self._muted = 0
        """It sends only one of so many samples."""
        self._pending: dict[int, bytes] = {}
        self._sent_at: dict[int, float] = {}
        self._now = self._beat_at = 0.0
        self._heard_at: float | None = None
        self._word = 0

        def out(can_id: int, data: bytes) -> None:
            lost = self.boots_unheard and (can_id, bytes(data)) == (0x700 + number, b"\0")
            if not self.silent and not lost:
                send(can_id, data)

        self._send = out
        network = Silent(lambda can_id, data: self._send(can_id, data))
        self.network = network
        self.node = network.add_node(canopen.LocalNode(number, self._dictionary()))
        self.node.add_write_callback(self._written)
        self.node.add_read_callback(self._shown)
        self.node.nmt.state = "PRE-OPERATIONAL"

    def _dictionary(self) -> ObjectDictionary:
        dictionary = ObjectDictionary()
        for (index, sub), kind in self.kinds.items():
            variable = ODVariable(f"{index:04X}:{sub}", index, sub)
            variable.data_type, variable.default = TYPES[kind], self.values[index, sub]
            variable.access_type = "ro" if index in self._fixed else "rw"
            if sum(key[0] == index for key in self.kinds) == 1 and sub == 0:
                dictionary.add_object(variable)
                continue
            if index not in dictionary:
                dictionary.add_object(ODRecord(f"{index:04X}", index))
            dictionary[index].add_member(variable)
        return dictionary

    def value(self, index: int, sub: int = 0, otherwise: int = 0) -> int:
        return self.values.get((index, sub), otherwise)

    def ratio(self, index: int) -> float:
        """A quotient of the factor group; 1 where it is absent or not stated."""
        above, below = self.value(index, 1), self.value(index, 2)
        return above / below if above and below else 1.0

    # -- the factor group ---------------------------------------------------------------------

    def counts_per_turn(self) -> float:
        word = self.value(0x60A8)
        if not word and (0x608A, 0) in self.values:  # as edition 2 of CiA 402 has it
            word = (self.value(0x6089) & 0xFF) << 24 | self.value(0x608A) << 16
        unit, scale = word >> 16 & 0xFF, 10.0 ** ((word >> 24) - (256 if word >> 31 else 0))
        if unit in ANGLES:
            return math.tau / (ANGLES[unit] * scale) / self.ratio(0x6091)
        if self.ratio(0x6092) != 1.0:
            return self.ratio(0x6092) / self.ratio(0x6091)
        stated = self.ratio(0x608F)  # 1/1 on drives that do not say what encoder they have
        increments = stated if stated != 1.0 else ENCODER
        return increments / self.ratio(0x6093) / self.ratio(0x6091)

    def counts(self) -> int:
        counts = round(self.angle / math.tau * self.counts_per_turn()) + self.value(0x607C)
        counts = -counts if self.value(0x607E) & 0x80 else counts
        low, high = self.value(0x607B, 1), self.value(0x607B, 2)
        if low < high:
            counts = (counts - low) % (high - low + 1) + low
        return (counts + (1 << 31)) % (1 << 32) - (1 << 31)

    def commanded_speed(self) -> float:
        """[rad/s] of the motor, by 60FFh in the units of 60A9h, 6090h and the factors."""
        word, value = self.value(0x60A9), self.value(0x60FF) + self.value(0x60B1)
        value = -value if self.value(0x607E) & 0x40 else value
        if not word and (0x608C, 0) in self.values:
            unit = 0xB447 if self.value(0x608C) == 0xA4 else self.value(0x608C) << 8
            word = (self.value(0x608B) & 0xFF) << 24 | unit << 8
        factor = self.ratio(0x6096) * self.ratio(0x6094) * self.ratio(0x6095)
        if word >> 16 & 0xFF in ANGLES:
            scale = 10.0 ** ((word >> 24) - (256 if word >> 31 else 0))
            speed = value * scale * ANGLES[word >> 16 & 0xFF]
            speed /= {0x47: 60.0}.get(word >> 8 & 0xFF, 1.0)
        else:
            own = self.ratio(0x6090)
            speed = math.tau * value / (own if own != 1.0 else self.counts_per_turn())
        most = self.value(0x6080, 0, 1 << 31) / 60.0 * math.tau
        profile = self.value(0x607F, 0, 1 << 31) / self.counts_per_turn() * math.tau
        most = min(most, profile)  # as some drives do in CSV
        return max(-most, min(most, speed * factor))

    def commanded_torque(self) -> float:
        value = self.value(0x6071) + self.value(0x60B2)
        value = -value if self.value(0x607E) & 0x20 else value
        most = min(self.value(0x6072, 0, 0xFFFF), self.value(0x6073, 0, 0xFFFF))
        high = min(most, self.value(0x60E0, 0, 0xFFFF))
        low = min(most, self.value(0x60E1, 0, 0xFFFF))
        current = 1.0 if self.value(0x6075, 0, 1) else 0.0
        fast = abs(self.speed) > self.value(0x6080, 0, 1 << 31) / 60.0 * math.tau
        return 0.0 if fast else max(-low, min(high, value)) * 1e-3 * self.rated_torque * current

    @property
    def rated_torque(self) -> float:
        """[N m] What 1000 per mille is."""
        return self.value(0x6076) * self.unit_of_rated

    # -- objects ------------------------------------------------------------------------------

    def _shown(self, index: int, subindex: int, **rest: Any) -> int | None:
        if (index, subindex) in self.values:
            return self.shown(index, subindex)
        return None

    def shown(self, index: int, sub: int = 0) -> int:
        """What an object reads."""
        if index == 0x6041:
            return self.statusword()
        if index == 0x6061:
            shown = {"always": True, "never": False}.get(self.shows_mode, self.state == "enabled")
            return self.value(0x6060) if shown else 0
        if index == 0x6064:
            return self.counts()
        if index == 0x6077:
            return self.turns_torque * round(self.torque * 1e3 / max(self.rated_torque, 1e-9))
        if index == 0x606C:
            turns = -1 if self.value(0x607E) & 0x40 else 1
            return turns * round(self.speed / math.tau * self.counts_per_turn())
        return self.values[index, sub]

    def _written(self, index: int, subindex: int, data: bytes, **rest: Any) -> None:
        signed = self.kinds[index, subindex][0] == "i"
        value = int.from_bytes(data, "little", signed=signed)
        mapping = 0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00
        if mapping and subindex and value >> 16 in self._unmappable:
            raise canopen.SdoAbortedError(0x06040041)
        self.written.append(((index, subindex), value))
        if (index, subindex, value) == (0x1010, 1, SAVE):
            self.stored = dict(self.values)
            return
        self.values[index, subindex] = value
        if index == 0x6040:
            self._control(value)

    # -- state machine ------------------------------------------------------------------------

    WORDS: Mapping[str, int] = {
        "disabled": 0x40, "ready": 0x21, "on": 0x23, "enabled": 0x27, "stopping": 0x07,
        "fault": 0x08,
    }  # fmt: skip

    def statusword(self) -> int:
        follows = 0x1000 if self.state == "enabled" else 0
        return (self.WORDS[self.state] | 0x0210 | follows) & ~self.hides

    def _control(self, word: int) -> None:
        rising, self._word = word & ~self._word, word
        if self.state == "fault":
            self.resets += bool(rising & 0x80)
            if self.resets >= self.needs_resets:
                self.state, self.resets = "disabled", 0
        elif self.stubborn and self.state == "enabled":
            pass
        elif not word & 0x02:
            self.state = "disabled"
        elif not word & 0x04:
            self.state = "stopping" if self.state == "enabled" else "disabled"
        elif word & 0x0F == 0x06:
            self.state = "ready"
        elif word & 0x0F == 0x07:
            self.state = {"ready": "on", "enabled": "on"}.get(self.state, self.state)
        elif word & 0x0F == 0x0F:
            after = {"ready": "on", "on": "on" if self.stays_on else "enabled"}
            self.state = after.get(self.state, self.state)
        if self.state == "on" and self.warns_of:
            self.emergency(self.warns_of)
            self.warns_of = 0

    def fail(self, code: int) -> None:
        """Have a fault."""
        self.values[0x603F, 0] = code
        self.state, self.values[0x6071, 0] = "fault", 0
        self.emergency(code)

    def reboot(self, now: float, takes: float) -> None:
        """Lose all that was not stored, and be silent for a while."""
        self.values = {**self._defaults, **self.stored}
        self.state, self.resets = "disabled", 0
        self.node.nmt.state = "INITIALISING"
        self._pending.clear()
        self._heard_at = None
        self._boots_at = now + takes

    def emergency(self, code: int) -> None:
        """Send an EMCY."""
        self._send(self.value(0x1014) & 0x7FF, struct.pack("<HB5x", code, 1))

    # -- PDOs and time ------------------------------------------------------------------------

    def take(self, can_id: int, data: bytes, now: float) -> None:
        """Take a frame."""
        if self._boots_at is not None or self.silent:
            return
        if can_id == 0:
            self.node.nmt.on_command(0, data, now)
        elif can_id == 0x600 + self.number:
            self.network.notify(can_id, bytearray(data), now)
        elif can_id == self.value(0x1016, 1) >> 16 | 0x700 and self.value(0x1016, 1):
            self._heard_at = now
        if self.node.nmt.state != "OPERATIONAL":
            return
        if can_id == self.value(0x1005) & 0x7FF and not self.deaf_to_sync:
            for number, held in self._pending.items():
                self._apply(number, held)
            self._pending.clear()
            for number in range(self.pdos):
                base = 0x1800 + number
                counted = self.value(base, 6) == 0 or self.value(0x1019) == 0
                if self._on(base) and self.value(base, 2) <= 240 and counted:
                    self._transmit(number)
        for number in range(self.pdos):
            base = 0x1400 + number
            if self._on(base) and can_id == self.value(base, 1) & 0x7FF:
                self._pending[number] = data
                if self.value(base, 2) > 240:
                    self._apply(number, self._pending.pop(number))

    def _on(self, base: int) -> bool:
        return not self.value(base, 1) & INVALID and self.value(base + 0x200, 0) > 0

    def _mapped(self, base: int) -> list[Key]:
        words = [self.value(base, sub) for sub in range(1, self.value(base, 0) + 1)]
        return [(word >> 16, word >> 8 & 0xFF) for word in words]

    def _codec(self, keys: list[Key]) -> struct.Struct:
        return struct.Struct("<" + "".join(LETTERS[self.kinds.get(key, "u1")] for key in keys))

    def _apply(self, number: int, data: bytes) -> None:
        keys = self._mapped(0x1600 + number)
        found = zip(keys, self._codec(keys).unpack_from(data), strict=True)
        self.values |= {key: value for key, value in found if key[0] > 0x1F}
        if (0x6040, 0) in keys:
            self._control(self.value(0x6040))

    def _transmit(self, number: int) -> None:
        keys = self._mapped(0x1A00 + number)
        inhibit = self.value(0x1800 + number, 3) * 1e-4
        if self._now - self._sent_at.get(number, -1e9) < inhibit - 1e-9:
            return
        self._sent_at[number] = self._now
        if number == 0 and self.mute_of:
            self._muted += 1
            if self._muted % self.mute_of:
                return
        data = self._codec(keys).pack(*(self.shown(*key) for key in keys))
        self._send(self.value(0x1800 + number, 1) & 0x7FF, data)

    def run(self, now: float) -> None:
        """Let time go on to `now` [s]: the motor, timers, watchdog."""
        span, self._now = now - self._now, now
        if self._boots_at is not None:
            if now < self._boots_at:
                return
            self._boots_at = None
            self.node.nmt.state = "OPERATIONAL" if self.starts_itself else "PRE-OPERATIONAL"
            self._send(0x700 + self.number, b"\0")
        self.torque = self.commanded_torque() if self.state == "enabled" else 0.0
        if self.held:
            self.speed = 0.0
        elif self.state == "enabled" and self.value(0x6060) == 9:
            self.speed = self.commanded_speed()
        else:
            self.speed += (self.torque - self.damping * self.speed) / self.inertia * span
        self.angle += self.speed * span
        self.most_torque = max(self.most_torque, abs(self.torque))
        beat = self.value(0x1017) * 1e-3
        if beat and not self.beats_not and now - self._beat_at >= beat:
            self._beat_at = now
            states = {"OPERATIONAL": 5, "PRE-OPERATIONAL": 127, "STOPPED": 4}
            self._send(0x700 + self.number, bytes([states[self.node.nmt.state]]))
        patience = (self.value(0x1016, 1) & 0xFFFF) * 1e-3
        if patience and self._heard_at is not None and now - self._heard_at > patience:
            self._heard_at = None
            if self.value(0x6007):
                self.state, self.torque = "fault" if self.value(0x6007) == 1 else "disabled", 0.0
            self._send(0x80 + self.number, struct.pack("<HB5x", 0x8130, 0x11))
        for number in range(self.pdos if self.node.nmt.state == "OPERATIONAL" else 0):
            base = 0x1800 + number
            timer = self.value(base, 5) * 1e-3
            due = now - self._sent_at.get(number, -1e9) >= timer - 1e-6
            if timer and due and self._on(base) and self.value(base, 2) >= 254:
                self._transmit(number)


def _kind(index: int, sub: int) -> str:
    """Type of an object that is not in every drive."""
    if index in range(0x1A00, 0x1C00):
        return "u4" if sub else "u1"
    if index in range(0x1800, 0x1A00):
        return {0: "u1", 2: "u1", 3: "u2", 5: "u2", 6: "u1"}.get(sub, "u4")
    return OPTIONAL[index]


def _pdo_objects(number: int, pdos: int, eager: bool) -> dict[Key, tuple[str, int]]:
    found: dict[Key, tuple[str, int]] = {}
    for base, cob_id, word in ((0x1400, 0x200, 0x60400010), (0x1800, 0x180, 0x60410010)):
        for at in range(pdos):
            here = base + at
            off = 0 if at == 0 or eager else INVALID
            found |= {(here, 0): ("u1", 5), (here, 2): ("u1", 255), (here, 3): ("u2", 0)}
            found[here, 1] = ("u4", cob_id + 0x100 * (at % 4) + number | off)
            found |= {(here, 5): ("u2", 0), (here, 6): ("u1", 0)}
            found[here + 0x200, 0] = ("u1", 1)
            found |= {(here + 0x200, sub): ("u4", 0) for sub in range(1, 9)}
            found[here + 0x200, 1] = ("u4", word)
    return found
