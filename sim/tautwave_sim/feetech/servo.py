"""A simulated Feetech servo: its table with lock and status, and what its motor makes of its axis.

It has no watchdog: the last goal acts until another comes. A goal that is written while torque is
off stays, and acts once it is on. By voltage (STS, SMS) its effort is that of the whole motor at
standstill: the back-EMF is damping, and belongs to the damping of the plant. The supply sags with
the current. Its encoder is on the output: in its play it stands at the side to which it is pushed.
"""

from __future__ import annotations

import math

from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.feetech import tables as t
from tautwave_sim.feetech.options import Quirks, ServoKeys
from tautwave_sim.feetech.tables import Model, magnitude, signed

COUNT = math.tau / 4096
AMPERE = 6.5e-3
DELAY_NS = 2_000
COARSE = 50.0
"""Steps/s of a count of speed."""
POSITION_N, POSITION_D = 18.0, 1.5
"""[N m/rad], [N m s/rad] Of its position loop, as the makers of the SO-101 model it."""
AMBIENT, HOTTER, HEAT_S = 25.0, 60.0, 120.0
"""[degC] around it, [K] warmer at stall after a while, that while."""
PLAY_NM, PLAY_S = 0.02, 0.005
"""What takes it through its play, and how fast."""
TICK_S = 0.01
"""Of overload time(35) and over-current time(38)."""


class Servo:
    """One servo, and the axis that it moves.

    Parameters
    ----------
    model : Model
        What it is.
    keys : ServoKeys
        How it is mounted.
    saved : dict
        What its EEPROM holds, by address.
    axis : SimulatedAxis
        What it moves.
    truth : AxisModel
        Of that axis.
    quirks : Quirks
        How it differs.
    """

    def __init__(
        self,
        model: Model,
        keys: ServoKeys,
        saved: dict[int, int],
        axis: SimulatedAxis,
        truth: AxisModel,
        quirks: Quirks,
    ) -> None:
        self.model = model
        self.keys = keys
        self.axis = axis
        self.quirks = quirks
        self.saved = bytearray(t.EEPROM_END)
        for address, value in saved.items():
            self.saved[address] = value
        for address, value in enumerate(model.identity):
            self.saved[address] = saved.get(address, value)
        self.memory = bytearray(t.SIZE)
        self.present = True
        self.free = False
        self._deaf_until_ns = 0
        self._period = truth.period
        self._loop = truth.loop
        gear = (keys.gear or model.gear) / model.gear
        constant = model.constant * gear if keys.torque_constant is None else keys.torque_constant
        self._constant = constant * keys.gear_ratio
        self._ohm = keys.resistance or model.resistance
        self._supply = quirks.voltage or keys.supply_v or model.voltage
        self._zero = keys.zero_counts + keys.offset
        self._step = COUNT / keys.gear_ratio
        self._measured: tuple[int, bool] | None = None
        self.play = 0.0
        self.effort = 0.0
        """[N m] What its motor gives at standstill, at the axis."""
        self.volts = self._supply
        self.temperature_c = quirks.temperature_c
        self._over_s = self._overload_s = 0.0
        self._cut = False
        self._trajectory: float | None = None
        self.registered: tuple[int, bytes] | None = None
        self.status = 0
        self._power_on()

    # -- power --------------------------------------------------------------------------------

    def _power_on(self) -> None:
        self.memory[:] = bytes(t.SIZE)
        self.memory[: t.EEPROM_END] = self.saved
        self._put(t.TORQUE_LIMIT, self._word(t.MAX_TORQUE))
        self.memory[t.LOCK] = 1
        self._put(t.GOAL_POSITION, magnitude(self._counts(self.axis.physics.x), 15))
        self.status = 0
        self._forgive()
        self._act()

    def restart(self, now_ns: int) -> None:
        """Lose the supply for a moment: begin anew with what was saved, deaf until then."""
        self._power_on()
        self._deaf_until_ns = now_ns + round(self.quirks.boot_s * 1e9)

    def fail(self, bits: int) -> None:
        """Report an error; of overload and over-current its torque falls as well."""
        self.status |= bits
        if bits & t.CURRENT_BIT:
            self._cut = True
        self._act()

    def _forgive(self) -> None:
        """What switching torque off, or the power, clears."""
        self.status &= ~(t.OVERLOAD_BIT | t.CURRENT_BIT)
        self._over_s = self._overload_s = 0.0
        self._cut = False

    # -- what the line asks -------------------------------------------------------------------

    @property
    def device_id(self) -> int:
        """Its id."""
        return self.memory[t.ID]

    @property
    def obeys(self) -> tuple[int, ...]:
        """The ids whose goals it follows: HLS have a second one."""
        return (self.device_id, self.memory[t.DELAY]) if self.model.hls else (self.device_id,)

    @property
    def delay_ns(self) -> int:
        """From the end of a request to its answer [ns]."""
        delay = 0 if self.model.hls else self.memory[t.DELAY] * DELAY_NS
        return delay + round(self.quirks.turn_around_s * 1e9)

    @property
    def baud(self) -> int:
        """Its baud rate."""
        return t.BAUDS.get(self.memory[t.BAUD], 1_000_000)

    @property
    def torque_on(self) -> bool:
        """Whether its motor is on."""
        return self.memory[t.TORQUE] == 1

    def hears(self, baud: int, now_ns: int) -> bool:
        """Return whether it hears what is sent at this baud rate."""
        return self.present and baud == self.baud and now_ns >= self._deaf_until_ns

    def read(self, address: int, size: int) -> bytes | None:
        """Return registers; None where no fresh sample came, and it stays silent."""
        counts, valid = self._measure()
        if not valid:
            return None
        memory = self.memory
        memory[t.STATUS] = self.status
        memory[t.VOLTAGE] = max(0, min(255, math.floor(10.0 * self.volts + 0.5)))
        memory[t.TEMPERATURE] = max(0, min(255, math.floor(self.temperature_c)))
        self._put(t.POSITION, magnitude(counts, 15))
        speed = self.keys.direction * self.axis.physics.v / self._step if self.free else 0.0
        unit = 1.0 if memory[t.PHASE] & t.FINE_SPEED else COARSE
        self._put(t.SPEED, magnitude(math.floor(speed / unit + 0.5), 15))
        amperes = self.keys.direction * self.effort / self._constant
        self._put(t.CURRENT, magnitude(math.floor(amperes / AMPERE + 0.5), 15))
        self._put(t.LOAD, magnitude(math.floor(1000.0 * amperes * self._ohm / self._supply), 10))
        memory[t.MOVING] = abs(speed) > COARSE
        if self.model.identity[2]:  # SCS: the high byte comes first
            for at in range(t.POSITION, t.LOAD + 2, 2):
                memory[at], memory[at + 1] = memory[at + 1], memory[at]
        return bytes(memory[address : address + size]).ljust(size, b"\0")

    def write(self, address: int, data: bytes) -> None:
        """Take a write; read-only addresses stay, the EEPROM keeps it only unlocked."""
        unlocked = self.memory[t.LOCK] == 0
        was_on = self.torque_on
        for at, value in enumerate(data, address):
            if not t.WRITABLE_FROM <= at < t.READ_ONLY_FROM or at in self.quirks.stuck:
                continue
            self.memory[at] = value
            if at < t.EEPROM_END and unlocked:
                self.saved[at] = value
        if self.memory[t.TORQUE] == 128:
            self.memory[t.TORQUE] = 0
            self.calibrate(2048)
        if was_on and not self.torque_on:
            self._forgive()
        if self.torque_on and not was_on:
            self._trajectory = None
        self._measured = None if address <= t.OFFSET + 1 < address + len(data) else self._measured
        self._act()

    def calibrate(self, counts: int) -> None:
        """Make where it stands `counts` by its offset, for good: so does 128 in torque(40)."""
        raw = self._raw(self.axis.physics.x) % 4096
        held = magnitude(raw - counts, self.model.offset_sign)
        self._put(t.OFFSET, held)
        self.saved[t.OFFSET : t.OFFSET + 2] = held.to_bytes(2, "little")
        self._measured = None

    # -- time ---------------------------------------------------------------------------------

    def pass_slot(self) -> None:
        """Move by one slot, unless it is held."""
        self._measured = None
        if not self.free:
            return
        self._act()
        self.axis.pass_slot()
        self._warm()
        self._protect()
        self._slip()

    def _warm(self) -> None:
        stall = self._constant * self._supply / self._ohm
        share = self.effort / stall
        goal = AMBIENT + HOTTER * self.quirks.heat * share * share
        self.temperature_c += (goal - self.temperature_c) * min(1.0, self._period / HEAT_S)
        if self.temperature_c > self.memory[13]:
            self.fail(t.HEAT_BIT)

    def _protect(self) -> None:
        """Overload: its torque falls to what it holds with. Over-current: it is gone."""
        memory = self.memory
        amperes = abs(self.effort) / self._constant
        over = self.torque_on and amperes > self._word(t.PROTECTION_CURRENT) * AMPERE
        self._over_s = self._over_s + self._period if over else 0.0
        if memory[t.PROTECTION_TIME] and self._over_s > memory[t.PROTECTION_TIME] * TICK_S:
            self.fail(t.CURRENT_BIT)
        if self.model.hls:
            return
        share = amperes * self._ohm / self._supply
        still = abs(self.axis.physics.v) < 0.1
        heavy = self.torque_on and still and share > memory[t.OVERLOAD] / 100.0
        self._overload_s = self._overload_s + self._period if heavy else 0.0
        if memory[t.OVERLOAD] and self._overload_s > memory[t.OVERLOAD_TIME] * TICK_S:
            self.fail(t.OVERLOAD_BIT)

    def _slip(self) -> None:
        """Go through the play, to the side where what is outside pushes."""
        if self.quirks.backlash > 0.0:
            pushed = sum(self.axis.physics.forces(*self.axis.hand())) / PLAY_NM
            goal = min(max(pushed, -1.0), 1.0)
            self.play += (goal - self.play) * min(1.0, self._period / PLAY_S)

    # -- its motor ----------------------------------------------------------------------------

    def _act(self) -> None:
        """Give the axis what the registers ask for."""
        if self._loop is not None:  # the rig describes its position loop
            if self.torque_on and self.memory[t.MODE] == 0:
                self.axis.command(self._aim())
            return
        self.effort = self._asked() if self.torque_on and self.present and not self._cut else 0.0
        amperes = abs(self.effort) / self._constant
        self.volts = self._supply - self.quirks.supply_ohm * amperes
        self.axis.command(self.effort)

    def _asked(self) -> float:
        """Return the effort of the motor at standstill [N m], at the axis."""
        mode, hls, turn = self.memory[t.MODE], self.model.hls, self.keys.direction
        share = min(self._word(t.TORQUE_LIMIT), 1000) / 1000.0
        if self.status & t.OVERLOAD_BIT:
            share = min(share, self.memory[t.HOLDING] / 100.0)
        stall = self._constant * self.volts / self._ohm
        most = share * stall
        if mode == 2 and hls:
            goal = signed(self._word(t.GOAL), 15)
            return turn * max(-2047, min(2047, goal)) * AMPERE * self._constant
        if mode == (3 if hls else 2):
            duty = signed(self._word(t.GOAL), 10) / 1000.0
            return turn * max(-share, min(share, duty)) * stall
        if hls:  # register 44 is the current that it may use: zero, and it does not move
            most = min(most, abs(signed(self._word(t.GOAL), 15)) * AMPERE * self._constant)
        if mode == 1:
            unit = 1.0 if self.memory[t.PHASE] & t.FINE_SPEED else COARSE
            wanted = turn * signed(self._word(t.GOAL_SPEED), 15) * unit * self._step
            effort = POSITION_D * (wanted - self.axis.physics.v)
        elif mode == 0:
            physics = self.axis.physics
            effort = POSITION_N * (self._aim() - physics.x) - POSITION_D * physics.v
        else:
            return 0.0
        return max(-most, min(most, effort))

    def _aim(self) -> float:
        """Return where its position loop is to go now [rad]: to the goal, at the goal's speed."""
        x = self.axis.physics.x
        goal = self._goal_position()
        speed = abs(signed(self._word(t.GOAL_SPEED), 15))
        if not speed:
            return goal
        if self._trajectory is None:
            self._trajectory = x
        step = speed * self._step * self._period
        self._trajectory += max(-step, min(step, goal - self._trajectory))
        return self._trajectory

    def _goal_position(self) -> float:
        counts = signed(self._word(t.GOAL_POSITION), 15)
        if not self.memory[t.PHASE] & t.MANY_TURNS:
            low, high = self._word(t.MIN_ANGLE), self._word(t.MAX_ANGLE)
            counts = min(max(counts, low), high) if low or high else counts
        return self.keys.direction * (counts + self._offset() - self._zero) * self._step

    # -- counts -------------------------------------------------------------------------------

    def _raw(self, x: float) -> int:
        """Return the encoder's counts of a position of the axis, without its offset."""
        return self._zero + self.keys.direction * math.floor(x / self._step + 0.5)

    def _offset(self) -> int:
        return signed(self._word(t.OFFSET), self.model.offset_sign)

    def _counts(self, x: float) -> int:
        counts = self._raw(x) - self._offset()
        return counts if self.memory[t.PHASE] & t.MANY_TURNS else counts % 4096

    def _measure(self) -> tuple[int, bool]:
        """Sample the encoder, once per slot; whether the sample is there to be sent."""
        if not self.free:
            return self._counts(self.axis.physics.x), True
        if self._measured is None:
            state = self.axis.measure()
            shift = 0.5 * self.quirks.backlash * self.play
            self._measured = self._counts(state.position + shift), state.valid
        return self._measured

    def _word(self, address: int) -> int:
        return self.memory[address] | self.memory[address + 1] << 8

    def _put(self, address: int, held: int) -> None:
        self.memory[address : address + 2] = held.to_bytes(2, "little")
