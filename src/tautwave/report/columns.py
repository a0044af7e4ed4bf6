"""What each column of a recording is: unit and meaning; a test holds it to every shipped rig."""

from __future__ import annotations

from tautwave import registry
from tautwave.columns import Column, under
from tautwave.config.keys.control import SCENE
from tautwave.controller.rows import AXIS, MEASURED, PAIR, WALL
from tautwave.errors import ConfigError
from tautwave.runtime.loop import TIMING
from tautwave.truth import OF_HAND, OF_PLACE, PLANT, TRUE

SECTIONS = {
    "The cycle": (*TIMING,),
    "An axis": (
        *under("SIDE.AXIS", AXIS),
        Column("SIDE.AXIS.wave_in", "W^½", "the wave that arrived (law `wave`)"),
        Column("SIDE.AXIS.wave_out", "W^½", "the wave that left (law `wave`)"),
        Column(
            "SIDE.AXIS.believed_effort",
            "N m, N",
            "external effort on the device, by the law's observer "
            "(`four_channel`, `position_force`)",
        ),
        Column(
            "SIDE.AXIS.model_stiffness",
            "N m/rad, N/m",
            "law `mediated`: position of the surface last found by the slave or rendered by the "
            "master; negative: it fills what is below",
        ),
        Column("SIDE.AXIS.model_position", "rad, m", "where that surface is"),
        Column(
            "SIDE.AXIS.model_interval",
            "N m/rad, N/m",
            "half-width of the 95 % interval of the stiffness estimated at the slave",
        ),
        Column(
            "SIDE.AXIS.model_paid",
            "J",
            "energy paid by the account so far for changes of a surface in contact",
        ),
        Column("SIDE.AXIS.link_delay", "s", "over a network: age of the wave that was played out"),
        Column("SIDE.AXIS.link_depth", "s", "over a network: how much of that was waiting here"),
        Column(
            "SIDE.AXIS.link_backlog",
            "rad, m",
            "over a network: motion of the other side still outstanding, in the master's units",
        ),
        Column("SIDE.AXIS.link_silence", "s", "over a network: since the last packet arrived"),
        Column("SIDE.AXIS.link_lost", "", "over a network: packets lost on the way here, so far"),
        Column(
            "SIDE.AXIS.link_cut",
            "",
            "over a network: cycles so far in which the energy received did not cover the wave",
        ),
        *under("SIDE.AXIS", [MEASURED]),
        Column(
            "SIDE.AXIS.followed",
            "rad, m",
            "followers: where the device was measured last; `position` is its goal, and"
            " `measured_effort` the spring between them",
        ),
        Column(
            "SIDE.AXIS.motor_effort",
            "N m, N",
            "motor effort from its current, where the drive reports it; NaN: no sample",
        ),
        Column(
            "SIDE.AXIS.driver_temperature",
            "degC",
            "of the motor's power stage, where it is reported; NaN: no sample",
        ),
        Column(
            "SIDE.AXIS.rotor_temperature",
            "degC",
            "of the motor's windings, where it is reported; NaN: no sample",
        ),
        Column(
            "SIDE.AXIS.motor_temperature",
            "degC",
            "of the motor or its housing, where it is reported; NaN: no sample",
        ),
        Column(
            "SIDE.AXIS.supply_voltage",
            "V",
            "of the motor's supply, where it is reported; NaN: no sample",
        ),
        Column(
            "SIDE.AXIS.damper_absorbed",
            "J",
            "taken so far by the damper in the motor, as the motor reports its torque",
        ),
        Column(
            "SIDE.AXIS.damper_least",
            "J",
            "taken so far by the damper in the motor, at least, by its model",
        ),
        *under("SIDE.AXIS", [WALL]),
        Column(
            "SIDE.AXIS.answer_us",
            "µs",
            "CANopen, Modbus: from SYNC or request to the response; NaN if none arrived",
        ),
        Column(
            "slave.AXIS.target",
            "rad, m",
            "added by `export`: where the pair wants the slave, in the slave's coordinates",
        ),
    ),
    "One of two sites": (
        Column("link.session", "", "number of the session, from 1 on"),
        Column("link.slot", "", "own slot of the session, from 0 on; -1: not engaged"),
        Column("link.silence_s", "s", "since a packet from the other site arrived"),
        Column("link.holding", "0, 1", "whether it holds, for lack of the other site"),
        Column("link.delay_s", "s", "one way of the newest packet, to half a round trip"),
        Column("link.aligning", "0, 1", "whether slaves are brought into place, or wait there"),
        Column(
            "PAIR.align_slave.absorbed",
            "J",
            "energy absorbed by the slave's motor meanwhile; negative: supplied",
        ),
        Column(
            "PAIR.hold_master.absorbed",
            "J",
            "operated rig: energy absorbed by the master's motor while not engaged",
        ),
    ),
    "A pair": (*under("PAIR", PAIR),),
    "An operated rig": (
        Column(
            "operation.state",
            "",
            "0 idle, 1 aligning, 2 engaged, 3 clutched, 4 holding, 5 stopping",
        ),
        Column(
            "operation.command",
            "",
            "command taken in this cycle: 1 engage, 2 clutch, 3 hold, 4 rest, 5 stop, 6 scale, "
            "7 episode, 8 payload, 9 take_over, 10 hand_back",
        ),
        Column("operation.engagement", "", "number of engagements so far"),
        Column("operation.episode", "", "number of the current episode, 0 for none"),
        Column("operation.scale", "", "factor on every pair's position_scale, 1 at first"),
        Column(
            "operation.intervention",
            "0, 1",
            "with `operate.policy`: whether a person leads instead of the policy",
        ),
        Column("policy.PAIR.reference", "rad, m", "where the policy leads the master to"),
        Column("policy.PAIR.effort", "N m, N", "of the hand that the master's own motor plays"),
        Column(
            "policy.PAIR.given",
            "J",
            "energy that this hand gave beyond what its reference brought; negative: it took",
        ),
        Column(
            "PAIR.operate.absorbed",
            "J",
            "energy absorbed by both motors while not engaged; negative: supplied by an alignment",
        ),
    ),
    "A rig that is tuned": (
        Column("tuning.generation", "", "number of parameter sets applied so far"),
        Column("tuning.SIDE.AXIS.wall_stiffness", "N m/rad, N/m", "of the local wall, as it acts"),
        Column("tuning.SIDE.AXIS.wall_damping", "N m s/rad, N s/m", "of the local wall"),
        Column("tuning.SIDE.AXIS.wall_position", "rad, m", "of the local wall"),
        Column("tuning.SIDE.AXIS.effort_ceiling", "N m, N", "maximum effort of wall and coupling"),
        Column("tuning.PAIR.wave_filter_hz", "Hz", "corner of the filter in both ports"),
    ),
    "Books of a coupling": (
        Column(
            "PAIR.port_SIDE.absorbed",
            "J",
            "each element has all three. Absorbed: energy that entered it since the start",
        ),
        Column("PAIR.port_SIDE.stored", "J", "what it holds now"),
        Column("PAIR.port_SIDE.dissipated", "J", "energy dissipated; negative: created"),
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
        Column("PAIR.line.absorbed", "J", "the delay line: waves in transit"),
        Column(
            "PAIR.receiver_SIDE.absorbed",
            "J",
            "over a network: energy sent to a side and not yet released, in counts of 2^-40 J",
        ),
        Column("PAIR.network.absorbed", "J", "over a network: energy in transit"),
        Column("PAIR.coupler.absorbed", "J", "a position law: its spring and the remainder"),
        Column(
            "PAIR.account_SIDE.absorbed",
            "J",
            "an account: work of its law, credit received minus sent",
        ),
        Column("PAIR.credits.absorbed", "J", "credit in transit between accounts"),
        Column("PAIR.model_master.absorbed", "J", "law `mediated`: the spring that is rendered"),
        Column("PAIR.compensation_SIDE.absorbed", "J", "friction compensation; negative: supplied"),
        Column(
            "PAIR.inertia_SIDE.absorbed",
            "J",
            "inertia compensation, by account; negative: supplied",
        ),
        Column("PAIR.wall_SIDE.absorbed", "J", "a local wall"),
    ),
    "What carries a load": (
        Column("load.SIDE.AXIS.effort", "N m, N", "sent beside the coupling's, along the position"),
        Column("load.SIDE.AXIS.energy", "J", "absorbed by it from the device; negative: supplied"),
        Column(
            "load.ARM.potential", "J", "what the loads of a side or arm hold more than at the start"
        ),
        Column("load.ARM.leak", "J", "all of that energy with the potential's change"),
        Column("load.ARM.given", "J", "most that was given at any time beyond the potential"),
        Column("load.ARM.changed", "J", "put into the potential by payload changes and felt ramps"),
    ),
    "A simulated arm": (
        Column("joints.SIDE.JOINT.position", "rad, m", "driver `arm`: a joint behind the tip"),
        Column("joints.SIDE.JOINT.effort", "N m, N", "sent to it, weight and walls included"),
        Column("joints.SIDE.JOINT.velocity", "rad/s, m/s", "sent to one that follows velocities"),
        Column("tip.BUS.mapped", "J", "given to the joints beyond the books of the tip"),
        Column("tip.BUS.mapped_given", "J", "the most of that at any time"),
        Column("tip.BUS.potential", "J", "what weight and posture hold more than at the start"),
        Column("tip.BUS.leak", "J", "taken out by what holds them, with the potential's change"),
        Column("tip.BUS.given", "J", "most that was given at any time beyond the potential"),
        Column("tip.BUS.lever", "m", "least of a tip that follows velocities, in any direction"),
        Column("tip.BUS.allowed", "1", "share of its motion that its account allows"),
        Column("space.BUS.WALL.fx", "N", "force of a wall in space on the tip, along the frame"),
        Column("space.BUS.WALL.fy", "N", ""),
        Column("space.BUS.WALL.fz", "N", ""),
        Column("space.BUS.WALL.depth", "m", "of the tip below its proxy"),
        Column("space.BUS.WALL.account", "J", "what the wall may give back"),
        Column("space.BUS.WALL.absorbed", "J", "taken out of the joints by it"),
        Column("space.BUS.WALL.noise", "J", "put back for the encoders' noise"),
        Column("arm.ARM.kinetic", "J", "now in its moving links and motors"),
        Column("arm.ARM.potential", "J", "its height, from that at the start"),
        Column("arm.ARM.work", "J", "given to it by all joints: `plant.SIDE.AXIS.kinetic`, added"),
    ),
    "The truth of a simulated axis": (
        *under("true.SIDE.AXIS", (*TRUE, *OF_HAND, *OF_PLACE)),
        *under("plant.SIDE.AXIS", PLANT),
    ),
}


def sections() -> dict[str, tuple[Column, ...]]:
    """Return all sections, with those of the package behind `scene` if it is installed."""
    try:
        of_scene = registry.control_hooks(SCENE, "report").columns()
    except ConfigError:
        of_scene = {}
    return {**SECTIONS, **of_scene}


def unit_of(column: str, kind: str = "rotary", causality: str = "impedance") -> str:
    """Return the SI unit of a recorded column, "" for counts, states and what is not listed.

    Parameters
    ----------
    column : str
        Its name.
    kind : str
        `rotary` or `linear`: of the axis or pair that it is about.
    causality : str
        `impedance` or `admittance`: of the axis that it is about.
    """
    if column.endswith((".absorbed", ".stored", ".dissipated")):
        return "J"
    of_scene = column.startswith(f"{SCENE}.")
    for columns in (sections() if of_scene else SECTIONS).values():
        for one in columns:
            if one.matches(column):
                parts = one.unit.split("; ")
                units = parts[-1 if causality == "admittance" else 0].split(", ")
                unit = units[-1 if kind == "linear" else 0]
                return "" if unit in ("0", "1") else unit
    return ""
