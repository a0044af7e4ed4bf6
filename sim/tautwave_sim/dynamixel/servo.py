"""One servo: its registers, what it measures, and what time does to it.

Time is the bus' [ns]. The servo does not know when its responses are on the wire: `ServoBus` does.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.dynamixel import packets as p2
from tautwave_sim.dynamixel.items import Item, Model
from tautwave_sim.dynamixel.memory import GOALS, WATCHDOG_TRIPPED, Memory
from tautwave_sim.dynamixel.motor import OVERHEAT_BIT, OVERLOAD_BIT, VOLTAGE_BIT, Joint, Motor
from tautwave_sim.wire import packets1 as p1

WATCHDOG_UNIT_NS = 20_000_000
DELAY_UNIT_NS = 2_000
TICK_NS = 1_000_000

# Protocol 1.0 has no register for them: bits of every status packet.
FIRST_BITS = {
    OVERLOAD_BIT: p1.OVERLOAD_BIT,
    OVERHEAT_BIT: p1.OVERHEATING_BIT,
    VOLTAGE_BIT: p1.VOLTAGE_BIT,
}
FIRST_ERRORS = {
    p2.INSTRUCTION_ERROR: p1.INSTRUCTION_BIT,
    p2.CRC_ERROR: p1.CHECKSUM_BIT,
    p2.LIMIT_ERROR: p1.ANGLE_BIT,
    p2.RANGE_ERROR: p1.RANGE_BIT,
    p2.LENGTH_ERROR: p1.RANGE_BIT,
    p2.ACCESS_ERROR: p1.RANGE_BIT,
    p2.RESULT_FAIL: p1.INSTRUCTION_BIT,
}


class Reply(NamedTuple):
    """What a servo has to say: error field and parameters."""

    error: int
    params: bytes = b""


class Sample(NamedTuple):
    """What the servo has measured at one slot."""

    slot: int
    counts: int
    valid: bool
    effort: float


NO_SAMPLE = Sample(-1, 0, True, 0.0)


class Servo:
    """A servo with its memory, motor and axis.

    Parameters
    ----------
    model : Model
        What it is.
    memory : Memory
        Its registers.
    axis : SimulatedAxis
        What it moves.
    truth : AxisModel
        Of that axis.
    joint : Joint
        Counts and SI of that axis.
    reboot_ns : int
        How long it is deaf after a reboot [ns].
    """

    def __init__(
        self,
        model: Model,
        memory: Memory,
        axis: SimulatedAxis,
        truth: AxisModel,
        joint: Joint,
        reboot_ns: int = 200_000_000,
    ) -> None:
        self.model = model
        self.memory = memory
        self.axis = axis
        self.joint = self._mounted = joint
        self.motor = Motor(model, memory, axis, truth, joint)
        self.errors = 0
        self.present = True
        self.slot = 0
        self._reboot_ns = reboot_ns
        self._deaf_until_ns = 0
        self._born_ns = 0
        self._heard_ns = 0
        self._shut_down = False
        self._sample = NO_SAMPLE
        self._turns = 0
        self._bauds = dict(model.bauds)
        self._update_settings()

    # ------------------------------------------------------------------------------ settings

    def _update_settings(self) -> None:
        memory = self.memory
        self.device_id = memory.peek("ID")
        self.baud = self._bauds.get(memory.peek("Baud Rate"), 57_600)
        self.delay_ns = memory.peek("Return Delay Time") * DELAY_UNIT_NS
        self.level = memory.peek("Status Return Level")
        self.second_id = 255
        self.protocol = self.model.protocol
        if memory.has("Secondary(Shadow) ID"):
            self.second_id = memory.peek("Secondary(Shadow) ID")
            if self.model.bauds[-1][0] == 7 and memory.peek("Protocol Type") == 1:
                self.protocol = 1.0
        self._update_joint()
        self._watchdog_ns = 0
        if memory.has("Bus Watchdog") and not memory.tripped:
            self._watchdog_ns = memory.peek("Bus Watchdog") * WATCHDOG_UNIT_NS

    def _update_joint(self) -> None:
        """Shift and turn the counts by Homing Offset(20), Drive Mode(10) and Clear."""
        memory, joint = self.memory, self._mounted
        if memory.has("Homing Offset"):
            zero = joint.zero + memory.peek("Homing Offset") + self._turns * self.model.counts
            reverse = memory.has("Drive Mode") and memory.peek("Drive Mode") & 1
            turn = -1 if reverse else 1
            joint = joint._replace(zero=zero, direction=turn * joint.direction)
        if joint != self.joint:
            self.joint = self.motor.joint = joint
            self._sample = NO_SAMPLE

    @property
    def torque_on(self) -> bool:
        """Whether its motor is on."""
        return self.motor.torque_on

    def hears(self, baud: int, now_ns: int) -> bool:
        """Return whether it hears what is sent at this baud rate."""
        return self.present and baud == self.baud and now_ns >= self._deaf_until_ns

    # ----------------------------------------------------------------------------- time

    def pass_slot(self, time_ns: int) -> None:
        """Move by one slot that begins at `time_ns`."""
        self._watch(time_ns)
        self.motor.command()
        self.axis.pass_slot()
        self.slot += 1
        self._raise(self.motor.passed())

    def _watch(self, time_ns: int) -> None:
        if not self._watchdog_ns or not self.torque_on:
            return
        if time_ns - self._heard_ns > self._watchdog_ns:
            self.memory.poke("Bus Watchdog", WATCHDOG_TRIPPED)
            self._watchdog_ns = 0
            self.motor.clear_goals()

    def _raise(self, bits: int) -> None:
        new = bits & ~self.errors
        if not new:
            return
        self.errors |= new
        self.memory.poke("Hardware Error Status", self.errors)
        if self.errors & self.memory.peek("Shutdown") or self.model.protocol < 2.0:
            self._shut_down = True
            self.memory.poke("Torque Enable", 0)
            self.motor.configure()

    def fail(self, bit: int) -> None:
        """Have the servo detect a hardware error: a bit of Hardware Error Status."""
        self._raise(1 << bit)

    def reboot(self, now_ns: int) -> None:
        """Begin anew: the RAM at its defaults, errors gone, torque off, deaf for a while."""
        self.errors = 0
        self._shut_down = False
        self.memory.restart()
        self.motor.configure()
        self._update_settings()
        self._born_ns = now_ns
        self._deaf_until_ns = now_ns + self._reboot_ns

    def factory_reset(self, kept: Sequence[str], now_ns: int) -> None:
        """Set the EEPROM as it left the factory, but for the items `kept`; then reboot."""
        self.memory.factory_reset(kept)
        self._turns = 0
        self.reboot(now_ns)

    # ------------------------------------------------------------------ from the host

    def listen(self, now_ns: int) -> None:
        """Note that an instruction was addressed to it: feeds the bus watchdog."""
        self._watch(now_ns)
        self._heard_ns = now_ns

    def alert(self, error: int, protocol: float = 2.0) -> int:
        """Return the error field of a status packet that reports `error`."""
        if protocol < 2.0:
            field = FIRST_ERRORS.get(error, 0)
            for bit, first in FIRST_BITS.items():
                field |= first if self.errors >> bit & 1 else 0
            return field
        return error | (p2.ALERT if self.errors else 0)

    def frame(self, device_id: int, reply: Reply, protocol: float) -> bytes:
        """Return the status packet of a reply."""
        status = p1.status if protocol < 2.0 else p2.status
        return status(device_id, self.alert(reply.error, protocol), reply.params)

    def ping(self) -> Reply:
        """Respond to a ping."""
        if self.protocol < 2.0:
            return Reply(0)
        return Reply(0, self.model.number.to_bytes(2, "little") + bytes((self.firmware,)))

    @property
    def firmware(self) -> int:
        """Its firmware version."""
        return self.memory.peek("Firmware Version")

    def read(self, address: int, length: int, now_ns: int) -> Reply | None:
        """Respond to a read; None where no fresh sample came, and the servo stays silent."""
        if not self.refresh(now_ns):
            return None
        data = self.memory.read(address, length)
        return Reply(p2.ACCESS_ERROR) if data is None else Reply(0, data)

    def write(self, address: int, data: bytes, now_ns: int) -> Reply:
        """Write registers, all or none."""
        error, items = self.memory.items_of(address, data)
        if (
            not error
            and self._shut_down
            and any(item.name == "Torque Enable" and value for item, value in items)
        ):
            error = p2.RESULT_FAIL  # only a reboot brings the torque back
        if error:
            return Reply(error)
        self._apply(items, now_ns)
        return Reply(0)

    def _apply(self, items: list[tuple[Item, int]], now_ns: int) -> None:
        memory = self.memory
        settings = False
        for item, value in items:
            before = memory.peek(item.name)
            memory.poke(item.name, value)
            if item.name in GOALS or item.name == "Moving Speed":
                self.motor.goal_written(item.name, value)
                continue
            settings = True
            if item.name == "Operating Mode" and value != before:
                self._mode_defaults()
            if item.name == "Torque Enable" and self.model.protocol >= 2.0:
                self._heard_ns = now_ns
        if settings:
            self._update_settings()
            self.motor.configure()

    def _mode_defaults(self) -> None:
        """Do what the e-manual notes under Operating Mode(11): gains, profile and goals anew."""
        memory = self.memory
        for item in self.model.items:
            if item.name.endswith("Gain") or item.name.startswith("Profile "):
                memory.poke(item.name, item.initial)
        memory.poke("Goal PWM", memory.peek("PWM Limit"))
        if memory.has("Goal Current"):
            memory.poke("Goal Current", memory.peek("Current Limit"))

    def clear_turns(self) -> bool:
        """Remove whole turns from the position; False: it moves, and keeps them."""
        if self._moving():
            return False
        self._turns -= self.motor.position_counts() // self.model.counts
        self._update_settings()
        return True

    # ------------------------------------------------------------------------- measuring

    def _moving(self) -> bool:
        speed = abs(self.axis.physics.v) / self.joint.velocity
        limit = self.memory.peek("Moving Threshold") if self.memory.has("Moving Threshold") else 3
        return speed > limit

    def _measure(self) -> Sample:
        # Once per slot: two reads in one slot see one sample, and draw one number of its noise.
        if self._sample.slot != self.slot:
            state = self.axis.measure()
            counts = self.joint.to_counts(state.position)
            self._sample = Sample(self.slot, counts, state.valid, state.effort)
        return self._sample

    def refresh(self, now_ns: int) -> bool:
        """Bring the registers of present values up to this slot; False: there is no sample."""
        sample = self._measure()
        self.motor.hold_against(
            sample.effort
        )  # not once per slot: the torque may have come on since
        motor, memory, joint = self.motor, self.memory, self.joint
        if self.model.protocol < 2.0:
            self._refresh_first(sample)
            return sample.valid
        memory.poke("Present Position", sample.counts)
        speed = joint.direction * motor.axis.physics.v / joint.velocity
        memory.poke("Present Velocity", round(speed))
        memory.poke("Present Current", motor.current_counts)
        memory.poke("Present Load", motor.current_counts)
        memory.poke("Present PWM", motor.duty())
        memory.poke("Position Trajectory", joint.to_counts(motor.trajectory))
        memory.poke("Velocity Trajectory", round(motor.trajectory_velocity / joint.velocity))
        memory.poke("Present Temperature", round(motor.temperature_c))
        memory.poke("Present Input Voltage", round(motor.voltage * 10.0))
        memory.poke("Realtime Tick", (now_ns - self._born_ns) // TICK_NS % 32_768)
        memory.poke("Moving", int(self._moving()))
        arrived = abs(motor.target - motor.axis.physics.x) <= 2.0 * joint.position
        memory.poke("Moving Status", int(arrived))
        return sample.valid

    def _refresh_first(self, sample: Sample) -> None:
        motor, memory, joint = self.motor, self.memory, self.joint
        memory.poke("Present Position", max(0, min(self.model.counts, sample.counts)))
        memory.poke(
            "Present Speed", _sided(joint.direction * motor.axis.physics.v / joint.velocity)
        )
        memory.poke("Present Load", _sided(motor.current_counts))
        memory.poke("Present Temperature", round(motor.temperature_c))
        memory.poke("Present Input Voltage", round(motor.voltage * 10.0))
        memory.poke("Moving", int(self._moving()))


class Shadow(Servo):
    """The second servo of a joint: it obeys the goals of the first, which moves the axis for both.

    Parameters
    ----------
    first : Servo
        That one; its effort is that of both motors.
    memory : Memory
        Its own registers.
    truth : AxisModel
        Of the axis.
    """

    def __init__(self, first: Servo, memory: Memory, truth: AxisModel) -> None:
        self._first = first
        super().__init__(first.model, memory, first.axis, truth, first.joint)

    def pass_slot(self, time_ns: int) -> None:
        """Advance by a slot: only its watchdog acts."""
        self._watch(time_ns)
        self.slot += 1

    def _update_joint(self) -> None:
        """Do nothing: it shows what the first measures."""

    def refresh(self, now_ns: int) -> bool:
        """Show what the first measures; False: there is no sample."""
        fresh = self._first.refresh(now_ns)
        for name in ("Present Position", "Present Velocity", "Present Current", "Present Load"):
            if self.memory.has(name) and self._first.memory.has(name):
                self.memory.poke(name, self._first.memory.peek(name))
        return fresh


def _sided(value: float) -> int:
    """Return a size of ten bits with the direction in bit 10."""
    size = min(1023, round(abs(value)))
    return size | 0x400 if value < 0 and size else size
