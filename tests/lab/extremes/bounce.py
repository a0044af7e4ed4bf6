"""Bounces over the whole range of stiffness, mass, exponent, damping and step, scheme by scheme.

Every scheme gets every contact: it is refused as a rig would be, with numbers, or the exit speed
must be finite and, without a damper, equal to the entry speed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from tautwave.bench.result import Table, Value
from tautwave.models.foam import FoamParams
from tautwave.models.integrators.choice import refusal
from tautwave.models.integrators.schemes import DORMAND_PRINCE, EXACT, SCHEMES
from tautwave.models.plant_params import PlantParams, plant_cache
from tests.lab.extremes.kernel import Bounce, run_bounces

STIFFNESSES = tuple(10.0**power for power in range(10))
MASSES = (1e-6, 1e-4, 1e-2, 1.0, 100.0)
EXPONENTS = (1.0, 1.5, 2.0, 3.0)
STEPS = (0.1, 0.3, 1.0, 3.1, 10.0, 100.0, 1000.0)
DAMPINGS = (0.0, 1e-3, 1.0, 100.0, 1e4)
PHASES = (0.11, 0.52, 0.87)
RATES = (10.0, 100.0, 1e3, 1e4, 1e5)
MAX_TRIALS = 1000


class Case(NamedTuple):
    """One contact: k [N/m**a], a, mass [kg], damper [N s/m], step [s], share of a step before."""

    stiffness: float
    exponent: float
    mass: float
    damping: float
    h: float
    phase: float


class Worst(NamedTuple):
    """Results of a scheme on a set of cases.

    `usual_error` is that of the exit speed for 1e3 N/m**a and more, 0.1 to 100 steps per contact.
    """

    run: int
    refused: int
    why: str
    speed_error: float
    usual_error: float
    gained: float
    books: float
    not_finite: int
    stuck: int


def contact_time(stiffness: float, exponent: float, mass: float) -> float:
    """Return how long a mass of 1 m/s stays in a power-law contact [s] (W3 of the closed forms)."""
    one = exponent + 1.0
    deepest = math.pow(one * mass / (2.0 * stiffness), 1.0 / one)
    shape = math.sqrt(math.pi) * math.gamma(1.0 + 1.0 / one) / math.gamma(0.5 + 1.0 / one)
    return 2.0 * deepest * shape


def conservative_cases(
    stiffnesses: Sequence[float] = STIFFNESSES,
    masses: Sequence[float] = MASSES,
    steps: Sequence[float] = STEPS,
) -> Iterator[Case]:
    """Give contacts without a damper, by steps per contact."""
    for k, a, m, n, phase in itertools.product(stiffnesses, EXPONENTS, masses, steps, PHASES):
        yield Case(k, a, m, 0.0, contact_time(k, a, m) / n, phase)


def damped_cases(
    stiffnesses: Sequence[float] = STIFFNESSES, masses: Sequence[float] = MASSES
) -> Iterator[Case]:
    """Give walls with a damper, by rate."""
    for k, m, b, rate in itertools.product(stiffnesses, masses, DAMPINGS, RATES):
        yield Case(k, 1.0, m, b, 1.0 / rate, PHASES[1])


def restitution(case: Case) -> float:
    """Return the exit speed of a linear wall with a damper that lets go where it would pull [1]."""
    zeta = case.damping / (2.0 * math.sqrt(case.stiffness * case.mass))
    if zeta < 1e-9:
        return 1.0
    if zeta < 1.0:
        root = math.sqrt(1.0 - zeta * zeta)
        return math.exp(-2.0 * zeta / root * math.atan2(root, zeta))
    if zeta > 1e6:  # the root below is zeta, to rounding
        return 1.0 / (4.0 * zeta * zeta)
    root = math.sqrt(zeta * zeta - 1.0)
    if root < 1e-6:
        return math.exp(-2.0)
    # atanh(root / zeta) = ln(zeta + root): nothing cancels.
    return math.exp(-2.0 * zeta / root * math.log(zeta + root))


def refused(case: Case, scheme: int) -> str:
    """Return why a rig with this contact and scheme is refused, "" if it is not."""
    if scheme == EXACT:
        return "" if case.exponent == 1.0 else "exact: closed forms for walls and springs only"
    if scheme == DORMAND_PRINCE:
        needed = case.damping / case.mass * case.h / 3.3
        if needed > MAX_TRIALS:  # a rig's trial bounce would show it, slowly
            return f"dormand_prince needs some {needed:.1g} steps of its own in each at this damper"
        return ""
    return refusal(_plant(case), _foam(case, scheme), scheme, 1.0, case.h)


def measure(cases: Sequence[Case], scheme: int, *, fast: bool = True) -> Worst:
    """Run all cases of one scheme that are not refused."""
    reasons = [refused(case, scheme) for case in cases]
    kept = [case for case, reason in zip(cases, reasons, strict=True) if not reason]
    ends = run_bounces([_bounce(case, scheme) for case in kept], fast=fast)
    speed = usual = gained = books = 0.0
    not_finite = stuck = 0
    for case, end in zip(kept, ends, strict=True):
        if not end.finite:
            not_finite += 1
            continue
        start = 0.5 * case.mass
        if not end.out:
            stuck += 1
            continue
        energy = 0.5 * case.mass * float(end.v) ** 2
        gained = max(gained, energy / start - 1.0)
        books = max(books, abs(energy + float(end.lost) - start) / start)
        if case.damping == 0.0 or scheme == EXACT:
            error = abs(-float(end.v) - restitution(case))
            speed = max(speed, error)
            steps = contact_time(case.stiffness, case.exponent, case.mass) / case.h
            if case.stiffness >= 1e3 and 0.09 < steps < 110.0:
                usual = max(usual, error)
    why = next((reason for reason in reversed(reasons) if reason), "")
    return Worst(
        len(kept), len(cases) - len(kept), why, speed, usual, gained, books, not_finite, stuck
    )


def bounce_tables(*, fast: bool = True) -> tuple[list[Table], dict[str, Worst]]:
    """Return the tables of undamped and damped contacts, and the figures by scheme."""
    plain = list(conservative_cases())
    damped = list(damped_cases())
    found: dict[str, Worst] = {}
    rows: list[list[Value]] = []
    more: list[list[Value]] = []
    reasons: list[list[Value]] = []
    for name, scheme in SCHEMES.items():
        found[name] = measure(plain, scheme, fast=fast)
        rows.append(_row(name, found[name]))
        lossy = measure(damped, scheme, fast=fast)
        more.append(_row(name, lossy))
        for where, worst in (("no damper", found[name]), ("damper", lossy)):
            if worst.refused:
                reasons.append([f"{name}, {where}", worst.refused, worst.why])
    columns = (
        "scheme",
        "run",
        "refused",
        "exit_speed_error",
        "of_usual_ones",
        "energy_gained",
        "books_off",
        "not_finite",
        "not_out",
    )
    return [
        Table(
            "Contacts without a damper",
            f"{len(plain)} bounces at 1 m/s: k 1 to 1e9 N/m^a, a 1 to 3, mass 1 mg to 100 kg, 0.1 "
            "to 1000 steps per contact, three entry phases; worst over those that are not refused; "
            "exit speed against 1 m/s (usual ones: k from 1e3, up to 100 steps), energy at "
            "the exit and books as shares of that before",
            columns,
            rows,
        ),
        Table(
            "Walls with a damper",
            f"{len(damped)} bounces at 1 m/s: k 1 to 1e9 N/m, damper 0 to 1e4 N s/m, mass 1 mg to "
            "100 kg, 10 Hz to 100 kHz; exit speed against the closed form (exact only; undamped "
            "walls for the others); not out: still pressed after 200 steps, or creeping",
            columns,
            more,
        ),
        Table(
            "Contacts that were refused",
            "scheme and contacts, how many of them, and the sentence for the last",
            ("contacts", "count", "because"),
            reasons,
        ),
    ], found


def _row(name: str, worst: Worst) -> list[Value]:
    return [
        name,
        worst.run,
        worst.refused,
        worst.speed_error,
        worst.usual_error,
        worst.gained,
        worst.books,
        worst.not_finite,
        worst.stuck,
    ]


def _plant(case: Case) -> PlantParams:
    return PlantParams(
        mass=case.mass,
        viscous=0.0,
        coulomb=0.0,
        grip_stiffness=0.0,
        grip_damping=0.0,
        spring_stiffness=0.0,
        spring_position=0.0,
        wall_stiffness=0.0,
        wall_damping=0.0,
        wall_position=0.0,
        wall_side=1.0,
    )


def _foam(case: Case, scheme: int) -> FoamParams:
    return FoamParams(
        case.stiffness, case.exponent, 0.0, 0.0, 1.0, 1, case.damping, max(scheme, 0), 1e-10
    )


def _bounce(case: Case, scheme: int) -> Bounce:
    plant = _plant(case)
    if scheme == EXACT:
        plant = plant._replace(wall_stiffness=case.stiffness, wall_damping=case.damping)
    steps = 200 + int(4.0 * contact_time(case.stiffness, case.exponent, case.mass) / case.h)
    return Bounce(
        plant=plant,
        cache=plant_cache(plant, case.h),
        foam=_foam(case, scheme),
        x=-case.phase * case.h,
        v=1.0,
        h=case.h,
        steps=min(steps, 20_000),
        exact=scheme == EXACT,
        whole=False,
    )
