"""Options of what goes wrong on a simulated serial line, as the buses of servos have them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from tautwave_sim.wire.serial_faults import PACKET_KINDS, Event

STRICT = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

Chance = Annotated[float, Field(ge=0.0, le=1.0)]
DeviceId = Annotated[int, Field(ge=0, le=253)]

PacketKind = Literal["lost", "late", "truncated", "corrupted", "wrong_id", "extra_bytes", "deaf"]


class SerialEvent(BaseModel):
    """One scripted fault: of a packet, or at a moment; a bus names its kinds."""

    model_config = STRICT

    kind: str
    at_s: Annotated[float, Field(ge=0.0)] | None = None
    """[s] After slot 0; a packet fault hits the first packet from then on."""
    nth: Annotated[int, Field(ge=1)] | None = None
    """The response with this number; for `deaf` the instruction."""
    id: DeviceId | None = None
    """The servo; not given: any, or all."""

    @model_validator(mode="after")
    def _when(self) -> SerialEvent:
        packet = self.kind in PACKET_KINDS
        if not packet and (self.at_s is None or self.nth is not None):
            raise ValueError(f"{self.kind} happens at a moment: give at_s, and no nth")
        if packet and self.at_s is None and self.nth is None:
            raise ValueError(f"{self.kind} happens to a packet: give nth or at_s")
        return self

    def event(self) -> Event:
        """Return it as plain data."""
        return Event(self.kind, self.at_s, self.nth, self.id)


class SerialFaults(BaseModel):
    """Chances per response (`deaf`: per instruction and servo); a bus adds its script."""

    model_config = STRICT

    seed: Annotated[int, Field(ge=0)] = 0
    lost: Chance = 0.0
    late: Chance = 0.0
    truncated: Chance = 0.0
    corrupted: Chance = 0.0
    wrong_id: Chance = 0.0
    extra_bytes: Chance = 0.0
    deaf: Chance = 0.0
    late_s: Annotated[float, Field(gt=0.0)] = 0.005
    """[s] How late a late response is."""

    def chances(self) -> dict[str, float]:
        """Return the probability of each kind."""
        return {kind: float(getattr(self, kind)) for kind in PACKET_KINDS}
