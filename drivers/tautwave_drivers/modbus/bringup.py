"""Checks and settings before enabling, drive by drive, waiting for each response.

Nothing is written before the drive is known to be of its family; nothing that lasts is written
without --configure, unless the drive keeps it out of its EEPROM.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from tautwave.contracts import BusSpec, Clock
from tautwave.device_settings import DeviceSetting, DeviceSettings, Lasts
from tautwave.errors import BusTimeout, DeviceFault, DriverError
from tautwave_drivers.modbus.line.client import Client
from tautwave_drivers.modbus.options import ModbusOptions
from tautwave_drivers.modbus.profile import Register, Setting, Step
from tautwave_drivers.modbus.protocol import frames
from tautwave_drivers.modbus.sequence import Steps, behind_gateway, refusal
from tautwave_drivers.modbus.station import Station

ALL_BITS = 0xFFFFFFFF
PERIODS = 3
"""Bus periods that a comm-loss timeout has to allow at least."""


class Bringup:
    """Brings one drive to where it may be enabled.

    Parameters
    ----------
    station : Station
        The drive.
    client : Client
        Sends its requests.
    options : ModbusOptions
        The bus' options.
    bus : BusSpec
        What is allowed.
    clock : Clock
        What waits.
    notes : list of str
        Takes what was found and set.
    """

    def __init__(
        self,
        station: Station,
        client: Client,
        options: ModbusOptions,
        bus: BusSpec,
        clock: Clock,
        notes: list[str],
    ) -> None:
        self._station = station
        self._device = station.device
        self._profile = station.device.profile
        self._client = client
        self._options = options
        self._bus = bus
        self._clock = clock
        self._where = f"{station.label} on bus {bus.name}"
        self._volatile = False
        self.notes = notes
        self.settings = DeviceSettings(
            self._where,
            self._get,
            self._write,
            configure=bus.configure,
            doubt="is another master on the line?",
            notes=notes,
        )
        self.unwatched = ""
        self.identity: dict[str, str] = {}

    def run(self) -> None:
        """Check and set everything; the drive is without torque all the time.

        Lasting settings that differ are in `settings.differences`.

        Raises
        ------
        DeviceFault
            It has a fault that a reset does not clear, or refuses.
        DriverError
            It does not answer, or is not the expected drive.
        """
        self._identify()
        profile = self._profile
        if profile.eeprom_off is not None:
            self._put(profile.eeprom_off.register_name, profile.eeprom_off.value)
            self._volatile = True
            self.notes.append(f"{self._where}: settings are kept out of its EEPROM")
        self._switch_off()
        for setting in profile.expected:
            self._expect(setting)
        self._set_up()
        self._watchdog()
        self._put_zero()
        own = {role for role in profile.roles if role.startswith(("command", "control"))}
        left_out = {profile.roles[role] for role in own}
        if profile.comm_loss is not None:
            left_out.add(profile.comm_loss.register_name)
        self._station.checks = tuple(
            Step(wait=one.name, value=one.wanted)
            for one in self.settings.held.values()
            if one.name not in left_out
        )
        self.notes += [f"{self._where}: {caveat}" for caveat in profile.caveats]

    # -- what it is ------------------------------------------------------------------------

    def _identify(self) -> None:
        profile, device = self._profile, self._device
        if profile.identity is not None:
            name, wanted = profile.identity.register_name, profile.identity.value
            answered = self._get(name)
            if wanted is not None and answered != wanted:
                raise DriverError(
                    f"{self._where}: {name} reads {answered:#x}, but a {profile.family} drive has "
                    f"{wanted:#x}; correct its profile, or the unit id"
                )
        reported = {label: str(self._get(name)) for name, label in profile.reported.items()}
        words = (f"{label} {value}" for label, value in reported.items())
        self.notes.append(", ".join((f"{self._where}: {profile.family}", *words)))
        self.identity = {"family": profile.family, **reported}
        rated = profile.register_of("rated_torque")
        if rated is not None and device.options.rated_torque is not None:
            drive = self._get(profile.roles["rated_torque"]) * rated.scale
            if abs(drive - device.options.rated_torque) > 1.001 * rated.scale:
                raise DriverError(
                    f"{self._where}: its rated torque is {drive:g} N m, but the rig states "
                    f"{device.options.rated_torque:g}; correct rated_torque"
                )
        if profile.register_of("counts") is not None:
            counts = self._get(profile.roles["counts"])
            wanted_counts = device.options.counts_per_revolution or profile.counts_per_revolution
            if counts != wanted_counts:
                raise DriverError(
                    f"{self._where}: it has {counts} counts per revolution, but the rig states "
                    f"{wanted_counts:g}; correct counts_per_revolution"
                )

    def _switch_off(self) -> None:
        """Disable it, whatever it was doing, and reset a fault once."""
        machine = self._station.machine
        if machine is not None:
            machine.reset()
            machine.disable()
            self._client.run(self._station, machine, 2.0)
            machine.reset()
            return
        profile = self._profile
        self._run_steps("prepare", (*profile.prepare, *profile.disable))
        status = self._get(profile.roles["status"])
        states = profile.states
        assert states is not None
        if not states.fault.fits(status):
            return
        code = self._get(profile.roles["fault"]) if "fault" in profile.roles else None
        fault = self._station.fault_text(code)
        if not profile.fault_reset:
            raise DeviceFault(f"{self._where}: is in fault: {fault}; clear the fault at the drive")
        try:
            self._run_steps("fault reset", profile.fault_reset)
        except BusTimeout as err:
            raise DeviceFault(f"{self._where}: is still in fault after a reset: {fault}") from err
        self.notes.append(f"{self._where}: was in fault, now reset: {fault}")

    def _run_steps(self, what: str, steps: Sequence[Step]) -> None:
        station = self._station
        procedure = Steps(station.label, what, station.codec, steps, self._clock)
        self._client.run(station, procedure, sum(step.timeout_s for step in steps) + 1.0)

    # -- settings --------------------------------------------------------------------------

    def _set_up(self) -> None:
        profile, device = self._profile, self._device
        mode = profile.roles.get("mode")
        if mode is not None and profile.machine == "steps":
            wanted = profile.modes["effort" if device.impedance else "velocity"]
            self._keep(mode, wanted, "the mode that the axis needs")
        extra = profile.settings_effort if device.impedance else profile.settings_velocity
        for setting in (*profile.settings, *extra):
            self._keep(setting.register_name, setting.value, setting.why, setting.mask)
        for name in profile.limits.effort:
            self._limit(name, device.axis.effort_limit)
        if not device.impedance:
            for name in profile.limits.velocity:
                self._limit(name, device.axis.velocity_limit)

    def _limit(self, name: str, limit: float) -> None:
        """Set the rig's limit in the drive too, rounded up so that the drive never clips first."""
        register = self._profile.registers[name]
        quantum = self._quantum(register)
        if not math.isfinite(limit) or quantum <= 0.0:
            return
        self._keep(name, math.ceil(limit / quantum * (1.0 - 1e-9)), "the rig's limit")

    def _quantum(self, register: Register) -> float:
        scale, profile = self._device.scale, self._profile
        for role, step in (
            ("effort", scale.effort),
            ("command_effort", scale.effort_command),
            ("velocity", scale.velocity),
            ("command_velocity", scale.velocity_command),
        ):
            like = profile.register_of(role)  # type: ignore[arg-type]  # all four are roles
            if like is not None and like.unit == register.unit:
                return step * register.scale / like.scale
        return 0.0

    def _keep(self, name: str, wanted: int, why: str, mask: int = ALL_BITS) -> None:
        """Set a register where it differs; a lasting one only if that is allowed."""
        self.settings.keep(self._setting(name, wanted, why, mask))

    def _setting(
        self, name: str, wanted: int, why: str = "", mask: int = ALL_BITS
    ) -> DeviceSetting:
        register = self._profile.registers[name]
        lasts = Lasts.WRITTEN if register.lasting and not self._volatile else Lasts.POWER
        mask = -1 if mask == ALL_BITS else mask  # of negative values too
        readable = "r" in register.access
        return DeviceSetting(name, name, wanted, lasts, why, mask, readable=readable)

    def _expect(self, setting: Setting) -> None:
        value = self._get(setting.register_name)
        if value & setting.mask != setting.value & setting.mask:
            raise DriverError(
                f"{self._where}: {setting.register_name} is {value}, but must be "
                f"{setting.value}: {setting.why}; set it with the vendor's program"
            )

    def _watchdog(self) -> None:
        """Test the comm-loss timeout; enabling the drive will arm it."""
        comm_loss = self._profile.comm_loss
        if comm_loss is None:
            if not self._bus.allow_unwatched:
                raise DriverError(
                    f"{self._where}: has no comm-loss timeout: if cable, host or program fails, it "
                    "keeps following its last command; keep a hardware emergency stop within reach "
                    "and run with --allow-unwatched"
                )
            self.unwatched = (
                f"(unit {self._device.unit}) keeps following its last command: it has no comm-loss "
                "timeout"
            )
            return
        seconds = self._options.comm_timeout_s
        least = PERIODS / self._bus.rate_hz
        if seconds < least:
            raise DriverError(
                f"{self._where}: comm_timeout_s {seconds:g} is shorter than {PERIODS} periods of "
                f"the bus; set it to {least:g} or more"
            )
        name = comm_loss.register_name
        register = self._profile.registers[name]
        units = round(self._profile.timeout_s(seconds) / register.scale)
        if register.lasting and not self._volatile:
            self._keep(name, units, "comm-loss timeout")
            if self.settings.differences:
                return
        else:
            self._put(name, units)
            self._put(name, comm_loss.off)  # no requests reach it while others are brought up
            self._station.arming = (
                Step(write=name, value=units),
                Step(wait=name, value=units, timeout_s=0.5),
            )
        self.notes.append(
            f"{self._where}: after {self._profile.timeout_s(seconds):g} s without a request "
            f"{comm_loss.reaction} (written and read back)"
        )

    def _put_zero(self) -> None:
        roles = self._profile.roles
        self._put(roles["command_effort" if self._device.impedance else "command_velocity"], 0)

    # -- registers --------------------------------------------------------------------------

    def _get(self, name: str) -> int:
        codec = self._station.codec
        pdu = self._client.request(self._station, codec.read(name))
        if pdu[0] & frames.REFUSED:
            why = refusal(pdu) + behind_gateway(pdu)
            raise DriverError(f"{self._where}: {name} cannot be read: {why}")
        return codec.decode(name, pdu)

    def _put(self, name: str, value: int) -> None:
        """Write a register and read it back."""
        self.settings.put(self._setting(name, value))

    def _write(self, name: str, value: int) -> None:
        pdu = self._client.request(self._station, self._station.codec.write(name, value))
        if pdu[0] & frames.REFUSED:
            why = refusal(pdu) + behind_gateway(pdu)
            raise DriverError(f"{self._where}: {name} does not take {value}: {why}")
