"""What stands behind a CAN port, whatever is on the bus: its wire, its faults, its time."""

from __future__ import annotations

from abc import ABC, abstractmethod

from tautwave_sim.wire.can import CanTiming
from tautwave_sim.wire.can_faults import CanFaultPlan
from tautwave_sim.wire.can_medium import CanMedium, MediumPort


class CanWorld(ABC):
    """A CAN bus with devices on it.

    Parameters
    ----------
    timing : CanTiming
        Time that frames take.
    plan : CanFaultPlan
        What goes wrong.
    period_ns : int
        Of the slots that the devices' axes move on.
    now_ns : int
        When everything is switched on.

    Attributes
    ----------
    extended : bool
        Its devices use identifiers of 29 bits.
    """

    extended = False

    def __init__(self, timing: CanTiming, plan: CanFaultPlan, period_ns: int, now_ns: int) -> None:
        self.plan = plan
        self.medium = CanMedium(timing, now_ns, plan, self.elapsed_ns)
        self._period_ns = period_ns
        self._origin_ns: int | None = None

    def elapsed_ns(self, t_ns: int) -> int | None:
        """Return the time since the devices began to move [ns], None before."""
        return None if self._origin_ns is None else t_ns - self._origin_ns

    def port_fault(self, port: MediumPort) -> str:
        """Return what ails the master's `port` now: '', `queue_full`, `bus_off` or `bus_down`."""
        if self.plan.idle:
            return "bus_off" if port.off else ""
        ails = self.plan.port(self.elapsed_ns(self.medium.now_ns))
        self.medium.down = ails == "bus_down"
        if ails == "bus_off" and not port.off:
            port.leave(self.medium.now_ns)
        return "bus_off" if port.off and ails != "bus_down" else ails

    @abstractmethod
    def next_event_ns(self) -> int | None:
        """Return when something happens next by itself."""

    @abstractmethod
    def advance(self, to_ns: int) -> None:
        """Let everything happen that happens up to `to_ns`, in its order."""
