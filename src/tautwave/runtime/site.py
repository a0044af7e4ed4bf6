"""One axis of one site at run time: the state around the laws, and its energy books.

Order in a cycle: `pass_slot` for every loop slot that went by, `close` when a sample is there,
`think`. The laws are in `tautwave.laws`; this file only keeps their state.
"""

from __future__ import annotations

import math
from collections import deque

from tautwave.laws.limit import clamp, guard_axis, limit_effort, stop_effort
from tautwave.laws.port import BANKRUPT, ROUNDING, port_close, port_debt, track_velocity
from tautwave.laws.site import SiteParams, think_admittance, think_position, think_wave
from tautwave.laws.wall import wall_depth, wall_loss, wall_stored
from tautwave.types import AxisCommand, JointState


class SiteAxis:
    """One axis with its wave port (or position coupler), local wall, limits and books.

    Parameters
    ----------
    params : SiteParams
        Constants of the laws.
    delay_periods : int
        Whole loop periods until a command acts.
    wave_gain : float
        Device wave per line wave: sign * sqrt(power ratio); 1 leaves scaling out.
    coupled_by_wave, impedance : bool
        Law of the coupling and causality of the axis.
    late_share : float
        Remainder of the command delay as a share of the period: for that long the command
        before still acts. The books then hold an interval.

    Attributes
    ----------
    port_effort, wall_effort : float
        Resisting efforts of port and wall in the present command [N m or N].
    """

    __slots__ = (
        "_acted",
        "_command_total",
        "_command_wave",
        "_count",
        "_delay_periods",
        "_effort_sum",
        "_fastest",
        "_gain",
        "_half_mobility",
        "_half_period",
        "_late",
        "_limit",
        "_period",
        "_pipe",
        "_port",
        "_port_sum",
        "_spread",
        "_wall",
        "_wall_sum",
        "_wave",
        "_wave_energy",
        "_wave_sum",
        "account",
        "arrived",
        "asked",
        "burnt",
        "by_wave",
        "ceiling",
        "command",
        "depth",
        "forgiven",
        "gap",
        "gross_flow",
        "has_damper",
        "has_wall",
        "impedance",
        "impulse",
        "leaving",
        "outside",
        "params",
        "port_absorbed",
        "port_effort",
        "port_energy",
        "position",
        "predicted",
        "stopping",
        "uncertainty",
        "valid",
        "velocity",
        "wall_absorbed",
        "wall_contact_energy",
        "wall_dissipated",
        "wall_effort",
        "wall_stored_at_start",
        "wall_velocity",
        "wave_in",
    )  # fmt: skip

    def __init__(
        self,
        params: SiteParams,
        *,
        delay_periods: int = 0,
        wave_gain: float = 1.0,
        coupled_by_wave: bool = True,
        impedance: bool = True,
        late_share: float = 0.0,
    ) -> None:
        self.params = params
        # Looked up in every cycle: an attribute of an attribute costs as much as an addition.
        self._port = params.port
        self._wall = params.wall
        self._limit = params.limit
        self._gain = params.gain
        self.has_wall = params.has_wall
        self._period = params.port.period
        self._half_period = 0.5 * params.port.period
        self._half_mobility = params.port.half_mobility
        self._wave = wave_gain
        self.by_wave = coupled_by_wave
        self.impedance = impedance
        self._late = late_share
        self._delay_periods = delay_periods + (1 if late_share > 0.0 else 0)
        self.has_damper = impedance and params.port.slip > 0.0
        self.ceiling = params.limit.effort if impedance else params.limit.velocity
        # Commands on their way to the motor, oldest first: total, port, wall, wave used.
        self._pipe: deque[tuple[float, float, float, float]] = deque(
            [(0.0, 0.0, 0.0, 0.0)] * delay_periods
        )
        self.start(0.0, math.nan, 0.0)

    def start(self, position: float, outside: float, gap: float) -> None:
        """Begin at a measured position, nothing stored; `gap` [W**0.5 s] is an offset to mend."""
        self.position = position
        self.outside = 0.0 if math.isnan(outside) else outside
        self.velocity = 0.0
        self.wall_velocity = 0.0
        self.predicted = 0.0
        self.account = 0.0
        self._fastest = 0.0
        self.gap = gap
        self.impulse = 0.0
        self.depth = wall_depth(self._wall, position) if self.has_wall else 0.0
        self.wall_stored_at_start = wall_stored(self.params.wall, self.depth)
        self.leaving = 0.0
        self.wave_in = 0.0
        self.arrived = 0.0
        self.command = 0.0
        self.asked = 0.0
        self.valid = True
        self.stopping = False
        self._command_total = self.port_effort = self.wall_effort = self._command_wave = 0.0
        self._acted = (0.0, 0.0, 0.0)
        self._spread = 0.0
        self._count = 0
        self._effort_sum = self._port_sum = self._wall_sum = self._wave_sum = 0.0
        self._wave_energy = 0.0
        self.port_energy = self.gross_flow = self.uncertainty = 0.0
        self.port_absorbed = self.burnt = self.forgiven = 0.0
        self.wall_absorbed = self.wall_dissipated = self.wall_contact_energy = 0.0

    def pass_slot(self) -> None:
        """One slot went by: the command that acted in it joins the open interval."""
        pipe = self._pipe
        if pipe:
            pipe.append(
                (self._command_total, self.port_effort, self.wall_effort, self._command_wave)
            )
            total, port, wall, wave = pipe.popleft()
            if self._late == 0.0:
                # Without a sample in between, nobody knows in which period the device moved.
                if self._count:
                    self._spread += abs(total - self._acted[0])
                self._acted = (total, port, wall)
        else:
            total = self._command_total
            port = self.port_effort
            wall = self.wall_effort
            wave = self._command_wave
        if self._late > 0.0:
            late = self._late
            total, port, wall = self._blend(late, total, port, wall)
        self._effort_sum += total
        self._port_sum += port
        self._wall_sum += wall
        self._wave_sum += wave
        self._wave_energy += self._half_period * wave * wave
        self._count += 1

    def _blend(
        self, late: float, total: float, port: float, wall: float
    ) -> tuple[float, float, float]:
        """Return the mean efforts of a period in which the last command acted `late` on."""
        before = self._acted
        self._acted = (total, port, wall)
        self._spread += abs(total - before[0])
        early = 1.0 - late
        return (
            late * before[0] + early * total,
            late * before[1] + early * port,
            late * before[2] + early * wall,
        )

    def receive(self, arriving: float) -> None:
        """Take the wave of this slot; it is booked with the command that it leads to."""
        wave = self._wave * arriving
        self.arrived = arriving
        self.wave_in = wave
        self._command_wave = wave

    def miss(self) -> None:
        """No sample in this cycle: nothing is known, nothing leaves, the command stays."""
        self.valid = False
        self.leaving = 0.0

    def take(self, state: JointState) -> bool:
        """Close with a fresh sample, or do without; return whether there was one."""
        position, _, effort, valid, _ = state
        if valid:
            self.close(position, effort)
        else:
            self.miss()
        return valid

    def close(self, position: float, outside: float) -> None:
        """Close all periods since the last sample: books, and the leaving wave.

        Parameters
        ----------
        position : float
            Measured position [rad or m].
        outside : float
            Measured outside effort [N m or N]; used by admittance axes.
        """
        self.valid = True
        count = float(self._count)
        period = self._period
        displacement = position - self.position
        self.position = position
        if count == 1.0:
            effort, port, wall = self._effort_sum, self._port_sum, self._wall_sum
        else:
            effort = self._effort_sum / count
            port = self._port_sum / count
            wall = self._wall_sum / count
        span = count * period
        if self.impedance:
            expected = self.velocity - self._half_mobility * (self.impulse + self._effort_sum)
            self.velocity = track_velocity(self._gain, expected, displacement, span)
            self.impulse = self._effort_sum
            energy = effort * displacement
            if self._spread > 0.0:
                # Where in the interval the device moved is unknown: the whole swing is possible.
                self.uncertainty += self._spread * abs(displacement)
                self._spread = 0.0
        else:
            mean = 0.5 * (self.outside + outside)
            self.uncertainty += 0.5 * abs((outside - self.outside) * displacement)
            self.outside = outside
            self.velocity = displacement / span
            port = self.port_effort = mean - wall
            energy = mean * displacement
        if self.has_wall:
            params = self._wall
            self.wall_velocity += self._gain * (displacement / span - self.wall_velocity)
            before = self.depth
            after = wall_depth(params, position)
            self.depth = after
            absorbed = wall * displacement
            self.wall_absorbed += absorbed
            self.wall_dissipated += wall_loss(params, wall, displacement, before, after)
            if after > 0.0:
                self.wall_contact_energy += absorbed
            else:
                self.wall_contact_energy = 0.0
        self.port_energy += energy
        self.gross_flow += abs(energy)
        if self.by_wave:
            leaving, self.account, self.gap, absorbed, burnt, forgiven = port_close(
                self._port, self.account, self.gap, displacement, count, self.velocity, port,
                self._wave_sum, self._wave_energy,
            )  # fmt: skip
            self.leaving = leaving / self._wave
            fastest = abs(displacement) / span
            if fastest > self._fastest:
                self._fastest = fastest
            self.port_absorbed += absorbed
            self.burnt += burnt
            self.forgiven += forgiven
            self._wave_energy = 0.0
        else:
            self.port_absorbed += port * displacement
        self._effort_sum = self._port_sum = self._wall_sum = self._wave_sum = 0.0
        self._count = 0

    def think(self, far_position: float, far_velocity: float, ceiling: float) -> int:
        """Decide the next command; return the guard's code (0: all is well).

        With the wave law the arriving wave was given to `receive`; the far position and velocity
        are used by a position coupling only. `ceiling` is the engage ramp's [N m, N or rad/s, m/s].
        """
        p = self.params
        guard = guard_axis(self._limit, self.position, self.velocity)
        if guard or self.stopping:
            self.stop_command(ceiling)
            return guard
        pending = 0.0
        for waiting in self._pipe:  # the oldest entry acts from now on; all are still to act
            pending += waiting[0]
        if not self.impedance:
            velocity, wall, self.asked = think_admittance(
                p, self.position, self.outside, pending, self.wave_in, ceiling
            )
            self.command = velocity
            self._command_total = velocity
            self.wall_effort = wall
            return 0
        if self.by_wave:
            total, port, wall, self.asked, self.predicted = think_wave(
                p, self._credit(), self.wall_contact_energy, self.position, self.velocity,
                self.wall_velocity, self.impulse, pending, self.wave_in, self._command_total,
                ceiling,
            )  # fmt: skip
        else:
            total, port, wall, self.asked = think_position(
                p, self.wall_contact_energy, self.position, self.velocity, self.wall_velocity,
                self.impulse, pending, far_position, far_velocity, self._command_total, ceiling,
            )  # fmt: skip
        self._command_total = total
        self.port_effort = port
        self.wall_effort = wall
        self.command = -total
        return 0

    def stop_command(self, ceiling: float) -> None:
        """Replace coupling and wall by the certified damping of a passive stop."""
        self.stopping = True
        if self.impedance:
            p = self.params.limit
            total = limit_effort(p, stop_effort(p, self.velocity), self._command_total, ceiling)
            self.command = -total
        else:
            total = 0.0
            self.command = 0.0
        self._command_total = self.port_effort = total
        self.wall_effort = 0.0

    def _credit(self) -> float:
        """Return the port's account, or that it is bankrupt."""
        account = self.account
        if account < 0.0:
            periods = self._delay_periods
            debt = port_debt(self._port, periods, self._gain, self._fastest, self.gross_flow)
            # Beside a wave that just arrived, a rounding error is no debt.
            debt += ROUNDING * self._half_period * self.wave_in * self.wave_in
            if account < -debt:
                return BANKRUPT
        return account

    def fade(self, ceiling: float) -> None:
        """Bring the command to zero under a falling ceiling, without looking at the axis."""
        self.stopping = True
        total = clamp(self._command_total, ceiling)
        self._command_total = total
        self.port_effort = total if self.impedance else 0.0
        self.wall_effort = 0.0
        self.command = -total if self.impedance else total

    def axis_command(self) -> AxisCommand:
        """Return the command for the driver."""
        if self.impedance:
            return AxisCommand(self.command, 0.0)
        return AxisCommand(0.0, self.command)

    def waiting_energy(self) -> float:
        """Return the energy of waves that arrived but are not booked yet [J]."""
        total = self._wave_energy + self._half_period * self._command_wave * self._command_wave
        for waiting in self._pipe:
            total += self._half_period * waiting[3] * waiting[3]
        return total

    def wall_stored(self) -> float:
        """Return the energy in the wall's spring [J]."""
        return wall_stored(self.params.wall, self.depth)
