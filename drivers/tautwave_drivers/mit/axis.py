"""One motor as the loop sees it: its answers matched to commands, and the state they report."""

from __future__ import annotations

import math

from tautwave.contracts import AxisSpec
from tautwave.types import JointState
from tautwave_drivers.causes import Cause
from tautwave_drivers.mit import damiao
from tautwave_drivers.mit.damper import DamperBooks
from tautwave_drivers.mit.options import Motor, Scale, scale_of

NAN = math.nan
_UNPACK = damiao.FEEDBACK.unpack
MISSING = JointState(0.0, NAN, NAN, False, 0)
ABOUT_REGISTERS = Cause("about registers", "another program asks this motor: stop it")
OF_ANOTHER = Cause(
    "of another motor", "give each its own feedback id (MST_ID, register 7) in the maker's tool"
)
OUTDATED = Cause("to an older command", "check the bus load and the rate")
FORGOT = "it was switched off and on, or another program switched it off; check its supply"


class Axis:
    """State of one motor between two exchanges.

    Attributes
    ----------
    fresh : bool
        This cycle's answer is there.
    state : int or None
        The state that the motor last reported; None: none yet.
    fault : str
        Why it must not be driven any more, else ''.
    late : int
        Answers that came when their cycle was over.
    wrong : dict
        Wrong answers since the last sample, counted by cause.
    damper : DamperBooks or None
        Books of the damper in the motor, None without one.
    """

    __slots__ = (
        "_acting", "_lines", "_nibble", "_told", "arrived_ns", "damper", "driver_temperature",
        "fault", "fresh", "late", "motor", "position", "rotor_temperature", "scale", "spec",
        "state", "torque", "upper", "velocity", "wrong",
    )  # fmt: skip

    def __init__(self, spec: AxisSpec, motor: Motor, period: float) -> None:
        self.spec = spec
        self.motor = motor
        self.damper: DamperBooks | None = None
        if motor.damping_code:
            scale = scale_of(motor)
            damping = motor.damping_code * damiao.DAMPING_STEP
            self.damper = DamperBooks(damping, (scale.position, scale.torque), period)
        self._nibble = motor.id & 0xF
        self.rescale(scale_of(motor))
        self.reset()

    def rescale(self, scale: Scale) -> None:
        """Take the scale of the motor's codes."""
        self.scale = scale
        zeros = scale.position_of(0), scale.velocity_of(0), scale.torque_of(0)
        steps = scale.position, scale.velocity, scale.torque
        # Value of code 0, and of a step: what a cycle needs.
        self._lines = tuple(
            (zero, scale.direction * step) for zero, step in zip(zeros, steps, strict=True)
        )

    def reset(self) -> None:
        """Forget what the motor said."""
        self.fresh = self.upper = False
        self.state: int | None = None
        self.fault = ""
        self.late = 0
        self.wrong: dict[Cause, int] = {}
        self.arrived_ns = 0
        self.position = self.velocity = self.torque = 0.0
        self.driver_temperature = self.rotor_temperature = 0
        self._told = self._acting = 0.0
        if self.damper is not None:
            self.damper.reset()

    def take(self, data: bytes, arrival_ns: int) -> bool:
        """Take the motor's feedback; False where these bytes are none."""
        if len(data) != 8:
            return False
        head, place, high, middle, low, driver, rotor = _UNPACK(data)
        if head & 0xF != self._nibble or (place < 0x1000 and damiao.is_parameter(data)):
            return False
        (zero, step), (still, pace), (slack, force) = self._lines
        self.state = head >> 4
        self.position = zero + step * place
        self.velocity = still + pace * (high << 4 | middle >> 4)
        self.torque = slack + force * ((middle & 0xF) << 8 | low)
        self.driver_temperature = driver
        self.rotor_temperature = rotor
        self.arrived_ns = arrival_ns
        return True

    def miss(self, cause: Cause) -> None:
        """Count what came instead of a sample."""
        self.wrong[cause] = self.wrong.get(cause, 0) + 1

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
        scale = self.scale
        if self.fault:
            scale = scale._replace(damping_code=0, push=0.0)
            effort = 0.0
        code = scale.torque_code(effort, self.spec.effort_limit, self.upper)
        if self.damper is not None:
            self._acting, self._told = self._told, effort
        return damiao.command(code, scale.damping_code)

    def book(self) -> None:
        """Take this cycle's sample, or that there is none, into the books of the damper."""
        if self.damper is None:
            return
        if self.fresh:
            self.damper.take(self.position, self.torque - self._acting)
        else:
            self.damper.miss()

    def joint_state(self, now_ns: int) -> JointState:
        """Return this cycle's sample, invalid where there is none or the motor is in doubt."""
        if not self.fresh or self.fault:
            return MISSING
        return JointState(self.position, self.velocity, NAN, True, max(now_ns - self.arrived_ns, 0))

    @property
    def label(self) -> str:
        """The motor by its number."""
        return f"motor {self.motor.id}"
