"""`check`: examine a rig without touching a device."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from tautwave.config import Rig, bus_spec
from tautwave.contracts import Budget
from tautwave.errors import BusBudgetError, NotCertifiedError
from tautwave.registry import load_driver, require_modules
from tautwave.rig import BusWay, Simulate, Way, as_taken, bus_ways, command_delays
from tautwave.rig.claim_verdict import NOTHING_LEFT, bound_hints, claim_hints
from tautwave.session.claims import PortClaim, claims_of
from tautwave.session.facts import (
    allowance_rows,
    axis_rows,
    count_words,
    coupling_messages,
    load_facts,
    offset_costs,
    pair_rows,
    pair_sentence,
)
from tautwave.session.hooks import session_hooks
from tautwave.session.network import network_facts
from tautwave.session.plan import PlanItem, left_out, rig_plan
from tautwave.session.scales import scales_of
from tautwave.wording import Hint


class CheckResult(NamedTuple):
    """Result of a check. `certificate` is that of `tautwave.certificate`, as plain data.

    `pairs` and `axes` are rows of `tautwave.session.facts.PAIR_HEADS` and `AXIS_HEADS`, the short
    form of those facts; `claims` are those of its ports; `allowance` rows of
    `ALLOWANCE_HEADS`; `failures` holds a sentence for each reason why the rig may not run;
    `improvement` is what would make it better most, if anything is known.
    """

    rig: str
    plan: list[PlanItem]
    facts: list[tuple[str, str]]
    certificate: dict[str, Any]
    budget: dict[str, Budget]
    ways: dict[str, BusWay]
    exit_code: int
    pairs: list[tuple[str, ...]]
    axes: list[tuple[str, ...]]
    claims: list[PortClaim]
    allowance: list[tuple[str, ...]]
    failures: list[str]
    improvement: Hint | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain data for JSON."""
        return {
            "rig": self.rig,
            "plan": [item._asdict() for item in self.plan],
            "left_out": [f"{one.element}: {one.reason}" for one in left_out(self.plan)],
            "facts": dict(self.facts),
            "buses": {name: way.as_dict() for name, way in self.ways.items()},
            "claims": {claim.axis: claim.as_dict() for claim in self.claims},
            "certificate": self.certificate,
            "budget": {
                name: {
                    "time_s": cost.time_s,
                    # JSON has no infinity: null if nothing limits the rate.
                    "greatest_rate_hz": None
                    if cost.greatest_rate_hz == float("inf")
                    else cost.greatest_rate_hz,
                    "arithmetic": cost.arithmetic,
                    "remedy": cost.remedy,
                }
                for name, cost in self.budget.items()
            },
            "failures": self.failures,
            "improvement": None
            if self.improvement is None
            else {
                **dict(zip(("on", "text"), self.improvement, strict=True)),
                "set": self.improvement.change,
            },
            "exit_code": self.exit_code,
        }


def bus_budgets(rig: Rig) -> dict[str, Budget]:
    """Return the bus time of every bus, from its plugin's pure arithmetic."""
    budgets = {}
    for name, bus in rig.own_buses.items():
        plugin = load_driver(bus.driver)
        options = plugin.options.model_validate(bus.options)
        budgets[name] = plugin.budget(options, bus_spec(rig, name))
    return budgets


def require_drivers(rig: Rig) -> None:
    """Refuse a rig if a library of one of its drivers is not installed.

    Raises
    ------
    ConfigError
        Its message names the driver, the modules, and what to install.
    """
    for driver in dict.fromkeys(bus.driver for bus in rig.own_buses.values()):
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


def check(rig: Rig, *, simulate: Simulate = (), brief: bool = False) -> CheckResult:
    """Check a rig: ways of its buses, plan, bus time, certificate and the numbers that follow.

    Parameters
    ----------
    rig : Rig
        A checked rig.
    simulate : bool or collection of str
        As for `run`: buses to simulate although they name hardware.
    brief : bool
        Leave out what takes most of the time, and no verdict of the certificate rests on; of a
        scene also what a cycle costs.

    Returns
    -------
    CheckResult
        `exit_code` is 0, 4 when a bus is too slow, or 3 when the required verdict fails.
    """
    from tautwave.certificate import certify  # a live run imports this module, not the analysis

    ways = bus_ways(rig, simulate=simulate)
    rig = as_taken(rig, ways)
    delays = command_delays(rig)
    budgets = bus_budgets(rig)
    facts = [
        ("rate", _rate(rig)),
        ("coupling", _coupling(rig)),
    ]
    if rig.operate is not None:
        facts.append(("claims", _engagements(rig)))
        if rig.operate.scales:
            listed = ", ".join(f"{scale:g}" for scale in rig.operate.scales)
            facts.append(
                (
                    "scales",
                    f"1, {listed}: each is certified; the ports' claims are the largest of all",
                )
            )
    facts += [(f"bus {name}", way.describe()) for name, way in ways.items()]
    facts += _foreseen(rig)
    if any(way.way in (Way.SERVED, Way.ELSEWHERE) for way in ways.values()):
        facts.append(("--clock fake", "simulates every bus in memory"))
    if rig.scene is not None:
        facts += session_hooks().facts(rig, brief=brief)
    facts.extend((f"pair {name}", pair_sentence(rig, name, delays)) for name in rig.coupling.pairs)
    if rig.scene is None:
        if rig.link is not None:
            facts.extend(network_facts(rig, delays))
        facts.extend(_choices(rig))
        facts.extend(offset_costs(rig, delays))
        facts.extend(load_facts(rig, delays))
        facts.extend(coupling_messages(rig).facts(rig, delays))
        facts.extend(claim_hints(rig, delays))
        facts.extend(bound_hints(rig, delays))
        facts.extend(coupling_messages(rig).hints(rig))
    for axis_name, axis in rig.own_axes.items():
        units = "rad, N m, kg m^2" if axis.kind == "rotary" else "m, N, kg"
        text = (
            f"{axis.kind} {axis.causality} axis [{units}] on bus {axis.bus}, id {axis.id}; "
            f"effort limit {axis.effort_limit:g}"
        )
        facts.append((axis_name, f"{text}{count_words(rig, axis_name)}"))
    certificate = certify(rig, brief=brief).as_dict()
    scales = scales_of(rig)
    too_slow = over_budget(rig, budgets)
    failures = not_certified(certificate)
    claims = [claims_of(rig, delays, certificate["elements"])]
    for at_scale in scales:
        scaled = certify(at_scale, brief=True).as_dict()
        failures += [f"{at_scale.name}: {sentence}" for sentence in not_certified(scaled)]
        claims.append(claims_of(at_scale, delays, scaled["elements"]))
    exit_code = NotCertifiedError.exit_code if failures else 0
    if too_slow:
        exit_code = BusBudgetError.exit_code
    return CheckResult(
        rig.name,
        rig_plan(rig),
        facts,
        certificate,
        budgets,
        ways,
        exit_code,
        pair_rows(rig, delays),
        axis_rows(rig),
        _greatest(claims),
        allowance_rows(rig, delays),
        [*too_slow, *failures],
        _improvement(facts),
    )


def _improvement(facts: Sequence[tuple[str, str]]) -> Hint | None:
    """Return the hint that matters most: who cannot follow, claims, a value to set, any."""

    def rank(hint: Hint) -> tuple[bool, bool, bool]:
        starved = hint[0].startswith(NOTHING_LEFT)
        return not starved, hint[0] != "hint on claims", not hint.change

    return min((fact for fact in facts if isinstance(fact, Hint)), key=rank, default=None)


def _foreseen(rig: Rig) -> Iterator[tuple[str, str]]:
    """Yield what the devices' own files (EDS, DCF) foresee of a run, with no device opened."""
    for name, bus in rig.own_buses.items():
        plugin = load_driver(bus.driver)
        if plugin.foreseen is None:
            continue
        sentences = plugin.foreseen(plugin.options.model_validate(bus.options), bus_spec(rig, name))
        for number, sentence in enumerate(sentences, 1):
            yield f"bus {name}, note {number}", sentence


def _greatest(claims: Sequence[list[PortClaim]]) -> list[PortClaim]:
    """Return the greatest claim of each port among those at several scales."""
    return [max(same, key=lambda claim: claim.claim_j) for same in zip(*claims, strict=True)]


def not_certified(certificate: dict[str, Any]) -> list[str]:
    """Return a sentence for each element or loop that fails what the rig requires."""
    if certificate["passed"]:
        return []
    required = certificate["require"]
    verdicts = [element[required] for element in certificate["elements"] if required in element]
    if required == "coupled_stable":
        verdicts = [loop["verdict"] for loop in certificate["loops"]]
    failed = [verdict["reason"] for verdict in verdicts if not verdict["passed"]]
    return list(dict.fromkeys(failed)) or list(certificate["sentences"])


def _rate(rig: Rig) -> str:
    text = f"{rig.rate_hz:g} Hz, {rig.cycles} cycles in {rig.duration_s:g} s"
    if rig.claimed_s != rig.duration_s:
        text = f"{rig.rate_hz:g} Hz, until it is stopped"
    for name, bus in rig.own_buses.items():
        if bus.divisor > 1:
            text += f"; bus {name} every {bus.divisor} cycles, {rig.rate_hz / bus.divisor:g} Hz"
    return text


def _engagements(rig: Rig) -> str:
    span = "an hour" if rig.claimed_s != rig.duration_s else f"{rig.duration_s:g} s"
    return (
        f"of one engagement and {span}; each further one, after a clutch or a hold, begins with "
        "a full tank and adds its reserve and what may act unseen"
    )


def _coupling(rig: Rig) -> str:
    if rig.scene is not None:
        return session_hooks().words(rig)
    return coupling_messages(rig).coupling(rig)


def _choices(rig: Rig) -> Iterator[tuple[str, str]]:
    """Yield what the law chose for each key that the file leaves to it, and why."""
    if rig.law is not None:
        yield "law auto", rig.law.reason
    for path, choice in rig.choices.items():
        _, pair, key = path.split(".")
        short = key if len(rig.coupling.pairs) == 1 else f"{pair}.{key}"
        yield f"{short} auto", choice.reason
