"""One motor as the loop sees it: its answers matched to commands, and what they say of it."""

from __future__ import annotations

import math

from tautwave.contracts import AxisSpec
from tautwave.types import JointState
from tautwave_drivers.mit import damiao
from tautwave_drivers.mit.options import Motor, Scale, scale_of

NAN = math.nan
MISSING = JointState(0.0, NAN, NAN, False, 0)
FORGOT = "it was switched off and on, or another program switched it off; check its supply"


class Axis:
    """State of one motor between two exchanges.

    Attributes
    ----------
    fresh : bool
        This cycle's answer is there.
    state : int or None
        What the motor last said that it is; None: nothing yet.
    fault : str
        Why it is not to be driven any more.
    late : int
        Answers that came when their cycle was over.
    """

    __slots__ = (
        "arrived_ns", "driver_temperature", "fault", "fresh", "late", "motor", "position",
        "rotor_temperature", "scale", "spec", "state", "torque", "upper", "velocity",
    )  # fmt: skip

    def __init__(self, spec: AxisSpec, motor: Motor) -> None:
        self.spec = spec
        self.motor = motor
        self.scale: Scale = scale_of(motor)
        self.reset()

    def reset(self) -> None:
        """Forget what the motor said."""
        self.fresh = self.upper = False
        self.state: int | None = None
        self.fault = ""
        self.late = 0
        self.arrived_ns = 0
        self.position = self.velocity = self.torque = 0.0
        self.driver_temperature = self.rotor_temperature = 0

    def take(self, data: bytes, arrival_ns: int) -> bool:
        """Take the motor's feedback; False where these bytes are none."""
        said = damiao.feedback(data, self.motor.id)
        if said is None:
            return False
        scale = self.scale
        self.state = said.state
        self.position = scale.position_of(said.position)
        self.velocity = scale.velocity_of(said.velocity)
        self.torque = scale.torque_of(said.torque)
        self.driver_temperature = said.driver_temperature
        self.rotor_temperature = said.rotor_temperature
        self.arrived_ns = arrival_ns
        return True

    def judge(self) -> str:
        """Return why a motor that was enabled is not, '' while it is."""
        if self.state == damiao.ENABLED or self.state is None:
            return ""
        text = damiao.state_text(self.state)
        if self.state == damiao.DISABLED:
            return f"{text}: {FORGOT}; run again"
        if self.state == damiao.TIMED_OUT:
            return f"{text}: its {damiao.TIMEOUT} has passed and its torque is off; run again"
        return f"{text}: its torque is off; remove the cause, then run again"

    def command(self, effort: float) -> bytes:
        """Return the frame of an effort [N m], zero once the motor is not to be driven."""
        self.upper = not self.upper
        wanted = 0.0 if self.fault else effort
        return damiao.command(self.scale.torque_code(wanted, self.spec.effort_limit, self.upper))

    def joint_state(self, now_ns: int) -> JointState:
        """Return this cycle's sample, invalid where there is none or the motor is in doubt."""
        if not self.fresh or self.fault:
            return MISSING
        return JointState(self.position, self.velocity, NAN, True, max(now_ns - self.arrived_ns, 0))

    @property
    def label(self) -> str:
        """The motor by its number."""
        return f"motor {self.motor.id}"
