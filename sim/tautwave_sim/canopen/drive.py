"""The drive in a node: state machine, modes and statusword around one motor (CiA 402-2 v3.0)."""

from __future__ import annotations

from collections.abc import Callable

from tautwave_sim.canopen.control import CSP, CST, CSV, HM, PP, PT, PV, Control
from tautwave_sim.canopen.dictionary import WRONG_VALUE, ObjectDictionary, SdoAbort
from tautwave_sim.canopen.motor import Motor
from tautwave_sim.canopen.options import Quirks
from tautwave_sim.cia402 import HALT, POWERED, State, StateMachine

NEW_SETPOINT, RELATIVE = 0x10, 0x40
VOLTAGE, REMOTE, REACHED, LIMITED, BIT12, BIT13 = 0x10, 0x200, 0x400, 0x800, 0x1000, 0x2000
IMPEDANCE_MODES = (PP, PV, PT, HM, CSP, CSV, CST)
SERVO_MODES = (PP, PV, HM, CSP, CSV)
HERE = (35, 37)
"""Homing methods that take the present position."""
FOLLOWING_ERROR = 0x8611
UNLIMITED = 0xFFFFFFFF


class Drive:
    """What a master commands by 6040h, 6060h and the targets.

    Parameters
    ----------
    objects : ObjectDictionary
        The node's; the drive's part of it is wired to this drive.
    motor : Motor
        What moves.
    quirks : Quirks
        How it misbehaves.
    report : callable
        Called with the code of an error of the drive itself (EMCY).
    """

    def __init__(
        self,
        objects: ObjectDictionary,
        motor: Motor,
        quirks: Quirks,
        report: Callable[[int], None],
    ) -> None:
        self.objects = objects
        self.motor = motor
        self.machine = StateMachine(round(quirks.transition_ms * 1e6), quirks.fault_resets)
        self.control = Control(objects, motor, quirks.torque_step_permille)
        self.mode = 0
        self.voltage = True
        self.changed = False
        """Whether there is a command or event that the motor has not seen yet."""
        self.reported_enabled = False
        """Whether the master knows, since power-on, that it is enabled."""
        self._quirks = quirks
        self._report = report
        self._word = 0
        self._next_mode: tuple[int, int] | None = None
        self._homed = self._homing_failed = self._mode_lost = False
        self._acknowledged = False
        self.inputs = 0
        self._was_on = False
        self._away_ns: int | None = None
        self._now_ns = 0
        modes = SERVO_MODES if motor.servo else IMPEDANCE_MODES
        self.modes = tuple(mode for mode in modes if mode not in quirks.lacks_modes)
        self._wire()

    def _wire(self) -> None:
        objects, motor = self.objects, self.motor
        objects.readers[0x6041, 0] = self.statusword
        objects.readers[0x6061, 0] = lambda: self.mode
        objects.readers[0x6064, 0] = lambda: motor.position_counts
        objects.readers[0x606C, 0] = lambda: motor.velocity_counts
        objects.readers[0x6077, 0] = lambda: motor.actual_torque_counts
        objects.readers[0x6078, 0] = lambda: motor.actual_torque_counts
        objects.readers[0x6074, 0] = lambda: motor.torque_counts
        objects.readers[0x6062, 0] = self._demand_counts
        objects.readers[0x60F4, 0] = lambda: self._demand_counts() - motor.position_counts
        objects.readers[0x60FD, 0] = lambda: self.inputs
        objects.readers[0x6502, 0] = lambda: sum(1 << mode - 1 for mode in self.modes)
        objects.writers[0x6040, 0] = self._take_word
        objects.writers[0x6060, 0] = self._take_mode
        objects.writers[0x6098, 0] = self._take_homing_method

    def support(self, word: int) -> None:
        """Support only the modes of a value of 6502h."""
        self.modes = tuple(mode for mode in self.modes if word >> mode - 1 & 1)
        self.objects.readers[0x6502, 0] = lambda: word

    def restart(self) -> None:
        """Begin as after power-on."""
        self.objects.restore(0x6000)
        self.machine.restart()
        self.mode = 0
        self._word, self._next_mode = 0, None
        self._homed = self._homing_failed = self._mode_lost = False
        self._acknowledged = self._was_on = False
        self.reported_enabled = False
        self.changed = True
        if self._quirks.starts_in_fault:
            self.fail(self._quirks.fault_code)

    # -- what the master writes -----------------------------------------------------------

    def at(self, now_ns: int) -> None:
        """Note the time, and let pass what it brings."""
        self._now_ns = now_ns
        was = self.machine.state
        self.machine.run(now_ns)
        self.changed = self.changed or self.machine.state is not was
        if self._next_mode is not None and now_ns >= self._next_mode[0]:
            self._enter(self._next_mode[1])

    def next_event_ns(self) -> int | None:
        """Return when something changes by itself."""
        times = [self.machine.next_event_ns()]
        times.append(None if self._next_mode is None else self._next_mode[0])
        return min((time for time in times if time is not None), default=None)

    def _take_word(self, word: int) -> None:
        rising = word & ~self._word
        self._word = word
        if self.voltage:
            machine, number = self.machine, self.objects.number
            machine.quick_stop_option = number(0x605A)
            machine.shutdown_option = number(0x605B)
            machine.disable_option = number(0x605C)
            machine.fault_option = number(0x605E)
            was = machine.state
            machine.control(word, self._now_ns)
            if was is State.FAULT and machine.state is not State.FAULT:
                self.objects.set(0x603F, 0, 0)
                self._report(0)
        if not word & HALT:
            self._switch(self.objects.number(0x6060))
        if self.machine.state is State.ENABLED and rising & NEW_SETPOINT:
            if self.mode == PP:
                base = self.control.target_position if word & RELATIVE else 0
                self.control.target_position = base + self.objects.number(0x607A)
            elif self.mode == HM:
                self._home()
        self._acknowledged = self.mode == PP and bool(word & NEW_SETPOINT)

    def _take_mode(self, mode: int) -> None:
        if mode != 0 and mode not in self.modes:
            raise SdoAbort(WRONG_VALUE)
        self.objects.set(0x6060, 0, mode)
        if not self._word & HALT:
            self._switch(mode)

    def _switch(self, mode: int) -> None:
        if mode == self.mode and self._next_mode is None:
            return
        if mode in self._quirks.refuses_modes or self._mode_lost:
            return
        if self._quirks.mode_switch_ms == 0:
            self._enter(mode)
        elif self._next_mode is None or self._next_mode[1] != mode:
            self._next_mode = (self._now_ns + self._quirks.mode_switch_ms * 1_000_000, mode)

    def _enter(self, mode: int) -> None:
        self._next_mode = None
        self.mode = mode
        self.changed = True
        self._homed = self._homing_failed = False
        self.control.take_over()

    def lose_mode(self) -> None:
        """Drop out of the mode, as faulty drives do."""
        self._enter(0)
        self._mode_lost = True

    def _take_homing_method(self, method: int) -> None:
        if method != 0 and method not in HERE:
            raise SdoAbort(WRONG_VALUE)

    def _home(self) -> None:
        if self.objects.number(0x6098) not in HERE:
            self._homing_failed = True
            return
        motor = self.motor
        motor.origin_counts += motor.position_counts - self.objects.number(0x607C)
        self._homed = True

    # -- what happens to it ---------------------------------------------------------------

    def fail(self, code: int, option: int | None = None) -> None:
        """Have a fault; `option` is the reaction instead of 605Eh."""
        if self.machine.state in (State.FAULT, State.FAULT_REACTION):
            return
        self.objects.set(0x603F, 0, code)
        self._report(code)
        self.machine.fault_option = self.objects.number(0x605E)
        self.machine.fault(option)
        self._settle()

    def lose_master(self) -> None:
        """React to a lost connection as 6007h says."""
        option = self.objects.number(0x6007)
        if option == 1:
            self.machine.fault_option = self.objects.number(0x605E)
            self.machine.fault()
        elif option == 2:
            self.machine.drop()
        elif option == 3:
            self.machine.quick_stop_option = self.objects.number(0x605A)
            self.machine.stop(self._now_ns)
        self._settle()

    def lose_voltage(self) -> None:
        """Safe torque off."""
        self.voltage = False
        self.machine.drop()
        self._settle()

    def _settle(self) -> None:
        """End what waits for the motor while it is held."""
        self.changed = True
        if self.machine.braking and not self.motor.free:
            self.machine.come_to_rest()

    # -- slot by slot ---------------------------------------------------------------------

    @property
    def braking(self) -> bool:
        """Whether time has to go on for it, with or without SYNC."""
        return bool(self.machine.braking) and self.motor.free

    def begin_slot(self, slot: int) -> None:
        """Command the motor for the slot that begins; may be called again for the same slot."""
        machine, control = self.machine, self.control
        self._settle()
        self.changed = False
        on = machine.state in POWERED
        if on and not self._was_on:
            control.take_over()
        self._was_on = on
        if not on:
            control.rest()
            return
        if machine.braking:
            quick = machine.braking == "quick"
            if control.brake(slot, self.objects.number(0x6085 if quick else 0x6084)):
                machine.come_to_rest()
                self._was_on = machine.state in POWERED
                if not self._was_on:
                    control.rest()
        elif machine.state is State.ENABLED:
            control.run(slot, self.mode, halt=bool(self._word & HALT))
            self._watch_following()
        elif machine.state is State.QUICK_STOP:
            control.brake(slot, 0)
        else:
            control.rest()

    def _watch_following(self) -> None:
        window = self.objects.number(0x6065)
        if self.mode not in (PP, CSP) or window == UNLIMITED:
            self._away_ns = None
            return
        away = abs(self._demand_counts() - self.motor.position_counts) > window
        if not away:
            self._away_ns = None
        elif self._away_ns is None:
            self._away_ns = self._now_ns
        elif self._now_ns - self._away_ns >= self.objects.number(0x6066) * 1_000_000:
            self._away_ns = None
            self.fail(FOLLOWING_ERROR)

    def _demand_counts(self) -> int:
        motor = self.motor
        counts = round(self.control.demand.position / motor.scale.position)
        return motor.scale.direction * counts - motor.origin_counts

    # -- what it reports -----------------------------------------------------------------

    def statusword(self) -> int:
        """Return 6041h."""
        state = self.machine.state
        word = int(state) | REMOTE | (VOLTAGE if self.voltage else 0)
        if state is State.ENABLED:
            word |= LIMITED if self.control.limited else 0
            word |= self._mode_bits()
        return word

    def _mode_bits(self) -> int:
        if self.mode in (CSP, CSV, CST):
            return BIT12
        if self.mode == HM:
            if self._homing_failed:
                return BIT13
            return BIT12 | REACHED if self._homed else 0
        if self.mode == PP:
            return (BIT12 if self._acknowledged else 0) | (REACHED if self._arrived() else 0)
        if self.mode == PV:
            window = self.objects.number(0x606D)
            speed = self.motor.velocity_counts
            target = 0 if self._word & HALT else self.objects.number(0x60FF)
            bits = REACHED if abs(speed - target) <= window else 0
            return bits | (BIT12 if speed == 0 else 0)
        return 0

    def _arrived(self) -> bool:
        away = abs(self.control.target_position - self.motor.position_counts)
        return away <= self.objects.number(0x6067) and self.control.demand.velocity == 0.0
