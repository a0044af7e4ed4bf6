"""A scene in the loop: axes of the master as its ports, and its books.

All ports of a cycle are closed first; the last one advances the scene by one period with the
present measurements, and every axis gets the resulting effort: the paper's one-sample structure.
`hold` is the difference between the energy from the devices and that received by the network: what
ramp and limits clip, and what a held effort creates.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING

from tautwave.contracts import Row
from tautwave.controller.axis import pass_slot, render_axis, start_axis, take_sample
from tautwave.controller.braking import miss_axis
from tautwave.controller.records import FINISHED, AxisParams, AxisState, RunParams
from tautwave.controller.rows import axis_columns, fill_axis
from tautwave.controller.run import arm, ramp_share, stop_on_guard
from tautwave.controller.slotted import all_slotted, slotted
from tautwave.controller.steps import Guard, Law, Steps
from tautwave.controller.stops import AxisName
from tautwave.laws.limit import OVERDRAWN, RUNAWAY, RUNAWAY_TIMES
from tautwave.runtime.control import Control
from tautwave_scenes.networks.ledger import Ledger
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.runtime.hold import HoldAccount, absorbed

if TYPE_CHECKING:  # a one-dimensional scene loads no 3D code
    from tautwave_scenes.networks3d.live import Model3d

MAX_NODES = 100
"""Most nodes whose positions are recorded."""


@dataclass(slots=True)
class SceneEnd:
    """What a device gave to its port of the scene [J]."""

    absorbed: float = 0.0


def book_work(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Book the work on the port."""
    s.end.absorbed += port * displacement


SCENE = Law("scene", Steps(close=book_work), SceneEnd)
"""A scene in the place of a coupling; it thinks for all axes at once."""


def guarded(limit: float) -> Law:
    """Return the scene's law with the sentence of its stop; `limit` [J] is that of its account."""
    sentence = "drew more energy from its scene than it put in"
    detail = (
        f"by over {limit:.3g} J (scene.hold_limit_j), because efforts are held for a period; raise "
        "rate_hz, or lower the stiffness it meets"
    )
    return SCENE._replace(guards={OVERDRAWN: Guard("overdrawn", sentence, detail)})


class SceneRun:
    """The scene of a run, its axes, and the mapping of their positions to the scene.

    Parameters
    ----------
    model : SceneModel or Model3d
        With books.
    axes, params : sequences of AxisState and AxisParams
        One per port of the network, in its order; one per axis of a port in three dimensions.
    scales, offsets : sequences of float
        Position in the scene: scale * position of the axis + offset.
    forces : sequence of sequences of float
        External force on each forced mass by slot [N]; 0 after its end.
    account : HoldAccount, optional
        Stops the run if held efforts have created too much energy.
    """

    def __init__(
        self,
        model: SceneModel | Model3d,
        axes: Sequence[AxisState],
        params: Sequence[AxisParams],
        scales: Sequence[float],
        offsets: Sequence[float],
        forces: Sequence[Sequence[float]],
        account: HoldAccount | None = None,
    ) -> None:
        self.model = model
        self.account = account
        self.axes = axes
        self.params = all_slotted(params)
        self.scales = scales
        self.offsets = offsets
        count = self.forced = len(forces)
        rows = array("d", chain.from_iterable(zip(*forces, strict=False)))
        self.pushed = len(rows)
        rows.extend([0.0] * count)  # what pushes after the end
        self.forces = memoryview(rows)  # a cycle's are handed over at once
        self.slot = 0
        self.positions = [0.0] * len(axes)
        self.efforts = [0.0] * len(axes)
        self.most = [RUNAWAY_TIMES * p.site.limit.effort for p in params]
        self._asked = [0.0] * len(axes)
        self.ended = 0

    def place(self, port: int) -> None:
        """Take the measured position of an axis."""
        self.positions[port] = self.scales[port] * self.axes[port].position + self.offsets[port]

    def begin(self) -> None:
        """Start the scene with the ports at their present positions."""
        self.model.reset(self.positions)
        self.slot = 0
        self.ended = 0
        if self.account is not None:
            self.account.begin()

    def is_calm(self, port: int, share: float) -> bool:
        """Return True if the scene at rest commands at most `share` of an axis' limit."""
        resting = self.scales[port] * self.model.resting_efforts()[port]
        return abs(resting) <= share * self.params[port].site.limit.effort

    def think(self, skipped: int, ramp: float) -> None:
        """Advance over the elapsed slots and this one; set the scene's efforts."""
        if not self.ended:
            self.ended = self._advance(skipped)
        for s, p, effort in zip(self.axes, self.params, self.efforts, strict=True):
            ceiling = ramp * p.ceiling
            ends = self.ended and not s.stopping
            s.stopping = s.stopping or self.ended != 0
            s.guard = render_axis(s, p, effort, ceiling) if s.valid else miss_axis(s, p, ceiling)
            if ends:
                s.guard = self.ended

    def _advance(self, skipped: int) -> int:
        """Step the network; return 0, or a guard's code with the efforts unchanged.

        RUNAWAY: its state is not finite or grows without bound (unstable). OVERDRAWN: holding its
        efforts has created more energy than allowed.
        """
        count = self.forced
        try:
            for _ in range(skipped + 1):
                at = min(count * self.slot, self.pushed)
                self.slot += 1
                pulls = self.model.advance(self.positions, self.forces[at : at + count])
        except ArithmeticError:  # powers of floats raise where products are infinite
            return RUNAWAY
        asked, most = self._asked, self.most
        for axis, pull in enumerate(pulls):
            asked[axis] = effort = self.scales[axis] * pull
            if not -most[axis] <= effort <= most[axis]:
                return RUNAWAY  # NaN as well
        account = self.account
        if account is not None and account.overdrawn(self.efforts, skipped + 1, self.model.booked):
            return OVERDRAWN
        self.efforts[:] = asked
        return 0

    def absorbed(self) -> float:
        """Return the energy that the devices gave [J]."""
        return absorbed(self.axes, range(len(self.axes)))


class SceneControl(Control):
    """A scene as the controller of its axes.

    `scene.hold` is the energy from the devices minus that received by the network;
    `scene.asked.PORT` the scene's effort before ramp and limits.

    Parameters
    ----------
    run, names, params
        See `Control`.
    ports : sequence of int
        The axis of each port of the network, in its order.
    port_names : sequence of str
        Names of the ports.
    nodes : sequence of str
        Names of the first entries of the network's positions, to be recorded.
    table : list of float
        Commands on their way.
    """

    scene: SceneRun

    def __init__(
        self,
        run: RunParams,
        names: Sequence[AxisName],
        params: Sequence[AxisParams],
        ports: Sequence[int],
        port_names: Sequence[str],
        nodes: Sequence[str],
        table: list[float],
    ) -> None:
        super().__init__(run, names, params, SCENE)
        self.ports = ports
        self._table = table
        self._nodes = range(len(nodes))
        for port, at in zip(port_names, ports, strict=True):
            self.columns += axis_columns(f"master.{port}", params[at], SCENE)
        self.columns += [f"scene.{name}" for name in Ledger._fields]
        self.columns += ["scene.residual", "scene.hold"]
        self.columns += [f"scene.asked.{port}" for port in port_names]
        self.columns += [f"scene.at.{name}" for name in nodes]

    def step(self, slot: int, skipped: int) -> bool:
        """Close every axis and step the scene, or engage."""
        r, o = self.run, self.state
        if o.armed_at < 0:
            return self._engage(slot)
        for port, at in enumerate(self.ports):
            s, p = self.axes[at], self.quick[at]
            for _ in range(skipped + 1):
                pass_slot(s, p, self._table, self.steps)
            take_sample(s, p, self.samples[at], self.steps)
            if s.valid:
                self.scene.place(port)
        self.scene.think(skipped, ramp_share(r, o, slot))
        for at in self.ports:
            stop_on_guard(r, o, self.axes, slot, at)
        return True

    def _engage(self, slot: int) -> bool:
        """Start the scene with its ports where they are, once its efforts there are small."""
        r, o = self.run, self.state
        if o.kind != FINISHED:
            return True  # a stop has begun: do not engage
        armed = True
        for port, at in enumerate(self.ports):
            m = self.samples[at]
            if not m.valid:
                armed = False
                continue
            start_axis(self.axes[at], self.params[at], m.position, m.effort)
            self.axes[at].end.absorbed = 0.0
            self.scene.place(port)
            self.scene.begin()
            armed = self.scene.is_calm(port, r.arm_share) and armed
        if not arm(r, o, slot, armed):
            return False
        if o.armed_at == slot:
            self.scene.begin()
            self.scene.think(0, ramp_share(r, o, slot))
        return True

    def retune(self, which: int, p: AxisParams) -> None:
        """Put other constants in place of an axis'."""
        super().retune(which, p)
        self.scene.params[self.ports.index(which)] = slotted(p)

    def fill(self, row: Row, at: int) -> None:
        """Write all columns of the scene at index `at`: axes, energies, where its nodes are."""
        run = self.scene
        for which in self.ports:
            at = fill_axis(row, at, self.axes[which], self.quick[which], 1.0, self.steps)
        ledger = run.model.booked
        start = run.model.start
        for value in ledger:
            row[at] = value
            at += 1
        row[at] = ledger.residual(start)
        row[at + 1] = run.absorbed() - (ledger.port_work - start.port_work)
        at += 2
        for effort in run.efforts:
            row[at] = effort
            at += 1
        x = run.model.arrays.x
        for node in self._nodes:
            row[at] = x[node]
            at += 1
