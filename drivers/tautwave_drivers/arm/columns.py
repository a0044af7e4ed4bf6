"""What is recorded of an arm whose tip is an axis; each is filled beside where it is computed."""

from __future__ import annotations

from tautwave.columns import Column, under

POSITION = Column("position", "rad, m", "driver `arm`: a joint behind the tip")
EFFORT = Column("effort", "N m, N", "sent to it, weight and walls included")
VELOCITY = Column("velocity", "rad/s, m/s", "sent to one that follows velocities")
MAPPED = (
    Column("mapped", "J", "given to the joints beyond the books of the tip"),
    Column("mapped_given", "J", "the most of that at any time"),
)
OF_EFFORTS = (
    *MAPPED,
    Column("potential", "J", "what weight and posture hold more than at the start"),
    Column("leak", "J", "taken out by what holds them, with the potential's change"),
    Column("given", "J", "most that was given at any time beyond the potential"),
)
"""Books of a tip whose joints take efforts."""
OF_VELOCITIES = (
    *MAPPED,
    Column("lever", "m", "least of a tip that follows velocities, in any direction"),
    Column("allowed", "1", "share of its motion that its account allows"),
)
"""Books of a tip whose joints follow velocities."""
WALL = (
    Column("fx", "N", "force of a wall in space on the tip, along the frame"),
    Column("fy", "N", ""),
    Column("fz", "N", ""),
    Column("depth", "m", "of the tip below its proxy"),
    Column("account", "J", "what the wall may give back"),
    Column("absorbed", "J", "taken out of the joints by it"),
    Column("noise", "J", "put back for the encoders' noise"),
)
COLUMNS = (
    *under("joints.SIDE.JOINT", (POSITION, EFFORT, VELOCITY)),
    *under("tip.BUS", dict.fromkeys((*OF_EFFORTS, *OF_VELOCITIES))),
    *under("space.BUS.WALL", WALL),
)
