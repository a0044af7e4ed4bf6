"""What the recorded columns of a scene are."""

from __future__ import annotations

from tautwave.columns import Column

SECTIONS = {
    "A scene": (
        Column("scene.kinetic", "J", "now in the masses"),
        Column("scene.stored", "J", "now in the links"),
        Column("scene.lifted", "J", "now held against gravity"),
        Column("scene.lost", "J", "dissipated by dampers, friction, plastic links and contacts"),
        Column("scene.made", "J", "created by negative dampers and energy sources"),
        Column("scene.numeric", "J", "created by a scheme that holds forces over a step"),
        Column("scene.port_work", "J", "done by the ports"),
        Column("scene.pumped", "J", "done by external forces"),
        Column("scene.residual", "J", "residual of the network's energy balance: rounding"),
        Column(
            "scene.hold",
            "J",
            "energy that the network received beyond what the devices "
            "supplied, due to the effort hold",
        ),
        Column(
            "scene.asked.PORT", "N m, N", "effort commanded by the network at a port, before limits"
        ),
        Column(
            "scene.at.NODE",
            "m",
            "position of a node; in three dimensions one column per coordinate",
        ),
    ),
}
