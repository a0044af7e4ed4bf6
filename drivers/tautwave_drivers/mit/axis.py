"""One motor as the loop sees it: its answers matched to commands, and the state they report."""

from __future__ import annotations

import functools
import math
import struct

from tautwave.contracts import AxisSpec
from tautwave.types import JointState
from tautwave_drivers.causes import Cause
from tautwave_drivers.mit import damiao
from tautwave_drivers.mit.damper import DamperBooks
from tautwave_drivers.mit.options import Motor, Scale, damper_of, scale_of

NAN = math.nan
_NEW = tuple.__new__
_UNPACK = struct.Struct(">xHH3x").unpack
"""Position, and the two bytes of which the first twelve bits are the velocity."""
MISSING = JointState(0.0, NAN, NAN, False, 0)
ABOUT_REGISTERS = Cause("about registers", "another program asks this motor: stop it")
OF_ANOTHER = Cause(
    "of another motor", "give each its own feedback id (MST_ID, register 7) in the maker's tool"
)
OUTDATED = Cause("to an older command", "check the bus load and the rate")
FORGOT = "it was switched off and on, or another program switched it off; check its supply"


@functools.cache
def _frames(first: bytes, high: int) -> tuple[bytes, ...]:
    """Return commands by the code of their torque; `high` has kd's last bits.

    A table, as a cycle has time for neither shifts nor masks.
    """
    return tuple(first + bytes((high | code >> 8, code & 0xFF)) for code in range(damiao.TOP + 1))


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
        "_acting", "_code_of", "_damped", "_frames", "_lines", "_motion", "_nibble", "_said",
        "_told", "arrived_ns", "damper", "fault", "fresh", "late", "motor", "scale", "spec",
        "state", "upper", "wrong",
    )  # fmt: skip

    def __init__(self, spec: AxisSpec, motor: Motor, period: float) -> None:
        self.spec = spec
        self.motor = motor
        self.damper: DamperBooks | None = None
        damper = damper_of(motor)
        if damper is not None:
            scale = scale_of(motor)
            self.damper = DamperBooks(
                damper.damping, damper.filter_s, (scale.position, scale.torque), period
            )
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
        self._motion = (*self._lines[0], *self._lines[1])
        limit = self.spec.effort_limit
        bare = scale._replace(damping_code=0, push=0.0)
        # What a command is made of: its coder of torque, and the frames by their codes.
        (self._code_of, self._frames), self._damped = (
            (one.coder(limit), _frames(frame[:6], frame[6]))
            for one in (bare, scale)
            if (frame := damiao.command(0, one.damping_code))
        )

    def reset(self) -> None:
        """Forget what the motor said."""
        self.fresh = self.upper = False
        self.state: int | None = None
        self.fault = ""
        self.late = 0
        self.wrong: dict[Cause, int] = {}
        self.arrived_ns = 0
        self._said = bytes(8)
        self._told = self._acting = 0.0
        if self.damper is not None:
            self.damper.reset()

    def take(self, data: bytes, arrival_ns: int) -> bool:
        """Take the motor's feedback; False where these bytes are not feedback."""
        if len(data) == 8:
            head = data[0]
            if head & 0xF == self._nibble and (data[1] > 0xF or not damiao.is_parameter(data)):
                self.state = head >> 4
                self._said = data
                self.arrived_ns = arrival_ns
                return True
        return False

    @property
    def position(self) -> float:
        """[rad] Of the axis, as last reported."""
        zero, step = self._lines[0]
        return zero + step * (self._said[1] << 8 | self._said[2])

    @property
    def velocity(self) -> float:
        """[rad/s] Of the axis, as last reported."""
        still, pace = self._lines[1]
        return still + pace * (self._said[3] << 4 | self._said[4] >> 4)

    @property
    def torque(self) -> float:
        """[N m] On the axis, as last reported."""
        slack, force = self._lines[2]
        return slack + force * ((self._said[4] & 0xF) << 8 | self._said[5])

    @property
    def temperatures(self) -> tuple[int, int]:
        """[degC] Of the driver and of the rotor, as last reported."""
        return self._said[6], self._said[7]

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

    def command(self, effort: float, damped: bool = True) -> bytes:
        """Return the frame of an effort [N m], zero once the motor is not to be driven.

        With the motor's damper, where it has one and is to be `damped`.
        """
        upper = self.upper = not self.upper
        if self.fault:
            effort = 0.0
        elif self.damper is not None:
            self._acting, self._told = self._told, effort if damped else NAN
            if damped:
                code_of, frames = self._damped
                return frames[code_of(effort, upper)]
        return self._frames[self._code_of(effort, upper)]

    def book(self) -> None:
        """Take this cycle's sample, or that there is none, into the books of the damper."""
        if self.damper is None:
            return
        if self.fresh:
            self.damper.take(self.position, self.torque - self._acting)  # NaN: it was not damped
        else:
            self.damper.miss()

    def joint_state(self, now_ns: int) -> JointState:
        """Return this cycle's sample, invalid where there is none or the motor is in doubt."""
        if not self.fresh or self.fault:
            return MISSING
        zero, step, still, pace = self._motion
        place, word = _UNPACK(self._said)
        age_ns = now_ns - self.arrived_ns
        # As `JointState(...)`, in two thirds of the time.
        return _NEW(
            JointState,
            (
                zero + step * place,
                still + pace * (word >> 4),
                NAN,
                True,
                age_ns if age_ns > 0 else 0,
            ),
        )

    @property
    def label(self) -> str:
        """The motor by its number."""
        return f"motor {self.motor.id}"
