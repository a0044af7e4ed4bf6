"""A scene in the loop: axes of the master as its ports, and its books.

All ports of a cycle are closed first; the last one advances the scene by one period with what is
measured now, and every axis gets the effort that answers it: the paper's one-sample structure. What
ramp and limits cut off, and what a held effort creates, is the difference between what the devices
gave and what the network got: `hold`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tautwave.contracts import Row
from tautwave.laws.limit import OVERDRAWN, RUNAWAY, RUNAWAY_TIMES, guard_axis, limit_effort
from tautwave.runtime.books import axis_columns, fill_axis
from tautwave.runtime.hold import HoldAccount
from tautwave.runtime.pair import Pair, PairScale
from tautwave.runtime.site import SiteAxis
from tautwave.scene.ledger import Ledger
from tautwave.scene.live import SceneModel
from tautwave.types import JointState

if TYPE_CHECKING:  # a scene of one dimension loads nothing of three
    from tautwave.scene.space.live import SpaceModel

MOST_NODES = 100
"""Positions of more nodes are not recorded."""


class SceneAxis(SiteAxis):
    """An impedance axis that renders an effort from elsewhere, within its limits."""

    __slots__ = ()

    @property
    def command_delay(self) -> tuple[int, float]:
        """Whole periods until a command acts, and the rest as a share of one."""
        return len(self._pipe), self._late

    def render(self, effort: float, ceiling: float) -> int:
        """Send a resisting effort [N m or N]; return the guard's code (0: all is well)."""
        limit = self.params.limit
        guard = guard_axis(limit, self.position, self.velocity)
        if guard or self.stopping:
            self.stop_command(ceiling)
            return guard
        total = limit_effort(limit, effort, self._command_total, ceiling)
        self.asked = effort
        self._command_total = total
        self.port_effort = total
        self.command = -total
        return 0


class SceneRun:
    """The scene of a run, its axes, and how their positions are the scene's.

    Parameters
    ----------
    model : SceneModel or SpaceModel
        With books.
    sites : sequence of SceneAxis
        One per port of the network, in its order; one per axis of a port in three dimensions.
    scales, offsets : sequences of float
        Position in the scene: scale * position of the axis + offset.
    forces : sequence of sequences of float
        Outside force on each forced mass by slot [N]; 0 after its end.
    account : HoldAccount, optional
        Ends the run where holding the efforts has created too much.
    """

    def __init__(
        self,
        model: SceneModel | SpaceModel,
        sites: Sequence[SceneAxis],
        scales: Sequence[float],
        offsets: Sequence[float],
        forces: Sequence[Sequence[float]],
        account: HoldAccount | None = None,
    ) -> None:
        self.model = model
        self.account = account
        self.sites = sites
        self._scales = scales
        self._offsets = offsets
        self._forces = forces
        self._slots = min(map(len, forces), default=0)
        self.slot = 0
        self.positions = [0.0] * len(sites)
        self.efforts = [0.0] * len(sites)
        self.guards = [0] * len(sites)
        self._most = [RUNAWAY_TIMES * site.params.limit.effort for site in sites]
        self._ended = 0

    def place(self, port: int) -> None:
        """Take where an axis was measured."""
        self.positions[port] = self._scales[port] * self.sites[port].position + self._offsets[port]

    def begin(self) -> None:
        """Start the scene with the ports where they are."""
        self.model.reset(self.positions)
        self.slot = 0
        self._ended = 0
        if self.account is not None:
            self.account.begin()

    def resting(self, port: int) -> float:
        """Return what the scene at rest would ask of an axis [N m or N]."""
        return self._scales[port] * self.model.resting_efforts()[port]

    def think(self, skipped: int, ramp: float) -> None:
        """Advance over the slots that went by and this one; render what the scene answers."""
        if not self._ended:
            self._ended = self._advance(skipped)
        for port, site in enumerate(self.sites):
            effort = self.efforts[port]
            if self._ended and not site.stopping:
                self.guards[port] = self._ended
                site.stop_command(ramp * site.ceiling)
            elif site.valid:
                self.guards[port] = site.render(effort, ramp * site.ceiling)
            elif site.stopping:
                site.fade(ramp * site.ceiling)

    def _advance(self, skipped: int) -> int:
        """Step the network; return 0, or a guard's code and leave the efforts as they were.

        RUNAWAY: its state is not finite or grows beyond all scales, an unstable instrument.
        OVERDRAWN: holding its efforts has created more energy than can be answered for.
        """
        try:
            for _ in range(skipped + 1):
                at = self.slot
                self.slot = at + 1
                pushes = (
                    [force[at] for force in self._forces] if at < self._slots else self._silence
                )
                pulls = self.model.advance(self.positions, pushes)
        except ArithmeticError:  # powers of floats raise where products are infinite
            return RUNAWAY
        asked = [scale * pull for scale, pull in zip(self._scales, pulls, strict=True)]
        if not all(-most <= one <= most for most, one in zip(self._most, asked, strict=True)):
            return RUNAWAY  # NaN as well
        account = self.account
        if account is not None and account.overdrawn(self.efforts, skipped + 1, self.model.booked):
            return OVERDRAWN
        self.efforts[:] = asked
        return 0

    @property
    def _silence(self) -> list[float]:
        return [0.0] * len(self._forces)

    def absorbed(self) -> float:
        """Return the energy that the devices gave [J]."""
        return sum(site.port_absorbed for site in self.sites)

    def ledger(self) -> Ledger:
        """Return the energies of the scene at the last sample."""
        return self.model.booked


class ScenePort(Pair):
    """One axis of a scene, to the loop a pair whose two sides are the same axis."""

    def __init__(self, name: str, run: SceneRun, port: int) -> None:
        site = run.sites[port]
        super().__init__(name, site, site, PairScale(1.0, 1.0, 1.0, 1.0))
        self.run = run
        self._port = port
        self._site = run.sites[port]
        self._last = port == len(run.sites) - 1

    def start(self, master: JointState, slave: JointState, offset: float | None) -> None:
        """Start at the measured position; the scene begins anew."""
        self.master.start(master.position, master.effort, 0.0)
        self.run.place(self._port)
        self.run.begin()

    def arm(self, share: float) -> bool:
        """Return True when the scene at rest asks for less than `share` of the limit."""
        return abs(self.run.resting(self._port)) <= share * self._site.params.limit.effort

    def engage(self, ramp: float) -> None:
        """Think for the first time."""
        if self._last:
            self.run.begin()
            self.run.think(0, ramp)

    def cycle(self, master: JointState, slave: JointState, skipped: int, ramp: float) -> None:
        """Close this axis; the last one lets the scene think."""
        site = self._site
        for _ in range(skipped + 1):
            site.pass_slot()
        position, _, effort, valid, _ = master
        if valid:
            site.close(position, effort)
            self.run.place(self._port)
        else:
            site.miss()
        if self._last:
            self.run.think(skipped, ramp)
        self.guard = self.run.guards[self._port]

    def position_error(self) -> float:
        """Return 0: nothing follows this axis."""
        return 0.0

    def effort_error(self) -> float:
        """Return by how much limits and ramp changed what the scene asked for [N m or N]."""
        return self._site.port_effort - self.run.efforts[self._port]


class SceneRow:
    """The columns of a scene: its axes, its energies, where its nodes are.

    `scene.hold` is what the devices gave less what the network got; `scene.asked.PORT` what the
    scene asked for before ramp and limits. `ports` are the names of the axes, `names` those of the
    first entries of the network's positions.
    """

    def __init__(self, run: SceneRun, ports: Sequence[str], names: Sequence[str]) -> None:
        self._run = run
        self._nodes = range(len(names))
        self.columns: list[str] = []
        for port, site in zip(ports, run.sites, strict=True):
            self.columns += axis_columns(f"master.{port}", site)
        self.columns += [f"scene.{name}" for name in Ledger._fields]
        self.columns += ["scene.residual", "scene.hold"]
        self.columns += [f"scene.asked.{port}" for port in ports]
        self.columns += [f"scene.at.{name}" for name in names]

    def fill(self, row: Row, at: int) -> None:
        """Write all columns of the scene at index `at`."""
        run = self._run
        for site in run.sites:
            at = fill_axis(site, 1.0, row, at)
        told = run.ledger()
        start = run.model.start
        for value in told:
            row[at] = value
            at += 1
        row[at] = told.residual(start)
        row[at + 1] = run.absorbed() - (told.port_work - start.port_work)
        at += 2
        for effort in run.efforts:
            row[at] = effort
            at += 1
        x = run.model.arrays.x
        for node in self._nodes:
            row[at] = x[node]
            at += 1
