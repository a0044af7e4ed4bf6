"""A Modbus bus with its simulated drives, in this process: what a driver's transport leads to."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import BusSpec, Clock
from tautwave.errors import DriverError
from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.modbus.bus import DriveBus
from tautwave_sim.modbus.options import SimulatedModbusOptions
from tautwave_sim.modbus.wire.rtu import RtuStation
from tautwave_sim.modbus.wire.tcp import TcpMemoryPort, TcpSide
from tautwave_sim.wire.serial import MemoryPort, SerialLine


def make_line(bus: DriveBus, options: SimulatedModbusOptions) -> SerialLine:
    """Return the RTU line with its drives on it."""
    latency_ns = round(options.simulator.latency_s * 1e9)
    line = SerialLine(options.baud, latency_ns, options.bits)
    RtuStation(line, bus, options)
    return line


def endpoint_units(options: SimulatedModbusOptions) -> dict[str, tuple[int, ...]]:
    """Return the units behind each TCP endpoint."""
    units: dict[str, tuple[int, ...]] = {}
    for device in options.devices:
        endpoint = device.endpoint or options.endpoint
        units[endpoint] = (*units.get(endpoint, ()), device.unit)
    return units


class ModbusSimulator:
    """The drives, and ports to them.

    Parameters
    ----------
    options : SimulatedModbusOptions
        Of the bus.
    bus : BusSpec
        Its axes.
    truths : sequence of AxisModel
        Their physics.
    clock : Clock
        Time.
    """

    def __init__(
        self,
        options: SimulatedModbusOptions,
        bus: BusSpec,
        truths: Sequence[AxisModel],
        clock: Clock,
    ) -> None:
        self.bus = DriveBus(options, bus, truths)
        self.axes: list[SimulatedAxis] = [one.motor.axis for one in self.bus.drives.values()]
        self.transport = self
        self._clock = clock
        self._name = bus.name
        self._line = make_line(self.bus, options) if options.link == "rtu" else None
        self._sides = {
            endpoint: TcpSide(self.bus, units)
            for endpoint, units in endpoint_units(options).items()
            if options.link == "tcp"
        }

    def port(self, endpoint: str) -> MemoryPort | TcpMemoryPort:
        """Return the line ("") or a new connection to an endpoint.

        Raises
        ------
        DriverError
            The connection is refused.
        """
        if self._line is not None:
            self._line.advance(self._clock.now_ns())
            if not self._line.plugged:
                raise DriverError(f"{self._name}: the serial adapter was disconnected; plug it in")
            return MemoryPort(self._line, self._clock, self._name)
        side = self._sides.get(endpoint)
        now_ns = self._clock.now_ns()
        if side is not None:
            side.advance(now_ns)
        if side is None or side.refuses(now_ns):
            raise DriverError(
                f"{self._name}: {endpoint}: connection refused; see that the drive is on"
            )
        return TcpMemoryPort(side, self._clock, f"{self._name}: {endpoint}")

    def advance(self, to_ns: int) -> None:
        """Process all events up to `to_ns` [ns]."""
        if self._line is not None:
            self._line.advance(to_ns)
        for side in self._sides.values():
            side.advance(to_ns)

    def close(self) -> None:
        """Nothing to release."""
