"""`check`: what a rig would do, without touching a device."""

from __future__ import annotations

from typing import Any, NamedTuple

from tautwave.config import Rig, bus_spec
from tautwave.contracts import Budget
from tautwave.errors import BusBudgetError, NotCertifiedError
from tautwave.registry import load_driver, require_modules
from tautwave.rig import command_delays
from tautwave.session.facts import admittance_facts, hints, pair_facts
from tautwave.session.plan import PlanItem, left_out, rig_plan


class CheckResult(NamedTuple):
    """What a check found. `certificate` is that of `tautwave.certificate`, as plain data."""

    rig: str
    plan: list[PlanItem]
    facts: list[tuple[str, str]]
    certificate: dict[str, Any]
    budget: dict[str, Budget]
    exit_code: int

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain data for JSON."""
        return {
            "rig": self.rig,
            "plan": [item._asdict() for item in self.plan],
            "left_out": left_out(self.plan),
            "facts": dict(self.facts),
            "certificate": self.certificate,
            "budget": {
                name: {
                    "time_s": cost.time_s,
                    # JSON has no infinity: null where nothing limits the rate.
                    "greatest_rate_hz": None
                    if cost.greatest_rate_hz == float("inf")
                    else cost.greatest_rate_hz,
                    "arithmetic": cost.arithmetic,
                    "remedy": cost.remedy,
                }
                for name, cost in self.budget.items()
            },
            "exit_code": self.exit_code,
        }


def bus_budgets(rig: Rig) -> dict[str, Budget]:
    """Return the bus time of every bus, from its plugin's pure arithmetic."""
    budgets = {}
    for name, bus in rig.buses.items():
        plugin = load_driver(bus.driver)
        options = plugin.options.model_validate(bus.options)
        budgets[name] = plugin.budget(options, bus_spec(rig, name))
    return budgets


def require_drivers(rig: Rig) -> None:
    """Refuse a rig where a library of one of its drivers is not installed.

    Raises
    ------
    ConfigError
        It names the driver, the modules, and what to install.
    """
    for driver in dict.fromkeys(bus.driver for bus in rig.buses.values()):
        require_modules(driver)


def over_budget(rig: Rig, budgets: dict[str, Budget]) -> list[str]:
    """Return one sentence per bus that is too slow for the rig."""
    return [
        f"bus {name}: {cost.time_s * 1e3:.3f} ms per cycle do not fit in "
        f"{1e3 * rig.period_s * rig.buses[name].divisor:.3f} ms; "
        f"the greatest rate that fits is {cost.greatest_rate_hz:.0f} Hz"
        + (f"; {cost.remedy}" if cost.remedy else "")
        for name, cost in budgets.items()
        if cost.time_s > rig.period_s * rig.buses[name].divisor
    ]


def check(rig: Rig) -> CheckResult:
    """Check a rig: plan, bus time, certificate and the numbers that follow.

    Returns
    -------
    CheckResult
        `exit_code` is 0, 4 when a bus is too slow, or 3 when the required verdict fails.
    """
    from tautwave.certificate import certify  # a live run imports this module, not the analysis

    delays = command_delays(rig)
    budgets = bus_budgets(rig)
    facts = [
        ("rate", _rate(rig)),
        ("coupling", _coupling(rig)),
    ]
    if rig.scene is not None:
        from tautwave.session.scene_pace import pace_fact

        facts.append(("scene time", pace_fact(rig)))
    for name in rig.coupling.pairs:
        known = pair_facts(rig, name, delays)
        kind = rig.master.axes[name].kind
        unit = "rad per N m" if kind == "rotary" else "m per N"
        facts.append(
            (
                f"pair {name}",
                f"one-way delay {known.coupling_delay_s:.4g} s in all; "
                f"standing offset {known.offset_per_effort:.4g} {unit}; "
                f"held still, a port gives {known.held_share:.1%} of the line's effort",
            )
        )
    facts.extend(admittance_facts(rig, delays))
    facts.extend(hints(rig))
    for axis_name, axis in rig.axes.items():
        units = "rad, N m, kg m^2" if axis.kind == "rotary" else "m, N, kg"
        facts.append(
            (
                axis_name,
                f"{axis.kind} {axis.causality} axis [{units}] on bus {axis.bus}, id {axis.id}; "
                f"effort limit {axis.effort_limit:g}",
            )
        )
    certificate = certify(rig).as_dict()
    exit_code = 0 if certificate["passed"] else NotCertifiedError.exit_code
    if over_budget(rig, budgets):
        exit_code = BusBudgetError.exit_code
    return CheckResult(rig.name, rig_plan(rig), facts, certificate, budgets, exit_code)


def _rate(rig: Rig) -> str:
    told = f"{rig.rate_hz:g} Hz, {rig.cycles} cycles in {rig.duration_s:g} s"
    for name, bus in rig.buses.items():
        if bus.divisor > 1:
            told += f"; bus {name} every {bus.divisor} cycles, {rig.rate_hz / bus.divisor:g} Hz"
    return told


def _coupling(rig: Rig) -> str:
    keys = rig.coupling
    if rig.scene is not None:
        return f"none: the master's axes touch a scene, scheme {rig.scene.scheme}"
    if keys.law == "wave":
        return f"wave line, {keys.delay_s:g} s each way ({rig.delay_samples} samples)"
    return f"positions, {keys.delay_s:g} s each way (not passive: for comparison)"
