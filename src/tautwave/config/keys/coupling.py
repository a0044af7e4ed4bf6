"""`coupling` and `loop`: the law between master and slave, and how it is run."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from tautwave.config.keys.common import Block, Name, NonNegative, Positive


class Wall(Block):
    """A local virtual wall: a unilateral spring and damper, on this side's own measurement."""

    position: float = Field(description="[rad | m] Where the wall begins.")
    stiffness: Positive = Field(
        description="[N m/rad | N/m] Passive while device damping b > stiffness T / 2 + damping."
    )
    damping: NonNegative = Field(
        default=0.0, description="[N m s/rad | N s/m] Steadies the wall, but costs passivity."
    )
    side: Literal["above", "below"] = Field(
        default="above", description="above: the wall fills everything above `position`."
    )
    passivity_control: bool = Field(
        default=False, description="Take back at once whatever energy sampling created."
    )
    derate: bool = Field(
        default=False,
        description="Render the stiffest wall that the certificate allows where `stiffness` is "
        "more; impedance axes only.",
    )


def _check_offset(value: Any) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value == "at_engage" or (number and math.isfinite(value)):
        return value
    raise PydanticCustomError("offset", "Input should be 'at_engage' or a finite number")


class Pair(Block):
    """A master axis and the slave axis of the same name."""

    wave_impedance: Positive | None = Field(
        default=None,
        description="[N m s/rad | N s/m] Characteristic impedance of the line, in the master's "
        "units; law wave only, and required there. Small: light and soft; large: heavy and crisp.",
    )
    stiffness: Positive | None = Field(
        default=None, description="[N m/rad | N/m] Law position only, and required there."
    )
    damping: NonNegative | None = Field(
        default=None, description="[N m s/rad | N s/m] Law position only, and required there."
    )
    position_scale: Positive = Field(
        default=1.0,
        description="Slave motion per master motion; has a unit (m/rad) if the kinds differ, and "
        "has to be given then.",
    )
    force_scale: Positive | None = Field(
        default=None,
        description="Slave effort per master effort; default 1/position_scale, which keeps power.",
    )
    sign: Literal[1, -1] = Field(default=1, description="-1: the slave moves the other way.")
    offset: Annotated[Literal["at_engage"] | float, BeforeValidator(_check_offset)] = Field(
        default="at_engage",
        description="[rad | m, master] Position of the master at which the slave is at 0; "
        "at_engage: whatever it is when the coupling engages.",
    )
    engage_tolerance: Positive | None = Field(
        default=None,
        description="[rad | m, master] Greatest mismatch at which the coupling engages; "
        "required when `offset` is a number.",
    )
    matched_master: bool = Field(
        default=False, description="Law wave only: matching damper at the master's end."
    )
    matched_slave: bool = Field(
        default=False, description="Law wave only: matching damper at the slave's end."
    )
    drift_time_s: Positive = Field(
        default=0.05, description="[s] Time constant at which position drift is taken back."
    )
    wall_master: Wall | None = Field(default=None, description="Local wall at the master.")
    wall_slave: Wall | None = Field(default=None, description="Local wall at the slave.")

    @property
    def effective_force_scale(self) -> float:
        """Slave effort per master effort: what was given, else 1/position_scale."""
        return 1.0 / self.position_scale if self.force_scale is None else self.force_scale


class Coupling(Block):
    """How master and slave are coupled."""

    law: Literal["wave", "position"] = Field(
        default="wave",
        description="wave: passive at any constant delay; position: spring and damper between the "
        "two, for comparison.",
    )
    delay_s: Annotated[float, Field(ge=0, le=60)] = Field(
        default=0.0, description="[s] One-way delay of the line; a whole number of samples."
    )
    wave_filter_hz: Positive | None = Field(
        default=None, description="[Hz] Corner of a low-pass on the waves; at most half the rate."
    )
    engage_ramp_s: NonNegative = Field(
        default=0.2, description="[s] The coupling fades in over this time."
    )
    release_ramp_s: NonNegative = Field(
        default=0.2, description="[s] The coupling fades out over this time."
    )
    pairs: dict[Name, Pair] = Field(description="The pairs by name: one per axis of each side.")


class Loop(Block):
    """How the loop is run and when it gives up."""

    missing_limit: Annotated[int, Field(ge=1)] = Field(
        default=20, description="Consecutive missing samples of an axis that end in a safety stop."
    )
    overrun_limit: Annotated[int, Field(ge=1)] = Field(
        default=200, description="Consecutive skipped slots that end in a safety stop."
    )
    fifo_priority: Annotated[int, Field(ge=0, le=99)] = Field(
        default=50, description="Real-time priority to ask for; 0: do not ask."
    )
    cpu: Annotated[int, Field(ge=0)] | None = Field(
        default=None, description="Processor to stay on; none: any."
    )
    lock_memory: bool = Field(default=True, description="Ask that memory is never paged out.")
    ring_rows: Annotated[int, Field(ge=64, le=1 << 20)] = Field(
        default=8192, description="Rows between the loop and the process that writes them."
    )
