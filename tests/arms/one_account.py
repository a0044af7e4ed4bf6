"""What one account over all waves of an arm would buy: the shipped rigs with it and without.

    python -m tests.arms.one_account six-seven --reserve 1 0.01 [--set KEY=VALUE ...]

Each coordinate of a tip has a tank of its own. Here the same rig runs with them as they are, then
with one for all coordinates of a side, which holds what they hold together: a coordinate that needs
energy takes the others'. `--reserve` scales the reserves. Printed for each: how far the slave is
from where the master was a delay ago, rms after the first second, in position and in turn; the
least that a tank held, as a share of its reserve (one account: of all reserves of its side); and
the waves that were cut for want of energy, as a share of what was wanted.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tautwave.config import load_rig
from tautwave.controller.slotted import slotted
from tautwave.rig import build_rig
from tautwave.simulation.memory import run_in_memory

CONFIGS = Path(__file__).parents[2] / "configs" / "arms"


class Member(NamedTuple):
    """A port, the constants it runs with, and the other ports of its side with theirs."""

    name: str
    params: Any
    others: list[Any]


class Purse:
    """Steps of a wave coupling whose tanks are one per side, or, not `shared`, as they are."""

    def __init__(self, control: Any, factor: float, shared: bool) -> None:
        self.least: dict[str, float] = {}
        self.wanted: dict[str, float] = {}
        self.cut: dict[str, float] = {}
        self.control = control
        control.params = [with_reserve(p, factor, factor) for p in control.params]
        ports = list(zip(control.names, control.axes, control.params, strict=True))
        self.members: dict[int, Member] = {}
        for name, s, p in ports:
            side = [one for one in ports if one[0].bus == name.bus]
            others = [(o.end, q.end.port.kept) for _, o, q in side if o is not s] if shared else []
            whole = sum(q.end.port.reserve for _, _, q in side) / p.end.port.reserve
            params = slotted(with_reserve(p, whole, whole) if shared else p)
            self.members[id(s)] = Member(name.name, params, others)
        steps = control.law.steps
        self.closed = self.lending(steps.close)
        control.law = control.law._replace(
            steps=steps._replace(
                close=self.close,
                compute_effort=self.lending(steps.compute_effort),
                brake=self.lending(steps.brake),
                on_missing=self.lending(steps.on_missing),
            )
        )

    def lending(self, step: Callable[..., Any]) -> Callable[..., Any]:
        """Return a step of a port that finds what all ports of its side have in its own tank."""

        def lent(s: Any, _: Any, *more: Any) -> Any:
            member = self.members[id(s)]
            # What a filter still has to send is its own port's.
            more_held = sum(e.account - kept * e.filtered**2 for e, kept in member.others)
            s.end.account += more_held
            found = step(s, member.params, *more)
            s.end.account -= more_held
            return found

        return lent

    def close(self, s: Any, p: Any, *more: Any) -> None:
        """Close, and look at what was left and what was cut."""
        self.closed(s, p, *more)
        member, e = self.members[id(s)], s.end
        held = e.account + sum(other.account for other, _ in member.others)
        share = held / member.params.end.port.reserve
        name = member.name
        self.least[name] = min(self.least.get(name, math.inf), share)
        self.wanted[name] = self.wanted.get(name, 0.0) + e.filtered**2
        if held < 1e-12:
            lost = e.filtered**2 - (e.leaving * p.end.wave) ** 2
            self.cut[name] = self.cut.get(name, 0.0) + max(lost, 0.0)


def with_reserve(p: Any, factor: float, empty: float) -> Any:
    """Return an axis' constants with another reserve."""
    port = p.end.port._replace(reserve=factor * p.end.port.reserve)
    return p._replace(end=p.end._replace(port=port, empty=empty * p.end.empty))


def behind(rig: Any, rows: Mapping[str, Any], names: list[str]) -> float:
    """Return how far the slave is from the master a delay ago, rms [mm or mrad]; NaN: too short."""
    late = round(rig.coupling.delay_s * rig.rate_hz)
    begin = round(rig.rate_hz)
    if not names or len(rows[f"master.{names[0]}.position"]) <= begin:
        return math.nan
    total = 0.0
    for name in names:
        master, slave = rows[f"master.{name}.position"], rows[f"slave.{name}.position"]
        scale = rig.coupling.pairs[name].position_scale
        led = scale * (master[begin - late : -late] - master[0])
        total = total + (led - (slave[begin:] - slave[0])) ** 2
    return 1e3 * math.sqrt(np.mean(total))


def main() -> None:
    """Run both ways at each reserve, and print what they did."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rig", choices=("planar", "six-seven"))
    parser.add_argument("--reserve", type=float, nargs="+", default=[1.0])
    parser.add_argument("--set", action="append", default=[])
    asked = parser.parse_args()
    rig = load_rig(CONFIGS / f"{asked.rig}.yaml", asked.set)
    turns = [name for name in rig.coupling.pairs if name.startswith("r")]
    ways = [name for name in rig.coupling.pairs if name not in turns]
    for factor in asked.reserve:
        for shared in (False, True):
            built = build_rig(rig, clock="fake")
            purse = Purse(built.control, factor, shared)
            result, data = run_in_memory(built)
            rows = dict(zip(built.columns, data.T, strict=True))
            least = min(purse.least, key=lambda name: purse.least[name])
            cut = {name: f"{lost / purse.wanted[name]:.1e}" for name, lost in purse.cut.items()}
            print(
                f"{factor:g} of the reserve, {'one account' if shared else 'own tanks  '}: "
                f"{behind(rig, rows, ways):.2f} mm, {behind(rig, rows, turns):.2f} mrad; least "
                f"{purse.least[least]:.3f} ({least}); cut {cut or 'nothing'}"
                f"{'' if result.error is None else f'; {result.error}'}",
                flush=True,
            )


if __name__ == "__main__":
    main()
