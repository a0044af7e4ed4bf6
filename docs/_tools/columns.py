"""What each column of a recording means; a test holds it against every shipped rig."""

from __future__ import annotations

import re
from typing import NamedTuple

from _tools.markdown import table


class Column(NamedTuple):
    """A kind of column: SIDE is master or slave, AXIS, PAIR and NODE are names of the rig."""

    name: str
    unit: str
    meaning: str

    def matches(self, column: str) -> bool:
        """Return whether a recorded column is of this kind."""
        pattern = re.escape(self.name).replace("SIDE", "(?:master|slave)")
        return (
            re.fullmatch(re.sub("AXIS|PAIR|PORT|NODE", "[A-Za-z_][A-Za-z0-9_.-]*", pattern), column)
            is not None
        )


SECTIONS = {
    "The cycle": (
        Column("time_s", "s", "start of the slot, since the first one"),
        Column("lateness_us", "µs", "how much later than its slot the cycle began"),
        Column("compute_us", "µs", "from there to the end of the cycle; waiting for buses counts"),
        Column("skipped_slots", "", "slots passed over before this one, because the loop was late"),
    ),
    "An axis": (
        Column("SIDE.AXIS.position", "rad, m", "as measured"),
        Column("SIDE.AXIS.velocity", "rad/s, m/s", "as the controller takes it, after its filter"),
        Column(
            "SIDE.AXIS.commanded",
            "N m, N; rad/s, m/s",
            "what was written to the device: effort, or velocity on an admittance axis",
        ),
        Column(
            "SIDE.AXIS.port_effort",
            "N m, N",
            "what the coupling takes at this port, opposite to the motor's push",
        ),
        Column("SIDE.AXIS.valid", "0, 1", "whether this cycle has a sample of the axis"),
        Column(
            "SIDE.AXIS.port_energy",
            "J",
            "what the motor took out of the device so far: effort that acted times displacement",
        ),
        Column("SIDE.AXIS.gross_flow", "J", "the same, all increments counted positive"),
        Column(
            "SIDE.AXIS.uncertainty",
            "J",
            "how far `port_energy` may be off where an effort did not act for whole periods, or was only sampled",
        ),
        Column("SIDE.AXIS.wave_in", "W^½", "the wave that arrived (law `wave`)"),
        Column("SIDE.AXIS.wave_out", "W^½", "the wave that left (law `wave`)"),
        Column("SIDE.AXIS.measured_effort", "N m, N", "admittance axes: what the device measures"),
        Column("SIDE.AXIS.wall_effort", "N m, N", "what the local wall adds"),
        Column(
            "SIDE.AXIS.answer_us",
            "µs",
            "CANopen, Modbus: from SYNC or request to the answer; NaN where none came",
        ),
    ),
    "A pair": (
        Column("PAIR.position_error", "rad, m", "master less slave, in the master's units"),
        Column(
            "PAIR.effort_error",
            "N m, N",
            "sum of both ports' efforts in the master's units; 0 in equilibrium",
        ),
    ),
    "Books of a coupling": (
        Column(
            "PAIR.port_SIDE.absorbed",
            "J",
            "each element has the three of these. Absorbed: what went into it since the start",
        ),
        Column("PAIR.port_SIDE.stored", "J", "what it holds now"),
        Column(
            "PAIR.port_SIDE.dissipated", "J", "what it turned into heat; negative: what it created"
        ),
        Column(
            "PAIR.damper_SIDE.absorbed",
            "J",
            "the matching damper; with `.stored` and `.dissipated`, as all below",
        ),
        Column(
            "PAIR.converter_SIDE.absorbed",
            "J",
            "conversion between the line's rate and that of a slow bus",
        ),
        Column("PAIR.line.absorbed", "J", "the delay line: the waves under way"),
        Column("PAIR.coupler.absorbed", "J", "spring and damper of the law `position`"),
        Column("PAIR.wall_SIDE.absorbed", "J", "a local wall"),
    ),
    "The truth of a simulated axis": (
        Column("true.SIDE.AXIS.position", "rad, m", "where it really is"),
        Column("true.SIDE.AXIS.velocity", "rad/s, m/s", ""),
        Column("true.SIDE.AXIS.reference", "rad, m", "where the hand wants to be"),
        Column("true.SIDE.AXIS.hand_effort", "N m, N", "what the hand does to the device"),
        Column("true.SIDE.AXIS.environment_effort", "N m, N", "what it touches does to it"),
        Column("plant.SIDE.AXIS.hand_work", "J", "work of the hand's intent"),
        Column("plant.SIDE.AXIS.motor_work", "J", "work of the motor"),
        Column("plant.SIDE.AXIS.kinetic", "J", "now in the moving mass"),
        Column("plant.SIDE.AXIS.grip_stored", "J", "now in the spring of the grip"),
        Column("plant.SIDE.AXIS.environment_stored", "J", "now in what it touches"),
        Column("plant.SIDE.AXIS.grip_loss", "J", "dissipated in the grip"),
        Column("plant.SIDE.AXIS.viscous_loss", "J", "dissipated in the device's damping"),
        Column("plant.SIDE.AXIS.coulomb_loss", "J", "dissipated in its Coulomb friction"),
        Column("plant.SIDE.AXIS.environment_loss", "J", "dissipated in what it touches"),
    ),
    "A scene": (
        Column("scene.kinetic", "J", "now in the masses"),
        Column("scene.stored", "J", "now in the links"),
        Column("scene.lifted", "J", "now held against gravity"),
        Column("scene.lost", "J", "dissipated by dampers, friction, plastic links and contacts"),
        Column("scene.made", "J", "created by negative dampers and energy sources"),
        Column("scene.numeric", "J", "created by a scheme that holds forces over a step"),
        Column("scene.port_work", "J", "done by the ports"),
        Column("scene.pumped", "J", "done by external forces"),
        Column("scene.residual", "J", "what the account of the network misses: rounding"),
        Column(
            "scene.hold",
            "J",
            "what the devices gave less than the network got, since efforts are held",
        ),
        Column(
            "scene.asked.PORT", "N m, N", "effort that the network asks of a port, before limits"
        ),
        Column(
            "scene.at.NODE",
            "m",
            "where a node is; in three dimensions one column for each coordinate",
        ),
    ),
}


def columns_page() -> str:
    """Return the page."""
    parts = [
        "# Row columns\n",
        "One row is recorded per cycle. `read_recording` gives each column as a NumPy array;"
        " Foxglove and PlotJuggler show the same names as topics. SIDE is `master` or `slave`;"
        " AXIS, PAIR, PORT and NODE are names of the rig. Units follow the axis, rotary first."
        " A rig records only the columns of what it has.\n",
    ]
    for title, columns in SECTIONS.items():
        parts.append(f"## {title}\n")
        parts.append(
            table(
                ("column", "unit", "meaning"), [(f"`{c.name}`", c.unit, c.meaning) for c in columns]
            )
        )
    return "\n".join(parts)
